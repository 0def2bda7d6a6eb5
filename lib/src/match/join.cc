#include "match/join.h"

#include <cstring>

#include "match/rank.h"

namespace tv {

int32_t join_matches(const tv_correspondence* matches, int32_t num_matches, Arena& arena,
                     int32_t max_keypoints, tv_correspondence* found, int32_t num_found) {
  ArenaScope scope(arena);
  uint8_t* used = arena_alloc<uint8_t>(arena, 2 * static_cast<size_t>(max_keypoints));
  std::memset(used, 0, 2 * static_cast<size_t>(max_keypoints));
  for (int32_t k = 0; k < num_matches; ++k) {
    used[2 * matches[k].idx0] = used[2 * matches[k].idx1 + 1] = 1;
  }
  int32_t num_new = 0;
  for (int32_t k = 0; k < num_found; ++k) {
    const tv_correspondence m = found[k];
    if (used[2 * m.idx0] == 0 && used[2 * m.idx1 + 1] == 0) found[num_new++] = m;
  }
  int32_t a = num_matches - 1, b = num_new - 1;
  // The merge runs from the end, because `found` is an input and receives the result.
  for (int32_t k = num_matches + num_new - 1; a >= 0; --k) {
    found[k] = b >= 0 && found[b].idx0 > matches[a].idx0 ? found[b--] : matches[a--];
  }
  return num_matches + num_new;
}

int32_t keep_best(tv_correspondence* matches, int32_t most, int32_t* num_matches) {
  const int32_t num = *num_matches;
  if (num <= most) return 0;
  uint64_t limit = 0;  // the largest rank with at most `most` ranks below it, found bit by bit
  for (int bit = 62;; --bit) {
    const bool last = bit < 0;
    const uint64_t trial = last ? limit : limit | uint64_t{1} << bit;
    int32_t below = 0;
    for (int32_t k = 0; k < num; ++k) {
      if (rank_of(matches[k]) >= trial) continue;
      if (last) matches[below] = matches[k];
      ++below;
    }
    if (last) return num - (*num_matches = below);
    if (below <= most) limit = trial;
  }
}

}  // namespace tv
