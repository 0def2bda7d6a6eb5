// FAST's corners and scores, on real and synthetic images, compared with a literal implementation
// of the definition: a pixel is a corner at threshold t when `arc` contiguous pixels of its circle
// are all brighter than it by more than t, or all darker; its score is the largest such t, found by
// trying each.

#include <stdlib.h>
#include <string.h>
#include <unity.h>

#include <algorithm>
#include <tuple>
#include <vector>

#include "base/arena.h"
#include "feature/corners.h"
#include "support/random.h"
#include "support/real_pair.h"

namespace {

// Clockwise from above the centre, (x, y) with y down: Rosten's figure 1.
constexpr int kCircle[16][2] = {{0, -3}, {1, -3},  {2, -2},  {3, -1}, {3, 0},  {3, 1},
                                {2, 2},  {1, 3},   {0, 3},   {-1, 3}, {-2, 2}, {-3, 1},
                                {-3, 0}, {-3, -1}, {-2, -2}, {-1, -3}};

constexpr int kMaxWidth = 800, kMaxHeight = 600;
uint8_t expected_scores[kMaxHeight][kMaxWidth];
uint8_t pixels[kMaxHeight * kMaxWidth];
alignas(64) uint8_t arena_memory[24 << 20];
tv_keypoint keypoints[kMaxWidth * kMaxHeight / 4];
real_pair real;

bool is_corner(const tv_image& image, int x, int y, int arc, int t) {
  int brighter_run = 0, darker_run = 0;
  const int centre = image.data[y * image.stride_bytes + x];
  for (int k = 0; k < 16 + arc - 1; ++k) {
    const int* at = kCircle[k % 16];
    const int p = image.data[(y + at[1]) * image.stride_bytes + x + at[0]];
    brighter_run = p > centre + t ? brighter_run + 1 : 0;
    darker_run = p < centre - t ? darker_run + 1 : 0;
    if (brighter_run >= arc || darker_run >= arc) return true;
  }
  return false;
}

void fill_expected(const tv_image& image, int arc) {
  for (int y = 0; y < image.height; ++y) {
    for (int x = 0; x < image.width; ++x) {
      int score = 0;
      if (x >= 3 && y >= 3 && x < image.width - 3 && y < image.height - 3) {
        while (score < 255 && is_corner(image, x, y, arc, score + 1)) ++score;
      }
      expected_scores[y][x] = static_cast<uint8_t>(score);
    }
  }
}

void check_score_map(const tvk_set& kernels, const tv_image& image, int arc, int threshold) {
  for (int y = 3; y < image.height - 3; ++y) {
    const uint8_t* rows[7];
    uint8_t scores[kMaxWidth];
    for (int k = 0; k < 7; ++k) rows[k] = image.data + (y - 3 + k) * image.stride_bytes;
    tvk_detect_of(&kernels)->fast_score_row(rows, image.width, arc, threshold, scores);
    for (int x = 0; x < image.width; ++x) {
      const int score = expected_scores[y][x] >= threshold ? expected_scores[y][x] : 0;
      if (score == scores[x]) continue;
      char message[128];
      snprintf(message, sizeof message, "arc %d threshold %d at (%d, %d)", arc, threshold, x, y);
      TEST_ASSERT_EQUAL_INT_MESSAGE(score, scores[x], message);
    }
  }
}

bool is_peak(int x, int y, int threshold) {
  const int score = expected_scores[y][x];
  if (score < threshold) return false;
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if ((dx != 0 || dy != 0) && expected_scores[y + dy][x + dx] >= score) return false;
    }
  }
  return true;
}

struct Peak {
  int score, y, x;
};

bool operator<(const Peak& a, const Peak& b) {
  return std::make_tuple(-a.score, a.y, a.x) < std::make_tuple(-b.score, b.y, b.x);
}

