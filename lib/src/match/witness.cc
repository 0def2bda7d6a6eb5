// Greedy, from the most precise match on: a match is kept unless one that was kept before is of the
// same place. Kept matches are found through a hash of the cell of their keypoint in image 0. Test:
// test/unit/test_witness.cc.
#include "match/witness.h"

#include <algorithm>
#include <cstdint>

#include "match/rank.h"

namespace tv {
namespace {

struct Candidate {
  float variance;
  int32_t index;
  uint64_t rank;
};

bool is_before(const Candidate& a, const Candidate& b) {
  return a.variance != b.variance ? a.variance < b.variance : a.rank < b.rank;
}

bool is_near(const tv_keypoint& a, const tv_keypoint& b) {
  const float dx = a.x - b.x, dy = a.y - b.y;
  return dx < kOnePlacePx && dx > -kOnePlacePx && dy < kOnePlacePx && dy > -kOnePlacePx;
}

// The cell of a coordinate, which is within 1e5 pixels.
int32_t cell_of(float x) { return static_cast<int32_t>(x / kOnePlacePx + 65536); }

uint32_t slot_of(int32_t cell_x, int32_t cell_y, uint32_t mask) {
  return (static_cast<uint32_t>(cell_x) * 73856093u ^ static_cast<uint32_t>(cell_y) * 19349663u) &
         mask;
}

uint32_t num_slots(int32_t max_matches) {
  uint32_t slots = 16;
  while (slots < static_cast<uint32_t>(max_matches)) slots *= 2;
  return slots;
}

}  // namespace

size_t witness_bytes(int32_t max_matches) {
  const size_t n = static_cast<size_t>(max_matches);
  return arena_bytes<Candidate>(n) + arena_bytes<int32_t>(num_slots(max_matches)) +
         arena_bytes<int32_t>(n) + arena_bytes<uint8_t>(n);
}

int32_t keep_witnesses(const tv_keypoint* const keypoints[2], const float* variances,
                       tv_correspondence* matches, int32_t num, Arena& arena) {
  ArenaScope scope(arena);
  const size_t n = static_cast<size_t>(num);
  Candidate* const candidates = arena_alloc<Candidate>(arena, n);
  const uint32_t slots = num_slots(num);
  int32_t* const heads = arena_alloc<int32_t>(arena, slots);  // the last kept match of each slot
  int32_t* const previous = arena_alloc<int32_t>(arena, n);   // the one kept before it there
  uint8_t* const stays = arena_alloc<uint8_t>(arena, n);
  std::fill(heads, heads + slots, -1);
  for (int32_t k = 0; k < num; ++k) candidates[k] = {variances[k], k, rank_of(matches[k])};
  std::sort(candidates, candidates + num, is_before);
  for (int32_t c = 0; c < num; ++c) {
    const int32_t k = candidates[c].index;
    const tv_keypoint& a = keypoints[0][matches[k].idx0];
    const tv_keypoint& b = keypoints[1][matches[k].idx1];
    const int32_t x = cell_of(a.x), y = cell_of(a.y);
    bool is_known = false;
    for (int cell = 0; cell < 9 && !is_known; ++cell) {
      int32_t other = heads[slot_of(x + cell % 3 - 1, y + cell / 3 - 1, slots - 1)];
      for (; other >= 0 && !is_known; other = previous[other]) {
        is_known = is_near(a, keypoints[0][matches[other].idx0]) &&
                   is_near(b, keypoints[1][matches[other].idx1]);
      }
    }
    stays[k] = !is_known;
    if (is_known) continue;
    int32_t& head = heads[slot_of(x, y, slots - 1)];
    previous[k] = head;
    head = k;
  }
  int32_t left = 0;
  for (int32_t k = 0; k < num; ++k) {
    if (stays[k] != 0) matches[left++] = matches[k];
  }
  return left;
}

}  // namespace tv
