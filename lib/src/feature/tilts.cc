#include "feature/tilts.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"

namespace tv {
namespace {

constexpr double kOne = 65536;

// sqrt(2), 2 and 2 sqrt(2): a slanted plane's lengths shrink by them at 45, 60 and 69 degrees.
constexpr double kSlight = 1.4142135623730951, kMedium = 2, kStrong = 2.8284271247461903;

// The directions, 22.5 degrees apart.
constexpr double kCosine1 = 0.92387953251128674, kCosine2 = 0.70710678118654752,
                 kCosine3 = 0.38268343236508977;
struct Direction {
  double cosine, sine;
};
constexpr Direction kDirections[8] = {
    {1, 0}, {kCosine1, kCosine3},  {kCosine2, kCosine2},  {kCosine3, kCosine1},
    {0, 1}, {-kCosine3, kCosine1}, {-kCosine2, kCosine2}, {-kCosine1, kCosine3}};

// The stronger the tilt, the closer are its directions: neighbours look alike then (Morel and Yu,
// 4.1). Tilts 1 to 4 are those of rung 2.
struct View {
  double tilt;
  int direction;
};
View view_of(int32_t tilt) {
  if (tilt <= 4) return {kMedium, 2 * (tilt - 1)};
  if (tilt <= 8) return {kSlight, 2 * (tilt - 5)};
  return {kStrong, tilt - 9};
}

// The keypoints of a view over those of the image: in proportion to the view's area, and fewer on
// the highest rung, which has many views.
constexpr double kHighestRung = 0.70710678118654752;

int32_t plain_budget(int32_t rung, int32_t max_keypoints) {
  return rung == 1 ? static_cast<int32_t>(
                         std::min<int64_t>(int64_t{4} * max_keypoints, kMostRungKeypoints))
                   : max_keypoints;
}

int32_t sum_of_views(int32_t rung, int32_t max_keypoints) {
  int64_t sum = plain_budget(rung, max_keypoints);
  const double share = rung == kMaxEffort ? kHighestRung : 1;
  for (int32_t tilt = 1; tilt < tilts_of_rung(rung); ++tilt) {
    sum += static_cast<int32_t>(share * max_keypoints / view_of(tilt).tilt);
  }
  return static_cast<int32_t>(std::min<int64_t>(sum, INT32_MAX));
}

}  // namespace

int32_t tilts_of_rung(int32_t rung) { return rung < 2 ? 1 : rung == 2 ? 5 : kNumTilts; }

int32_t rung_budget(int32_t rung, int32_t max_keypoints) {
  return std::min(sum_of_views(rung, max_keypoints), kMostRungKeypoints);
}

int32_t view_budget(int32_t rung, int32_t tilt, int32_t max_keypoints) {
  const int32_t all = sum_of_views(rung, max_keypoints);
  // Where all views together would have too many keypoints, each has the less. `all` is a sum of
  // rounded numbers, each of which may be 1 too low.
  constexpr double kMost = kMostRungKeypoints - kNumTilts;
  const double fewer = all > kMostRungKeypoints ? kMost / all : 1;
  if (tilt == 0) return static_cast<int32_t>(fewer * plain_budget(rung, max_keypoints));
  const double share = rung == kMaxEffort ? kHighestRung : 1;
  return static_cast<int32_t>(fewer * share * max_keypoints / view_of(tilt).tilt);
}

Squeeze squeeze_of(int32_t tilt, int32_t width, int32_t height) {
  const View view = view_of(tilt);
  const Direction& d = kDirections[view.direction];
  return make_squeeze(view.tilt, d.cosine, d.sine, width, height);
}

bool is_usable(const Squeeze& squeeze) {
  return std::min(squeeze.width, squeeze.height) >= kMinLevelSide &&
         squeeze.width <= kMaxViewSide && squeeze.height <= kMaxViewSide;
}

// The map from the image to the view is (a b; 0 c) = R S with S symmetric, and R turns by the
// returned angle.
float upright_angle_rad(int32_t tilt) {
  if (tilt == 0) return 0;
  const Squeeze s = squeeze_of(tilt, 1, 1);
  const double a = kOne / s.step_x, c = kOne / s.step_y, b = -a * s.shear / kOne;
  return static_cast<float>(atan2(-b, a + c));
}

void map_keypoints(const Squeeze& s, tv_keypoint* keypoints, int32_t count) {
  const double x_of_u = s.step_x / kOne, y_of_v = s.step_y / kOne, x_of_v = s.shear / kOne * y_of_v;
  const double scale = std::sqrt(x_of_u * y_of_v);
  for (int32_t k = 0; k < count; ++k) {
    tv_keypoint& p = keypoints[k];
    double x, y, sine, cosine;
    to_image(s, static_cast<double>(p.x), static_cast<double>(p.y), &x, &y);
    sincos(static_cast<double>(p.angle_rad), &sine, &cosine);
    p.x = static_cast<float>(x);
    p.y = static_cast<float>(y);
    p.angle_rad = static_cast<float>(atan2(y_of_v * sine, x_of_u * cosine + x_of_v * sine));
    p.size = std::min(static_cast<float>(p.size * scale), kMostKeypointSize);
  }
}

void patch_shape(const tv_keypoint& keypoint, int32_t tilt, double shape[4]) {
  double sine, cosine;
  sincos(static_cast<double>(keypoint.angle_rad), &sine, &cosine);
  double size = static_cast<double>(keypoint.size);
  double x_of_u = 1, x_of_v = 0, y_of_v = 1;
  if (tilt > 0) {
    const Squeeze s = squeeze_of(tilt, 1, 1);
    x_of_u = s.step_x / kOne;
    y_of_v = s.step_y / kOne;
    x_of_v = s.shear / kOne * y_of_v;
    size /= std::sqrt(x_of_u * y_of_v);
    // The angle in the view: the direction in the image, mapped there.
    const double v = sine / y_of_v, u = (cosine - x_of_v * v) / x_of_u;
    const double length = std::sqrt(u * u + v * v);
    cosine = u / length;
    sine = v / length;
  }
  shape[0] = size * (x_of_u * cosine + x_of_v * sine);
  shape[1] = size * (x_of_v * cosine - x_of_u * sine);
  shape[2] = size * (y_of_v * sine);
  shape[3] = size * (y_of_v * cosine);
}

}  // namespace tv