std::vector<Peak> all_peaks(const tv_image& image, int threshold) {
  std::vector<Peak> peaks;
  for (int y = 3; y < image.height - 3; ++y) {
    for (int x = 3; x < image.width - 3; ++x) {
      if (is_peak(x, y, threshold)) peaks.push_back(Peak{expected_scores[y][x], y, x});
    }
  }
  std::sort(peaks.begin(), peaks.end());
  return peaks;
}

void check_corners(const tvk_set& kernels, const tv_image& image, int arc, int threshold) {
  tv_feature_options options;
  memset(&options, 0, sizeof options);
  options.arc = arc;
  options.threshold = threshold;
  options.levels = 1;
  options.scale_factor = 2.0f;
  options.keypoint_size = 4.0f;
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const int32_t budget = image.width * image.height / 4;
  TEST_ASSERT_LESS_OR_EQUAL(sizeof arena_memory, tv::corners_bytes(image.width, image.height));
  const int32_t count =
      tv::find_corners(kernels, image, nullptr, options, budget, arena, keypoints);
  int32_t expected = 0;
  for (int y = 3; y < image.height - 3; ++y) {
    for (int x = 3; x < image.width - 3; ++x) expected += is_peak(x, y, threshold);
  }
  TEST_ASSERT_EQUAL_INT32(expected, count);
  for (int32_t k = 0; k < count; ++k) {
    const tv_keypoint& p = keypoints[k];
    const int x = static_cast<int>(p.x), y = static_cast<int>(p.y);
    TEST_ASSERT_TRUE(p.x == x && p.y == y && is_peak(x, y, threshold));
    TEST_ASSERT_EQUAL_INT(expected_scores[y][x], static_cast<int>(p.score));
    if (k == 0) continue;  // the order is strict, so no corner is repeated
    const tv_keypoint& q = keypoints[k - 1];
    TEST_ASSERT_TRUE(q.score > p.score ||
                     (q.score == p.score && (q.y < p.y || (q.y == p.y && q.x < p.x))));
  }
}

// The expected corners. Without cells: the `budget` best of the peaks that reach the lowest
// threshold, in their order. With cells: of the peaks that reach the highest threshold at which
// there are `budget` of them, first the best of each cell up to an even share, then the best of the
// rest.
void check_budget(const tvk_set& kernels, const tv_image& image, int budget, int cell_px) {
  tv_feature_options options;
  memset(&options, 0, sizeof options);
  options.arc = 9;
  options.threshold = 40;
  options.min_threshold = 2;
  options.levels = 1;
  options.scale_factor = 2.0f;
  options.keypoint_size = 4.0f;
  options.cell_px = cell_px;
  std::vector<Peak> peaks = all_peaks(image, options.min_threshold), chosen, rest;
  int cutoff = options.threshold;
  const auto is_kept = [&cutoff](const Peak& p) { return p.score >= cutoff; };
  while (cutoff > options.min_threshold &&
         std::count_if(peaks.begin(), peaks.end(), is_kept) < budget) {
    --cutoff;
  }
  peaks.erase(std::partition_point(peaks.begin(), peaks.end(), is_kept), peaks.end());
  const int columns = cell_px > 0 ? image.width / cell_px + 1 : 1;
  const int rows = cell_px > 0 ? image.height / cell_px + 1 : 1;
  const int share = (budget + columns * rows - 1) / (columns * rows);
  std::vector<int> in_cell(static_cast<size_t>(columns * rows));
  for (const Peak& p : peaks) {
    int& count =
        in_cell[static_cast<size_t>(cell_px > 0 ? p.y / cell_px * columns + p.x / cell_px : 0)];
    (count < share ? (++count, chosen) : rest).push_back(p);
  }
  chosen.insert(chosen.end(), rest.begin(), rest.end());
  if (chosen.size() > static_cast<size_t>(budget)) chosen.resize(static_cast<size_t>(budget));
  std::sort(chosen.begin(), chosen.end());
  tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
  const int32_t count =
      tv::find_corners(kernels, image, nullptr, options, budget, arena, keypoints);
  TEST_ASSERT_EQUAL_INT(chosen.size(), count);
  for (int32_t k = 0; k < count; ++k) {
    const Peak& p = chosen[static_cast<size_t>(k)];
    TEST_ASSERT_EQUAL_INT(p.score, static_cast<int>(keypoints[k].score));
    TEST_ASSERT_EQUAL_INT(p.y, static_cast<int>(keypoints[k].y));
    TEST_ASSERT_EQUAL_INT(p.x, static_cast<int>(keypoints[k].x));
  }
}

