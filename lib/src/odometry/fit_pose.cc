#include "odometry/fit_pose.h"

#include <algorithm>
#include <cmath>

#include "odometry/find_points.h"
#include "pose/absolute_pose.h"
#include "pose/reprojection.h"

namespace tv {
namespace {

// The keypoints of a frame that have a point, as the absolute pose takes them.
struct FrameMatches {
  SightingInput input;
  Sightings sightings;
  int32_t* keypoints;  // of each match
  uint8_t* is_inlier;
  tv_absolute_pose_options options;
};

// Returns false where the matches are too few for a pose.
bool gather_matches(Odometry* odometry, double max_error_px, const Frame& frame,
                    FrameMatches* matches) {
  Arena& arena = odometry->scratch;
  const size_t room = static_cast<size_t>(frame.num);
  double* pixels = arena_alloc<double>(arena, 2 * room);
  double* points = arena_alloc<double>(arena, 3 * room);
  float* sigmas = arena_alloc<float>(arena, room);
  matches->keypoints = arena_alloc<int32_t>(arena, room);
  matches->is_inlier = arena_alloc<uint8_t>(arena, room);
  double centre[3];
  centre_of(frame.cam_from_world, centre);
  int num = 0;
  for (int32_t k = 0; k < frame.num; ++k) {
    if (frame.points[k] == kNoPoint) continue;
    const MapPoint& point = odometry->map.points[frame.points[k]];
    pixels[2 * num] = static_cast<double>(frame.keypoints[k].x);
    pixels[2 * num + 1] = static_cast<double>(frame.keypoints[k].y);
    for (int c = 0; c < 3; ++c) points[3 * num + c] = point.position[c];
    double sigma = static_cast<double>(frame.sigmas[k]);
    if (frame.has_pose) {
      double x[3];
      transform(frame.cam_from_world, point.position, x);
      const double error = depth_error_px(*odometry, point, centre, x) / kTypicalNoise;
      sigma = std::sqrt(sigma * sigma + error * error);
    }
    sigmas[num] = static_cast<float>(std::min(sigma, 1000.0));
    matches->is_inlier[num] = 0;
    matches->keypoints[num++] = k;
  }
  if (num < 4) return false;
  matches->input = {odometry->kernels, odometry->camera, pixels, points, nullptr, sigmas, num};
  prepare_sightings(matches->input, arena, &matches->sightings);
  tv_absolute_pose_options_init(&matches->options);
  matches->options.max_error_px = max_error_px;
  matches->options.seed = odometry->options.seed;
  return true;
}

void finish(Odometry* odometry, const AbsolutePoseSearch& found, const FrameMatches& matches,
            PoseFit* fit) {
  tv_absolute_pose* estimate = &fit->estimate;
  tv_absolute_pose_init(estimate);
  estimate->num_matches = matches.input.num;
  finish_absolute_pose(matches.input, matches.sightings, matches.options, found, odometry->scratch,
                       estimate, matches.is_inlier);
  fit->cam_from_world = rigid_of(estimate->R, estimate->t);
}

void count_inliers(const Pose& pose, const FrameMatches& matches, PoseFit* fit) {
  const Sightings& s = matches.sightings;
  const double most = matches.options.max_error_px;
  fit->estimate.num_matches = matches.input.num;
  fit->estimate.num_inliers = 0;
  for (int k = 0; k < s.num_all; ++k) {
    if (!(reprojection_sq(s.all[k], pose) <= most * most)) continue;
    matches.is_inlier[s.order[k]] = 1;
    ++fit->estimate.num_inliers;
  }
  write_pose(s, pose, fit->cam_from_world.R, fit->cam_from_world.t);
}

// Searches the pose in max_iterations; with 0, *fit holds it already. Refines it if `refines`.
bool fit_matches(Odometry* odometry, int32_t max_iterations, bool refines, double max_error_px,
                 Frame* frame, PoseFit* fit) {
  ArenaScope scope(odometry->scratch);
  FrameMatches matches;
  if (!gather_matches(odometry, max_error_px, *frame, &matches)) return false;
  AbsolutePoseSearch found;
  if (max_iterations > 0) {
    matches.options.max_iterations = max_iterations;
    search_absolute_pose(matches.sightings, matches.options, false, odometry->scratch, &found);
    if (!found.found) return false;
  } else {
    found.found = true;
    found.pose = read_pose(matches.sightings, fit->cam_from_world.R, fit->cam_from_world.t);
  }
  if (refines) {
    finish(odometry, found, matches, fit);
    if (!fit->estimate.has_pose) return false;
  } else {
    count_inliers(found.pose, matches, fit);
  }
  for (int k = 0; k < matches.input.num; ++k) {
    if (matches.is_inlier[k]) continue;
    frame->points[matches.keypoints[k]] = kNoPoint;
    frame->distances[matches.keypoints[k]] = TVK_NEAREST_NONE;
  }
  return true;
}

}  // namespace

bool search_pose(Odometry* odometry, int32_t max_iterations, double max_error_px, Frame* frame,
                 PoseFit* fit) {
  return fit_matches(odometry, max_iterations, false, max_error_px, frame, fit);
}

bool refine_pose(Odometry* odometry, double max_error_px, Frame* frame, PoseFit* fit) {
  return fit_matches(odometry, 0, true, max_error_px, frame, fit);
}

bool fit_pose(Odometry* odometry, int32_t max_iterations, double max_error_px, Frame* frame,
              PoseFit* fit) {
  return fit_matches(odometry, max_iterations, true, max_error_px, frame, fit);
}

}  // namespace tv
