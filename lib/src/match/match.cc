// Matching by the kernel mutual_nearest and the ratio test. Formulas: docs/algorithms/match.md;
// test: test/unit/test_match.c.
#include "match/match.h"

#include <cmath>
#include <cstdint>

namespace tv {

size_t match_bytes(int32_t max_keypoints) {
  const size_t n = static_cast<size_t>(max_keypoints);
  return 2 * arena_bytes<tvk_nearest>(n) +
         arena_bytes<uint8_t>(TVK_NEAREST_SCRATCH(max_keypoints, max_keypoints)) +
         arena_bytes<tv_correspondence>(n);
}

int32_t match_descriptors(const tvk_table& kernels, const uint8_t* descriptors0, int32_t num0,
                          const uint8_t* descriptors1, int32_t num1, float ratio, Arena& arena,
                          tv_correspondence* correspondences) {
  if (num0 < 2 || num1 < 2) return 0;  // without a second neighbour the ratio is 1
  ArenaScope scope(arena);
  tvk_nearest* rows = arena_alloc<tvk_nearest>(arena, static_cast<size_t>(num0));
  tvk_nearest* columns = arena_alloc<tvk_nearest>(arena, static_cast<size_t>(num1));
  void* scratch = arena_alloc<uint8_t>(arena, TVK_NEAREST_SCRATCH(num0, num1));
  kernels.mutual_nearest(descriptors0, num0, descriptors1, num1, scratch, columns, rows);
  int32_t count = 0;
  for (int32_t i = 0; i < num0; ++i) {
    const tvk_nearest& row = rows[i];
    if (row.idx < 0) continue;
    // `worse` is the larger of the two directions' ratios, because row.second is the smaller of
    // their second distances.
    const float worse = static_cast<float>(
        std::sqrt(static_cast<double>(row.best) / static_cast<double>(row.second)));
    if (worse >= ratio) continue;
    correspondences[count++] =
        tv_correspondence{i, row.idx, static_cast<uint32_t>(row.best), worse};
  }
  return count;
}

}  // namespace tv