void check_budgets(const tv_image& image) {
  fill_expected(image, 9);
  for (int set = TV_KERNELS_C; set <= TV_KERNELS_NEON; ++set) {
    if (tvk_select(set) == nullptr) continue;
    for (int budget : {1, 7, 60, 200, 1000, 5000}) {
      for (int cell_px : {0, 8, 33}) check_budget(*tvk_select(set), image, budget, cell_px);
    }
  }
}

void check_image(const tv_image& image) {
  constexpr int thresholds[] = {1, 5, 10, 20, 60, 253, 254};
  for (int arc = 9; arc <= 12; ++arc) {
    fill_expected(image, arc);
    for (int set = TV_KERNELS_C; set <= TV_KERNELS_NEON; ++set) {
      const tvk_set* kernels = tvk_select(set);
      if (kernels == nullptr) continue;
      for (int threshold : thresholds) {
        check_score_map(*kernels, image, arc, threshold);
        check_corners(*kernels, image, arc, threshold);
      }
    }
  }
}

tv_image filled(int width, int height, int (*value)(int x, int y)) {
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      pixels[y * width + x] = static_cast<uint8_t>(value(x, y));
    }
  }
  return tv_image{pixels, width, height, width};
}

uint64_t noise_state;
int noise(int, int) { return random_int(&noise_state, 0, 255); }
int black_and_white(int, int) { return random_int(&noise_state, 0, 7) == 0 ? 255 : 0; }
int faint(int, int) { return 100 + random_int(&noise_state, 0, 2); }
int checkerboard(int x, int y) { return ((x / 9 + y / 9) & 1) * 255; }
int single_dots(int x, int y) { return x % 11 == 5 && y % 10 == 4 ? 255 : 0; }
int holes(int x, int y) { return 255 - single_dots(x, y); }
int white(int, int) { return 255; }
// Neighbouring pixels differ by up to 255, so that both extremes of the score, 0 and 254, occur.
int soft_squares(int x, int y) { return (x % 16 < 8 && y % 16 < 8 ? x * 37 + y * 11 : 0) & 255; }

void test_corners_equal_the_definition_on_a_real_image() {
#ifdef TWOVIEW_SANITIZED
  // Sanitizers are slow, and every row makes the same memory accesses: a fifth of the rows is
  // enough.
  const int32_t height = real.height / 5;
#else
  const int32_t height = real.height;
#endif
  check_image(tv_image{real.luma[0], real.width, height, real.width});
}

// The scan stops looking at weak corners as soon as there are enough strong ones; the result must
// not change.
void test_the_best_corners_are_kept_within_a_budget() {
  noise_state = 3;
  int (*const values[])(int, int) = {noise, black_and_white, faint, checkerboard, soft_squares};
  for (auto value : values) check_budgets(filled(150, 61, value));
  if (real.luma[0] != nullptr) {
    check_budgets(tv_image{real.luma[0], real.width, real.height / 3, real.width});
  }
}

