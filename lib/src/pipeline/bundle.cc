#include "pipeline/bundle.h"

#include <cmath>

namespace tv {

Motion read_motion(const tv_camera_pair& pair) {
  const double* const t = pair.cam1_from_cam0_t;
  double largest = 0.0;
  for (int i = 0; i < 3; ++i) largest = std::fabs(t[i]) > largest ? std::fabs(t[i]) : largest;
  const double x = t[0] / largest, y = t[1] / largest, z = t[2] / largest;
  const double length = std::sqrt(x * x + y * y + z * z);
  Motion motion;
  motion.baseline = largest * length;
  motion.pose = {matrix_of(pair.cam1_from_cam0_R), Vec3(x / length, y / length, z / length)};
  return motion;
}

void adjust_pair(tv_context* context, const tv_pixel_pairs& pixels,
                 const tv_bundle_options& options, const Motion& motion, tv_camera_pair* pair,
                 tv_point* points, BundleOutcome* outcome) {
  StageTimer timer(context, TV_STAGE_REFINE);
  const BundleProblem problem{{prepare_camera(pair->camera0), prepare_camera(pair->camera1)},
                              {pixels.pixels0, pixels.pixels1},
                              {pixels.sigmas0, pixels.sigmas1},
                              pixels.num,
                              options};
  adjust_two_view(problem, motion.pose, motion.baseline, context->arena, points, outcome);
  if (!outcome->moved) return;  // R and t keep their bits
  write_matrix(outcome->pose.R, pair->cam1_from_cam0_R);
  for (int i = 0; i < 3; ++i) pair->cam1_from_cam0_t[i] = motion.baseline * outcome->pose.t[i];
}

}  // namespace tv
