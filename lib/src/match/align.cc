// Least-squares matching of the windows around two matched keypoints. Formulas and measurements:
// docs/decisions/0026-precision.md; test: test/unit/test_align.cc.
#include "match/align.h"

#include <cmath>

#include "base/math.h"

namespace tv {
namespace {

constexpr int kSide = 8, kSamples = kSide * kSide;  // of a window
constexpr int kParameters = 6;                      // the shift, then the rows of the linear part
constexpr int kSteps = 4;

// The distance between samples in pixels, of a keypoint of the full image and at the most. The
// images are not smoothed before, so that samples farther apart would alias.
constexpr double kStep = 1.0, kMostStep = 1.42;

// In samples of the window: the longest step, the last step of an alignment that counts as found,
// the step after which no other is made, and how far a keypoint may move.
constexpr double kLongestStep = 1.0, kLastStep = 0.2, kShortStep = 0.02, kMostShift = 1.2;
constexpr double kLeastGain = 0.1;         // of one window over the other
constexpr double kLeastContrast = 1.0;     // variance of a window, squared grey levels
constexpr double kLeastPivot = 1e-4;       // of a normal equation, over its diagonal
constexpr double kLostSimilarity = 0.001;  // how much less alike the windows may be afterwards

// exp(-r^2 / (2 2.6^2)) at 3.5, 2.5, 1.5 and 0.5 samples from the middle, and mirrored.
constexpr float kWeights[kSide] = {0.40411f, 0.62985f, 0.84669f, 0.98168f,
                                   0.98168f, 0.84669f, 0.62985f, 0.40411f};

// A linear map from samples of a window to pixels, row-major.
struct Linear {
  double m[4];
};

int32_t to_q16(double x) { return static_cast<int32_t>(std::floor(x * 65536.0 + 0.5)); }

double magnitude(double x) { return x < 0 ? -x : x; }

// Writes side x side bilinear samples around (x, y), in grey levels. False where one would lie
// outside the image.
bool sample_window(const tv_image& image, double x, double y, const Linear& map, int side,
                   float* samples) {
  constexpr double kMargin = 0.01;  // more than the rounding of the positions
  const double* m = map.m;
  const double half = 0.5 * (side - 1);
  const double reach_x = half * (magnitude(m[0]) + magnitude(m[1])) + kMargin;
  const double reach_y = half * (magnitude(m[2]) + magnitude(m[3])) + kMargin;
  if (!(x >= reach_x && x + reach_x <= image.width - 1 && y >= reach_y &&
        y + reach_y <= image.height - 1)) {
    return false;
  }
  const int32_t across_x = to_q16(m[0]), down_x = to_q16(m[1]);
  const int32_t across_y = to_q16(m[2]), down_y = to_q16(m[3]);
  int32_t row_x = to_q16(x - half * (m[0] + m[1])), row_y = to_q16(y - half * (m[2] + m[3]));
  for (int j = 0; j < side; ++j, row_x += down_x, row_y += down_y) {
    int32_t at_x = row_x, at_y = row_y;
    for (int i = 0; i < side; ++i, at_x += across_x, at_y += across_y) {
      const uint8_t* p = image.data + (at_y >> 16) * image.stride_bytes + (at_x >> 16);
      const uint8_t* q = p + image.stride_bytes;
      const int32_t right = at_x >> 8 & 255, below = at_y >> 8 & 255;
      const int32_t upper = 256 * p[0] + right * (p[1] - p[0]);
      const int32_t lower = 256 * q[0] + right * (q[1] - q[0]);
      samples[side * j + i] =
          static_cast<float>(256 * upper + below * (lower - upper)) * (1.0f / 65536.0f);
    }
  }
  return true;
}

// The order of the sum: first each column, then the columns in pairs.
__attribute__((noinline)) double dot(const float* a, const float* b) {
  float columns[kSide] = {0};
  for (int j = 0; j < kSamples; j += kSide) {
    for (int i = 0; i < kSide; ++i) columns[i] += a[j + i] * b[j + i];
  }
  const float* c = columns;
  return static_cast<double>(((c[0] + c[4]) + (c[2] + c[6])) + ((c[1] + c[5]) + (c[3] + c[7])));
}

// The window that stays, and the normal equations of the differences from it.
struct Template {
  float weights[kSamples];
  double sum_of_weights;
  float weighted[kSamples];                 // less its mean, times the weights
  double variance;                          // the weighted sum of squares
  float slopes[kParameters][kSamples];      // d sample / d parameter, weighted, as below
  double factor[kParameters][kParameters];  // Cholesky's lower factor
};

bool factorise(double matrix[kParameters][kParameters]) {
  for (int r = 0; r < kParameters; ++r) {
    for (int c = 0; c <= r; ++c) {
      double rest = matrix[r][c];
      for (int k = 0; k < c; ++k) rest -= matrix[r][k] * matrix[c][k];
      if (c < r) {
        matrix[r][c] = rest / matrix[c][c];
      } else if (rest > kLeastPivot * matrix[r][r]) {
        matrix[r][r] = std::sqrt(rest);
      } else {
        return false;
      }
    }
  }
  return true;
}

void solve(const double factor[kParameters][kParameters], double x[kParameters]) {
  for (int r = 0; r < kParameters; ++r) {
    for (int c = 0; c < r; ++c) x[r] -= factor[r][c] * x[c];
    x[r] /= factor[r][r];
  }
  for (int r = kParameters - 1; r >= 0; --r) {
    for (int c = r + 1; c < kParameters; ++c) x[r] -= factor[c][r] * x[c];
    x[r] /= factor[r][r];
  }
}

// Gain and offset are eliminated: the slopes are made orthogonal, under the weights, to a constant
// and to the template itself. False where the template has too little texture.
bool make_template(const tv_image& image, double x, double y, double step, Template* t) {
  constexpr int kOuter = kSide + 2;
  float outer[kOuter * kOuter], inner[kSamples], plain[kParameters][kSamples];
  if (!sample_window(image, x, y, Linear{{step, 0, 0, step}}, kOuter, outer)) return false;
  for (int j = 0; j < kSide; ++j) {
    for (int i = 0; i < kSide; ++i) {
      const float* p = outer + kOuter * (j + 1) + i + 1;
      const float slope_x = 0.5f * (p[1] - p[-1]), slope_y = 0.5f * (p[kOuter] - p[-kOuter]);
      const float u = static_cast<float>(i) - 0.5f * (kSide - 1);
      const float v = static_cast<float>(j) - 0.5f * (kSide - 1);
      const int k = kSide * j + i;
      t->weights[k] = kWeights[i] * kWeights[j];
      inner[k] = p[0];
      plain[0][k] = slope_x;
      plain[1][k] = slope_y;
      plain[2][k] = slope_x * u;
      plain[3][k] = slope_x * v;
      plain[4][k] = slope_y * u;
      plain[5][k] = slope_y * v;
    }
  }
  double side_sum = 0;
  for (const float weight : kWeights) side_sum += static_cast<double>(weight);
  t->sum_of_weights = side_sum * side_sum;
  const float mean = static_cast<float>(dot(t->weights, inner) / t->sum_of_weights);
  for (int k = 0; k < kSamples; ++k) {
    inner[k] -= mean;
    t->weighted[k] = t->weights[k] * inner[k];
  }
  t->variance = dot(t->weighted, inner);
  if (!(t->variance > kLeastContrast * t->sum_of_weights)) return false;
  for (int p = 0; p < kParameters; ++p) {
    const float offset = static_cast<float>(dot(t->weights, plain[p]) / t->sum_of_weights);
    const float gain = static_cast<float>(dot(t->weighted, plain[p]) / t->variance);
    for (int k = 0; k < kSamples; ++k) {
      plain[p][k] -= offset + gain * inner[k];
      t->slopes[p][k] = t->weights[k] * plain[p][k];
    }
    for (int q = 0; q <= p; ++q) t->factor[p][q] = dot(t->slopes[p], plain[q]);
  }
  return factorise(t->factor);
}

// How alike the samples and the template are, in [-1, 1], up to gain and offset.
double similarity(const Template& t, const float* samples) {
  float weighted[kSamples];
  for (int k = 0; k < kSamples; ++k) weighted[k] = t.weights[k] * samples[k];
  const double total = dot(t.weights, samples);
  const double variance = dot(weighted, samples) - total * total / t.sum_of_weights;
  return variance > 0 ? dot(t.weighted, samples) / std::sqrt(t.variance * variance) : 0;
}

// map becomes map (identity + change)^-1. False where that is not near enough to the identity.
bool compose_inverse(const double change[4], Linear* map) {
  const double a = 1 + change[0], b = change[1], c = change[2], d = 1 + change[3];
  const double determinant = a * d - b * c;
  if (!(determinant > 0.1)) return false;
  double* m = map->m;
  for (int row = 0; row < 4; row += 2) {
    const double left = m[row], right = m[row + 1];
    m[row] = (left * d - right * c) / determinant;
    m[row + 1] = (right * a - left * b) / determinant;
  }
  return true;
}

bool is_before(const tv_keypoint& a, const tv_keypoint& b) {
  if (a.size != b.size) return a.size > b.size;
  return a.y != b.y ? a.y < b.y : a.x < b.x;
}

}  // namespace

bool align_keypoints(const tv_image& image0, const tv_image& image1, double size_of_one,
                     tv_keypoint* keypoint0, tv_keypoint* keypoint1) {
  const bool in_order = is_before(*keypoint0, *keypoint1);
  if (!in_order && !is_before(*keypoint1, *keypoint0)) return false;
  const tv_keypoint& fixed = in_order ? *keypoint0 : *keypoint1;
  tv_keypoint& moving = in_order ? *keypoint1 : *keypoint0;
  const tv_image& image = in_order ? image1 : image0;
  const double wanted = kStep * static_cast<double>(fixed.size) / size_of_one;
  const double step = wanted < kMostStep ? wanted : kMostStep;
  Template t;
  if (!make_template(in_order ? image0 : image1, static_cast<double>(fixed.x),
                     static_cast<double>(fixed.y), step, &t)) {
    return false;
  }
  const double moving_step =
      step * static_cast<double>(moving.size) / static_cast<double>(fixed.size);
  double sine, cosine;
  sincos(static_cast<double>(moving.angle_rad) - static_cast<double>(fixed.angle_rad), &sine,
         &cosine);
  Linear map{{moving_step * cosine, -moving_step * sine, moving_step * sine, moving_step * cosine}};
  const double start_x = static_cast<double>(moving.x), start_y = static_cast<double>(moving.y);
  double x = start_x, y = start_y, length = 0, first_alike = 0, alike = 0;
  for (int n = 0; n < kSteps; ++n) {
    float samples[kSamples];
    if (!sample_window(image, x, y, map, kSide, samples)) return false;
    const double gain = dot(t.weighted, samples) / t.variance;
    if (!(gain > kLeastGain)) return false;
    alike = similarity(t, samples);
    if (n == 0) first_alike = alike;
    double change[kParameters];
    for (int p = 0; p < kParameters; ++p) change[p] = dot(t.slopes[p], samples) / gain;
    solve(t.factor, change);
    if (!compose_inverse(change + 2, &map)) return false;
    double step_x = map.m[0] * change[0] + map.m[1] * change[1];
    double step_y = map.m[2] * change[0] + map.m[3] * change[1];
    length = std::sqrt(step_x * step_x + step_y * step_y) / moving_step;
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
    return false;
  }
  moving.x = static_cast<float>(x);
  moving.y = static_cast<float>(y);
  return true;
}

}  // namespace tv