// A level's scan begins at the score that sufficed for the finer one. The corners of noise are much
// weaker on the halved image, so that this leaves too few of them; those of the dots are not.
void test_a_coarser_level_has_its_best_corners() {
  static uint8_t halved[75 * 30];
  constexpr int kBudget = 60;
  tv_feature_options options;
  memset(&options, 0, sizeof options);
  options.arc = 9;
  options.threshold = 60;
  options.min_threshold = 2;
  options.levels = 2;
  options.scale_factor = 2.0f;
  options.keypoint_size = 4.0f;
  noise_state = 5;
  int (*const values[])(int, int) = {noise, black_and_white, single_dots};
  for (auto value : values) {
    const tv_image image = filled(150, 60, value), half = {halved, 75, 30, 75};
    for (int y = 0; y < half.height; ++y) {
      for (int x = 0; x < half.width; ++x) {
        const uint8_t* at = pixels + 2 * y * image.width + 2 * x;
        halved[y * half.width + x] =
            static_cast<uint8_t>((at[0] + at[1] + at[image.width] + at[image.width + 1] + 2) / 4);
      }
    }
    fill_expected(half, options.arc);
    const std::vector<Peak> peaks = all_peaks(half, options.min_threshold);
    tv::Arena arena = tv::arena_over(arena_memory, sizeof arena_memory);
    const int32_t count = tv::find_corners(*tvk_select(TV_KERNELS_AUTO), image, nullptr, options,
                                           kBudget, arena, keypoints);
    size_t of_level = 0;
    for (int32_t k = 0; k < count; ++k) {
      if (keypoints[k].level != 1) continue;
      TEST_ASSERT_TRUE(of_level < peaks.size());
      const Peak& p = peaks[of_level++];
      TEST_ASSERT_EQUAL_INT(p.score, static_cast<int>(keypoints[k].score));
      TEST_ASSERT_TRUE(keypoints[k].y == 2 * p.y + 0.5f && keypoints[k].x == 2 * p.x + 0.5f);
    }
    TEST_ASSERT_TRUE(of_level > 0);
    TEST_ASSERT_TRUE(count == kBudget || of_level == peaks.size());
  }
}

void test_corners_equal_the_definition_on_synthetic_images() {
  noise_state = 1;
  int (*const values[])(int, int) = {noise,       black_and_white, faint, checkerboard,
                                     single_dots, holes,           white, soft_squares};
  for (auto value : values) check_image(filled(150, 61, value));
}

// Widths near multiples of the kernels' blocks of 16, 32 and 64, and images with one candidate
// pixel or none.
void test_corners_equal_the_definition_in_images_of_any_size() {
  noise_state = 2;
  for (int width = 1; width <= 12; ++width) {
    for (int height = 5; height <= 9; ++height) check_image(filled(width, height, black_and_white));
  }
  for (int width : {17, 18, 21, 22, 23, 34, 38, 39, 54, 55, 69, 70, 71, 102, 103}) {
    check_image(filled(width, 9, noise));
  }
  for (int width = 66; width <= 72; ++width) check_image(filled(width, 12, black_and_white));
  for (int width = 130; width <= 138; ++width) check_image(filled(width, 9, noise));
}

// The score's extremes: 254 is the largest t that 255 grey levels allow.
void test_a_white_dot_on_black_scores_254() {
  const tv_image image = filled(33, 30, single_dots);
  fill_expected(image, 12);
  TEST_ASSERT_EQUAL_INT(254, expected_scores[4][5]);
  check_corners(*tvk_select(TV_KERNELS_C), image, 12, 254);
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_corners_equal_the_definition_on_synthetic_images);
  RUN_TEST(test_corners_equal_the_definition_in_images_of_any_size);
  RUN_TEST(test_a_white_dot_on_black_scores_254);
  RUN_TEST(test_a_coarser_level_has_its_best_corners);
  const bool has_real_image = real_pair_load(&real) != 0;
  RUN_TEST(test_the_best_corners_are_kept_within_a_budget);
  if (has_real_image) RUN_TEST(test_corners_equal_the_definition_on_a_real_image);
  const int failures = UNITY_END();
  return failures == 0 && !has_real_image ? TWOVIEW_SKIP_CODE : failures;
}
