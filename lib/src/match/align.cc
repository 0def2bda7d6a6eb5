// Least-squares matching of the windows around two matched keypoints. Formulas and measurements:
// docs/decisions/0026-precision.md; test: test/unit/test_align.cc.
#include "match/align.h"

#include <cmath>

#include "base/math.h"
#include "match/rank.h"

namespace tv {
namespace {

constexpr int kParameters = 6;  // the shift, then the rows of the linear part
constexpr int kSteps = 4;

// The distance between samples in pixels, of a keypoint of the full image and at the most. The
// images are not smoothed before, so that samples farther apart would alias.
constexpr double kStep = 1.0, kMostStep = 1.42;

// In samples of the window: the longest step that is made, and the length from which on the first
// and the second step are hopeless; the step after which no other is made; the last step of an
// alignment that counts as found, and how far a keypoint may move.
constexpr double kLongestStep = 1.0, kHopeless[2] = {2.0, 1.0};
constexpr double kShortStep = 0.05, kLastStep = 0.2, kMostShift = 1.2;
constexpr double kLeastGain = 0.1;         // least slope of one window's greys over the other's
constexpr double kLeastContrast = 1.0;     // variance of a window, squared grey levels
constexpr double kLeastPivot = 1e-4;       // of a normal equation, over its diagonal
constexpr double kLostSimilarity = 0.002;  // by how much the squared correlation may fall

constexpr double kMargin = 1.01;   // of a window to the border, in pixels: kernels.h, and rounding
constexpr double kMostReach = 64;  // of a window from its middle, in pixels
constexpr int32_t kLeastWidth = 16;                // of an image, in pixels: kernels.h
constexpr int64_t kMostStride = int64_t{1} << 23;  // so that the rows of a window fit 32 bits

// The factor of an aligned match's sigmas is the root of kLeastFactor^2 + (kOfDeviation s)^2, where
// s is the standard deviation of the shift that the pixels allow, over the size. kLeastFactor is
// for what both windows share: a surface that is no plane, a rolling shutter.
constexpr double kLeastFactor = 0.15, kOfDeviation = 3.0;

// The units of the kernels: one grey level of a sample, the constant, and a parameter over the
// factor of its channel.
constexpr double kGreyLevel = 127.0 * 127.0 / 1024.0, kOne = 4096;
constexpr double kOfShift = 2.0, kOfLinear = 0.5;

// A linear map from samples of a window to pixels, row-major.
struct Linear {
  double m[4];
};

int32_t to_q16(double x) { return static_cast<int32_t>(x * 65536.0); }

double magnitude(double x) { return x < 0 ? -x : x; }

// Whether the window of side x side samples around (x, y) is within the image.
bool is_inside(const tv_image& image, double x, double y, const Linear& map, int side) {
  const double* m = map.m;
  const double half = 0.5 * (side - 1);
  const double reach_x = half * (magnitude(m[0]) + magnitude(m[1])) + kMargin;
  const double reach_y = half * (magnitude(m[2]) + magnitude(m[3])) + kMargin;
  return x >= reach_x && x + reach_x <= image.width - 1 && y >= reach_y &&
         y + reach_y <= image.height - 1 && reach_x < kMostReach && reach_y < kMostReach;
}

// The patch around the keypoint in image 0, which stays where it is, and the normal equations of
// the squared differences between it and the patch in image 1.
struct Template {
  int16_t channels[TVK_WINDOW_CHANNELS * TVK_WINDOW_SAMPLES];  // kernels.h
  // Weighted sums of products of the constant (1) and the window (w).
  double ones, w_one, one_w, w_w, determinant;
  double on_w[kParameters], on_one[kParameters];  // the parts of the slopes along these two
  // L D L' of the normal equations: L below the diagonal, 1 / D on it.
  double factor[kParameters][kParameters];
};

// Gain and offset are eliminated, then the six normal equations are factorised. False where the
// window has too little texture.
bool make_template(const tvk_align_table& kernels, const tv_image& image, double x, double y,
                   double step, Template* t) {
  constexpr int kOuter = TVK_WINDOW_SIDE + 2;
  if (image.width < kLeastWidth || !is_inside(image, x, y, Linear{{step, 0, 0, step}}, kOuter)) {
    return false;
  }
  const double half = 0.5 * (kOuter - 1) * step;
  int32_t products[TVK_WINDOW_PRODUCTS];
  kernels.window_template(image.data, image.stride_bytes, image.width, to_q16(x - half),
                          to_q16(y - half), to_q16(step), t->channels, products);
  t->ones = products[0];
  t->w_one = products[1];
  t->w_w = products[2];
  t->one_w = products[36];
  t->determinant = t->w_w * t->ones - t->w_one * t->one_w;
  constexpr double kLeast = kLeastContrast * kGreyLevel * kGreyLevel / (kOne * kOne);
  if (!(t->determinant > kLeast * t->ones * t->ones)) return false;
  const double scale = 1 / t->determinant;
  const int32_t* row = products + 3;  // of a channel: times 1, w, and the slopes
  for (int r = 0; r < kParameters; row += 3 + r, ++r) {
    t->on_w[r] = (row[1] * t->ones - row[0] * t->one_w) * scale;
    t->on_one[r] = (row[0] * t->w_w - row[1] * t->w_one) * scale;
    double with_d[kParameters];  // row r of L D
    const int32_t* other = products + 3;
    for (int c = 0; c <= r; other += 3 + c, ++c) {
      const double all = row[2 + c] - t->on_w[r] * other[1] - t->on_one[r] * other[0];
      double rest = all;
      if (c < r) {
        for (int k = 0; k < c; ++k) rest -= with_d[k] * t->factor[c][k];
        with_d[c] = rest;
        t->factor[r][c] = rest * t->factor[c][c];
      } else {
        for (int k = 0; k < r; ++k) rest -= with_d[k] * t->factor[r][k];
        if (!(rest > kLeastPivot * all)) return false;
        t->factor[r][r] = 1 / rest;
      }
    }
  }
  return true;
}

// Both loops are unrolled: as loops of so few turns they take twice as long.
void solve(const double factor[kParameters][kParameters], double x[kParameters]) {
#pragma GCC unroll 6
  for (int c = 0; c < kParameters - 1; ++c) {
#pragma GCC unroll 6
    for (int r = c + 1; r < kParameters; ++r) x[r] -= factor[r][c] * x[c];
  }
#pragma GCC unroll 6
  for (int r = 0; r < kParameters; ++r) x[r] *= factor[r][r];
#pragma GCC unroll 6
  for (int c = kParameters - 1; c > 0; --c) {
#pragma GCC unroll 6
    for (int r = 0; r < c; ++r) x[r] -= factor[c][r] * x[c];
  }
}

// The trace of the first two rows and columns of the inverse of the normal equations: of the
// shift's covariance, over the variance of a sample.
double trace_of_shift(const double factor[kParameters][kParameters]) {
  double trace = 0;
  for (int p = 0; p < 2; ++p) {
    double column[kParameters];  // of the inverse of L
    for (int r = p; r < kParameters; ++r) {
      double x = r == p;
      for (int c = p; c < r; ++c) x -= factor[r][c] * column[c];
      column[r] = x;
      trace += x * x * factor[r][r];
    }
  }
  return trace;
}

// map becomes map (identity + change)^-1. False where that is not near enough to the identity.
bool compose_inverse(const double change[4], Linear* map) {
  const double a = 1 + change[0], b = change[1], c = change[2], d = 1 + change[3];
  const double determinant = a * d - b * c;
  if (!(determinant > 0.1)) return false;
  const double scale = 1 / determinant;
  double* m = map->m;
  for (int row = 0; row < 4; row += 2) {
    const double left = m[row] * scale, right = m[row + 1] * scale;
    m[row] = left * d - right * c;
    m[row + 1] = right * a - left * b;
  }
  return true;
}

// A turn, of samples `step` pixels apart.
Linear turned(double angle_rad, double step) {
  double sine, cosine;
  sincos(angle_rad, &sine, &cosine);
  return Linear{{step * cosine, -step * sine, step * sine, step * cosine}};
}

// The map from the shape of one patch to the shape of the other, times `step`.
Linear between(const double from[4], const double to[4], double step) {
  const double scale = step / (from[0] * from[3] - from[1] * from[2]);
  return Linear{
      {(to[0] * from[3] - to[1] * from[2]) * scale, (to[1] * from[0] - to[0] * from[1]) * scale,
       (to[2] * from[3] - to[3] * from[2]) * scale, (to[3] * from[0] - to[2] * from[1]) * scale}};
}

bool is_before(const tv_keypoint& a, const tv_keypoint& b) {
  if (a.size != b.size) return a.size > b.size;
  return a.y != b.y ? a.y < b.y : a.x < b.x;
}

// What align_keypoints returns. alike: the squared correlation of the windows. Their difference,
// with gain and offset, has 1 / alike - 1 of the template's variance, and is taken for noise.
// sample: the distance between samples over the size of a keypoint.
uint8_t factor_of(const Template& t, double alike, double sample) {
  constexpr double kLeast = kLeastFactor * kAlignedOne, kMost = 255;
  const double scale = kOfDeviation * kAlignedOne * kOne * kOfShift * sample;
  const double noise = alike < 1 ? t.determinant / (t.ones * t.ones) * (1 / alike - 1) : 0;
  const double variance = 0.5 * noise * trace_of_shift(t.factor);  // of one coordinate
  const double factor = std::sqrt(kLeast * kLeast + scale * scale * variance);
  return static_cast<uint8_t>((factor < kMost ? factor : kMost) + 0.5);
}

bool is_at_same_place(const tv_keypoint& a, const tv_keypoint& b) {
  return a.x == b.x && a.y == b.y && a.size == b.size;
}

}  // namespace

uint8_t align_keypoints(const tvk_set& set, const tv_image& image0, const tv_image& image1,
                        double size_of_one, tv_keypoint* keypoint0, tv_keypoint* keypoint1,
                        const double (*shapes)[4]) {
  const bool in_order = is_before(*keypoint0, *keypoint1);
  if (!in_order && !is_before(*keypoint1, *keypoint0)) return 0;
  if (image0.stride_bytes > kMostStride || image1.stride_bytes > kMostStride) return 0;
  const tvk_align_table& kernels = *tvk_align_of(&set);
  const tv_keypoint& fixed = in_order ? *keypoint0 : *keypoint1;
  tv_keypoint& moving = in_order ? *keypoint1 : *keypoint0;
  const tv_image& image = in_order ? image1 : image0;
  const double wanted = kStep * static_cast<double>(fixed.size) / size_of_one;
  const double step = wanted < kMostStep ? wanted : kMostStep;
  Template t;
  if (!make_template(kernels, in_order ? image0 : image1, static_cast<double>(fixed.x),
                     static_cast<double>(fixed.y), step, &t)) {
    return 0;
  }
  const double moving_step =
      step * static_cast<double>(moving.size) / static_cast<double>(fixed.size);
  const double inverse_step = 1 / moving_step;
  Linear map =
      shapes != nullptr
          ? between(shapes[in_order ? 0 : 1], shapes[in_order ? 1 : 0], step)
          : turned(static_cast<double>(moving.angle_rad) - static_cast<double>(fixed.angle_rad),
                   moving_step);
  const double start_x = static_cast<double>(moving.x), start_y = static_cast<double>(moving.y);
  double x = start_x, y = start_y, length = 0, first_alike = 0, alike = 0;
  for (int n = 0; n < kSteps; ++n) {
    if (!is_inside(image, x, y, map, TVK_WINDOW_SIDE)) return 0;
    constexpr double kHalf = 0.5 * (TVK_WINDOW_SIDE - 1);
    const double* m = map.m;
    const int32_t q16[4] = {to_q16(m[0]), to_q16(m[1]), to_q16(m[2]), to_q16(m[3])};
    int32_t sums[TVK_WINDOW_SUMS];
    kernels.window_sums(image.data, image.stride_bytes, to_q16(x - kHalf * (m[0] + m[1])),
                        to_q16(y - kHalf * (m[2] + m[3])), q16, t.channels, sums);
    const double on_one = sums[0], on_w = sums[1];
    const double shared = on_w * t.ones - on_one * t.w_one;
    const double variance = sums[8] * t.ones - on_one * on_one;
    if (!(shared > kLeastGain * t.determinant)) return 0;
    const double inverse_gain = t.determinant / shared;
    // The squared correlation of the two windows.
    alike = variance > 0 ? shared * shared / (t.determinant * variance) : 0;
    if (n == 0) first_alike = alike;
    double change[kParameters];
    for (int p = 0; p < kParameters; ++p) {
      change[p] = sums[2 + p] - t.on_w[p] * on_w - t.on_one[p] * on_one;
    }
    solve(t.factor, change);
    for (int p = 0; p < kParameters; ++p) {
      change[p] *= inverse_gain * (p < 2 ? kOfShift : kOfLinear);
    }
    if (!compose_inverse(change + 2, &map)) return 0;
    double step_x = map.m[0] * change[0] + map.m[1] * change[1];
    double step_y = map.m[2] * change[0] + map.m[3] * change[1];
    length = std::sqrt(step_x * step_x + step_y * step_y) * inverse_step;
    if (n < 2 && length > kHopeless[n]) return 0;
    if (length > kLongestStep) {
      step_x *= kLongestStep / length;
      step_y *= kLongestStep / length;
    }
    x -= step_x;
    y -= step_y;
    if (length < kShortStep) break;
  }
  const double shift_sq = (x - start_x) * (x - start_x) + (y - start_y) * (y - start_y);
  const double most = kMostShift * moving_step;
  if (!(length < kLastStep && shift_sq < most * most && alike > first_alike - kLostSimilarity)) {
    return 0;
  }
  moving.x = static_cast<float>(x);
  moving.y = static_cast<float>(y);
  return factor_of(t, alike, step * size_of_one / static_cast<double>(fixed.size));
}

void align_matches(const tvk_set& set, const tv_image images[2], double size_of_one,
                   tv_keypoint* const keypoints[2], const tv_correspondence* matches,
                   int32_t num_matches, uint8_t* aligned) {
  for (int32_t k = 0; k < num_matches; ++k) {
    const tv_correspondence* m = &matches[k];
    const tv_correspondence* other = nullptr;
    if (k + 1 < num_matches && rank_of(m[0]) != rank_of(m[1]) &&
        is_at_same_place(keypoints[0][m[0].idx0], keypoints[0][m[1].idx0]) &&
        is_at_same_place(keypoints[1][m[0].idx1], keypoints[1][m[1].idx1])) {
      const bool first = rank_of(m[0]) < rank_of(m[1]);
      other = m + first;
      m += !first;
      ++k;
    }
    tv_keypoint& a = keypoints[0][m->idx0];
    tv_keypoint& b = keypoints[1][m->idx1];
    aligned[k] = align_keypoints(set, images[0], images[1], size_of_one, &a, &b);
    if (other == nullptr) continue;
    aligned[k - 1] = aligned[k];
    for (int v = 0; v < 2; ++v) {
      const tv_keypoint& moved = v == 0 ? a : b;
      tv_keypoint& follower = keypoints[v][v == 0 ? other->idx0 : other->idx1];
      follower.x = moved.x;
      follower.y = moved.y;
    }
  }
}

}  // namespace tv
