#include "robust/still.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/camera.h"

namespace tv {
namespace {

// Fewer matches do not decide a pose. A wrong match keeps its pixel with a probability of about
// 2e-5 (a disc of 2 pixels in 640 x 480), so that so many wrong ones do so in no pair.
constexpr int kFewestStill = 8;
constexpr int kFewestMoving = 30;
// A point of the scene that stays at its pixel is, with this many standard deviations of the pixel
// and of the rotation, on the curve on which points of any distance lie.
constexpr double kClearSigmas = 3;

// Which cells of a grid over the picture hold something.
struct Places {
  static constexpr int kSide = 16;
  uint32_t rows[kSide] = {};

  void add(const tv_camera& camera, const double* pixel) {
    const double x = std::clamp(pixel[0] * kSide / camera.width, 0.0, kSide - 1.0);
    const double y = std::clamp(pixel[1] * kSide / camera.height, 0.0, kSide - 1.0);
    rows[static_cast<int>(y)] |= 1u << static_cast<int>(x);
  }
  int count() const {
    int cells = 0;
    for (uint32_t row : rows) cells += __builtin_popcount(row);
    return cells;
  }
};

// The threshold of a match in pixels, at least one: in these, sigmas in another unit change
// nothing.
double threshold_px(const TwoViewProblem& problem, int32_t i) {
  const double sigma = std::max(problem.sigma(0, i), problem.sigma(1, i));
  return std::max(1.0, sigma * problem.options.max_error_px);
}

// The squared displacement of a match, in units of what a still one moves at most.
double moved_sq(const TwoViewProblem& problem, int32_t i) {
  const double dx = problem.pixels[1][2 * i] - problem.pixels[0][2 * i];
  const double dy = problem.pixels[1][2 * i + 1] - problem.pixels[0][2 * i + 1];
  const double reach = kStillThresholds * threshold_px(problem, i);
  return (dx * dx + dy * dy) / (reach * reach);
}

// A pose, and the cameras that it refers to.
struct Motion {
  Camera camera[2];
  Mat3 R;
  Vec3 t;
  bool has_t;
};

// The angle in radians (its chord) between where view 1 sees the match and the arc on which it
// sees points on the ray of view 0: from R ray, infinitely far, towards t, next to the camera. A
// ray outside the lens model is on it.
double distance_from_arc(const Motion& motion, const double* pixel0, const double* pixel1) {
  Vec3 ray0, seen;
  if (!unproject(motion.camera[0], Vec2(pixel0[0], pixel0[1]), &ray0, nullptr) ||
      !unproject(motion.camera[1], Vec2(pixel1[0], pixel1[1]), &seen, nullptr)) {
    return 0;
  }
  const Vec3 far = motion.R * ray0;
  const double from_far = Vec3(seen - far).norm();
  if (!motion.has_t) return from_far;
  const Vec3 normal = far.cross(motion.t);
  const double length = normal.norm();
  if (!(length > 1e-9)) return from_far;
  const bool is_between = far.cross(seen).dot(normal) >= 0 && seen.cross(motion.t).dot(normal) >= 0;
  if (is_between) return std::fabs(seen.dot(normal)) / length;
  return std::min(from_far, Vec3(seen - motion.t).norm());
}

// The largest standard deviation of the rotation about an axis, in radians; negative where it is
// not known. What a misfit of the camera adds to it is no noise of this pair's matches.
double turn_sigma(const TwoViewOutcome& outcome) {
  if (!outcome.has_t) return 0;  // that of a rotation alone is far below a pixel
  if (!outcome.has_covariance) return -1;
  const CameraMisfit& misfit = outcome.evidence->misfit;
  if (misfit.given_turn_sigma_rad > 0) return misfit.given_turn_sigma_rad;
  const double* c = outcome.covariance;
  return std::sqrt(std::max(std::max(c[0], c[6]), c[12]));
}

}  // namespace

int find_still_matches(const TwoViewProblem& problem, uint8_t* is_still) {
  int num_still = 0, num_slow = 0, num_moving = 0;
  Places still, moving;
  for (int32_t i = 0; i < problem.num; ++i) {
    const double moved = moved_sq(problem, i);
    const double* pixel = problem.pixels[0] + 2 * i;
    is_still[i] = moved < 1;
    if (moved < 1) {
      ++num_still;
      still.add(problem.camera[0].model, pixel);
    } else if (moved < 4) {
      ++num_slow;
    } else if (moved < 1e12) {  // what is not finite is no match
      ++num_moving;
      moving.add(problem.camera[0].model, pixel);
    }
  }
  // In a scene the motion changes from place to place by and by: more of its matches are slow than
  // still, since a ring has more area than the disc within it.
  const bool is_apart = num_still > 2 * num_slow;
  const bool is_worth_it = num_still >= kFewestStill && num_moving >= kFewestMoving && is_apart &&
                           moving.count() > still.count();
  return is_worth_it ? num_still : 0;
}

bool contradicts_still(const TwoViewProblem& problem, const Matches& matches,
                       const TwoViewOutcome& outcome, int num_still) {
  const uint32_t bad = TV_REASON_TOO_FEW_MATCHES | TV_REASON_LOW_INLIER_RATIO;
  if (!outcome.has_R || outcome.evidence->kind == TV_KIND_NO_MOTION ||
      (judge(*outcome.evidence).reasons & bad) != 0) {
    return false;
  }
  const double sigma_rad = turn_sigma(outcome);
  if (sigma_rad < 0) return false;
  Motion motions[2];
  const int num_motions = outcome.evidence->has_alternative ? 2 : 1;
  for (int m = 0; m < num_motions; ++m) {
    const Pose& pose = m == 0 ? outcome.epipolar.pose : outcome.alternative;
    motions[m] = Motion{{moved_camera(problem, 0, outcome.principal_point_shift_px),
                         moved_camera(problem, 1, outcome.principal_point_shift_px)},
                        pose.R,
                        pose.t,
                        outcome.has_t};
  }
  const tv_camera& model = motions[0].camera[1].model;
  const double rad_per_px = 1 / std::max(model.fx, model.fy);
  Places still, explained;
  int num_clear = 0;
  for (int32_t i = 0; i < problem.num; ++i) {
    if (problem.is_still[i] == 0) continue;
    const double *pixel0 = problem.pixels[0] + 2 * i, *pixel1 = problem.pixels[1] + 2 * i;
    still.add(problem.camera[0].model, pixel0);
    double distance = distance_from_arc(motions[0], pixel0, pixel1);
    if (num_motions == 2) {
      distance = std::min(distance, distance_from_arc(motions[1], pixel0, pixel1));
    }
    const double noise_rad = threshold_px(problem, i) * rad_per_px;
    num_clear += distance > kClearSigmas * (noise_rad + sigma_rad);
  }
  for (int k = 0; k < matches.num_all; ++k) {
    if (outcome.inlier[k] == 0) continue;
    explained.add(problem.camera[0].model, problem.pixels[0] + 2 * matches.order[k]);
  }
  return num_clear >= kFewestStill && 2 * num_clear > num_still &&
         explained.count() > still.count();
}

}  // namespace tv
