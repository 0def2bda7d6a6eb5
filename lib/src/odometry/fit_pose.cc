#include "odometry/fit_pose.h"

#include <algorithm>
#include <cmath>

#include "odometry/search.h"

namespace tv {

bool fit_pose(Odometry* odometry, int32_t max_iterations, double max_error_px, Frame* frame,
              PoseFit* fit) {
  ArenaScope scope(odometry->scratch);
  const size_t room = static_cast<size_t>(frame->num);
  double* pixels = arena_alloc<double>(odometry->scratch, 2 * room);
  double* points = arena_alloc<double>(odometry->scratch, 3 * room);
  float* sigmas = arena_alloc<float>(odometry->scratch, room);
  int32_t* keypoints = arena_alloc<int32_t>(odometry->scratch, room);
  uint8_t* is_inlier = arena_alloc<uint8_t>(odometry->scratch, room);
  double centre[3];
  centre_of(frame->cam_from_world, centre);
  tv_pixel_points matches;
  tv_pixel_points_init(&matches);
  for (int32_t k = 0; k < frame->num; ++k) {
    if (frame->points[k] == kNoPoint) continue;
    const MapPoint& point = odometry->map.points[frame->points[k]];
    const int32_t n = matches.num++;
    pixels[2 * n] = static_cast<double>(frame->keypoints[k].x);
    pixels[2 * n + 1] = static_cast<double>(frame->keypoints[k].y);
    for (int c = 0; c < 3; ++c) points[3 * n + c] = point.position[c];
    double sigma = static_cast<double>(frame->sigmas[k]);
    if (frame->has_pose) {
      double x[3];
      transform(frame->cam_from_world, point.position, x);
      const double error =
          depth_error_px(*odometry, point, centre, std::max(x[2], 1e-9)) / kTypicalNoise;
      sigma = std::sqrt(sigma * sigma + error * error);
    }
    sigmas[n] = static_cast<float>(std::min(sigma, 1000.0));
    keypoints[n] = k;
  }
  if (matches.num < 4) return false;
  matches.pixels = pixels;
  matches.points = points;
  matches.sigmas = sigmas;
  tv_absolute_pose_options options;
  tv_absolute_pose_options_init(&options);
  options.max_iterations = max_iterations;
  options.max_error_px = max_error_px;
  options.seed = odometry->options.seed;
  tv_absolute_pose_init(&fit->estimate);
  const tv_status status = tv_estimate_absolute_pose(odometry->context, &odometry->camera.model,
                                                     &matches, &options, &fit->estimate, is_inlier);
  if (status != TV_OK || !fit->estimate.has_pose) return false;
  for (int k = 0; k < 9; ++k) fit->cam_from_world.R[k] = fit->estimate.R[k];
  for (int k = 0; k < 3; ++k) fit->cam_from_world.t[k] = fit->estimate.t[k];
  for (int32_t n = 0; n < matches.num; ++n) {
    if (is_inlier[n]) continue;
    frame->points[keypoints[n]] = kNoPoint;
    frame->distances[keypoints[n]] = TVK_NEAREST_NONE;
  }
  return true;
}

}  // namespace tv
