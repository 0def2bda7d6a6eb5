#include "robust/estimators_upright.h"

#include "robust/refine.h"

namespace tv {
namespace {

// The rounds with a wider threshold only bring the pose near its minimum and need few steps.
constexpr int kWideIterations = 4;
constexpr double kWidest = 16;

// The width, in thresholds, with which local optimisation begins: about the distance by which
// gravity's error moves a point, less the part that yaw and translation compensate; a power of two,
// at most kWidest. docs/algorithms/gravity.md has the measurements.
double first_width(const RayPairs& pairs, double threshold_px, double sigma_rad) {
  double sum = 0;
  for (int i = 0; i < pairs.num; ++i) sum += pairs.pixel_angle[i];
  const double width = sigma_rad * pairs.num / (1.5 * sum * threshold_px);
  double power = 1;
  while (power < width && power < kWidest) power *= 2;
  return power;
}

// Gives t the sign with which the sample's points lie in front of the cameras. False when a match
// is clearly behind a camera with either sign.
bool face_forward(const RayPairs& pairs, const int32_t* sample, double threshold_px, Pose* pose) {
  int behind[2] = {}, in_front[2] = {};
  for (int k = 0; k < 3; ++k) {
    const int i = sample[k];
    const DepthSigns d = depth_signs(*pose, ray_of(pairs, 0, i), ray_of(pairs, 1, i),
                                     threshold_px * pairs.pixel_angle[i]);
    const DepthSigns opposite{-d.depth0, -d.depth1, d.tolerance0_sq, d.tolerance1_sq};
    behind[0] += depth_vote(d) < 0;
    behind[1] += depth_vote(opposite) < 0;
    in_front[0] += (d.depth0 > 0) + (d.depth1 > 0);
    in_front[1] += (d.depth0 < 0) + (d.depth1 < 0);
    if (behind[0] > 0 && behind[1] > 0) return false;
  }
  const bool turn = behind[0] != behind[1] ? behind[1] < behind[0] : in_front[1] > in_front[0];
  if (turn) pose->t = -pose->t;
  return true;
}

}  // namespace

UprightEstimator make_upright_estimator(const RayPairs& pairs, double threshold_px,
                                        int32_t* indices, const GravityPrior& gravity) {
  return UprightEstimator{{pairs, threshold_px, indices, nullptr},
                          gravity,
                          level_from_camera(gravity.down[0]),
                          level_from_camera(gravity.down[1]),
                          first_width(pairs, threshold_px, gravity.sigma_rad)};
}

int UprightEstimator::generate_models(const int32_t* sample, Pose* models) const {
  Vec3 rays0[3], rays1[3];
  for (int k = 0; k < 3; ++k) {
    rays0[k] = ray_of(pairs, 0, sample[k]);
    rays1[k] = ray_of(pairs, 1, sample[k]);
  }
  const int count = relpose_upright_3pt(rays0, rays1, level0, level1, models);
  int num_models = 0;
  for (int k = 0; k < count; ++k) {
    Pose pose = models[k];
    if (!face_forward(pairs, sample, threshold_px, &pose)) continue;
    models[num_models++] = pose;
  }
  return num_models;
}

void UprightEstimator::refine_model(Pose* model) const {
  GravityPoseModel refined{*model, &gravity, 0.5 * threshold_px};
  for (double width = width_first; width >= 1; width *= 0.5) {
    const double wide_px = width * threshold_px;
    const int count =
        near_matches(pairs, pairs.num, refined.pose, kNear * wide_px, wide_px, indices);
    refine(pairs, indices, count, RobustLoss{Loss::kTruncated, wide_px},
           width > 1 ? kWideIterations : kLocalIterations, &refined);
  }
  *model = refined.pose;
}

}  // namespace tv
