#include "odometry/find_points.h"

#include <algorithm>
#include <cmath>

#include "geometry/vector3.h"
#include "twoview/match.h"

namespace tv {
namespace {

constexpr int32_t kMostCandidates = 400;
constexpr int32_t kMaxDistance = 200;  // of descriptors, L2
constexpr double kSearchRatio = 0.9;   // of the nearest one's distance to that of the second
constexpr int32_t kAhead = 8;          // how many points ahead memory is prefetched
// The keypoints within this radius in pixels are compared: a match is the nearest of them all.
constexpr double kComparedRadius = 20.0;
constexpr float kSameCornerSq = 16.0f;       // px^2: nearer keypoints are of the same corner
constexpr double kLargestDepthError = 40.0;  // px

int32_t clamped_cell(float x, int32_t cells) {
  const int32_t cell = static_cast<int32_t>(x) / kCellPx;
  return std::min(std::max(cell, 0), cells - 1);
}

}  // namespace

void make_grid(const Odometry& odometry, Frame* frame) {
  const int32_t columns = odometry.grid_columns, cells = columns * odometry.grid_rows;
  std::fill(frame->cell_starts, frame->cell_starts + cells + 1, 0);
  for (int32_t k = 0; k < frame->num; ++k) {
    const tv_keypoint& p = frame->keypoints[k];
    const int32_t cell =
        clamped_cell(p.y, odometry.grid_rows) * columns + clamped_cell(p.x, columns);
    ++frame->cell_starts[cell + 1];
    frame->distances[k] = cell;
  }
  for (int32_t c = 0; c < cells; ++c) frame->cell_starts[c + 1] += frame->cell_starts[c];
  for (int32_t k = frame->num - 1; k >= 0; --k) {
    // Counts each cell's end down to its start.
    frame->cell_items[--frame->cell_starts[frame->distances[k] + 1]] = k;
  }
  // The starts are one cell too far on now, and are moved back.
  for (int32_t c = 0; c < cells; ++c) frame->cell_starts[c] = frame->cell_starts[c + 1];
  frame->cell_starts[cells] = frame->num;
  forget_points(frame);
}

void forget_points(Frame* frame) {
  for (int32_t k = 0; k < frame->num; ++k) {
    frame->points[k] = kNoPoint;
    frame->distances[k] = TVK_NEAREST_NONE;
  }
}

double depth_error_px(const Odometry& odometry, const MapPoint& point, const double centre[3],
                      const double x[3]) {
  double ray[3], across[3], moved[3];
  for (int k = 0; k < 3; ++k) {
    moved[k] = centre[k] - static_cast<double>(point.seen_from[k]);
    ray[k] = point.position[k] - static_cast<double>(point.seen_from[k]);
  }
  const double length = length_of(ray);
  if (!(length > 0)) return 0;
  cross(ray, moved, across);
  const double shift = length_of(across) / length * static_cast<double>(point.depth_sigma);
  const double depth = has_image_plane(odometry.camera) ? x[2] : length_of(x);
  return std::min(odometry.camera.model.fx * shift / std::max(depth, 1e-9), kLargestDepthError);
}

int32_t find_points(Odometry* odometry, const PointSearch& search, Frame* frame) {
  Map& map = odometry->map;
  const tv_camera& model = odometry->camera.model;
  const int32_t columns = odometry->grid_columns;
  const tvk_match_table& kernels = *tvk_match_of(odometry->kernels);
  double centre[3];
  centre_of(search.cam_from_world, centre);
  ArenaScope scope(odometry->scratch);
  // The keypoints' positions in the order of the grid, which are next to each other in memory.
  struct Position {
    float x, y;
  };
  Position* positions = arena_alloc<Position>(odometry->scratch, static_cast<size_t>(frame->num));
  for (int32_t n = 0; n < frame->num; ++n) {
    const tv_keypoint& keypoint = frame->keypoints[frame->cell_items[n]];
    positions[n] = {keypoint.x, keypoint.y};
  }
  for (int32_t i = 0; i < search.num; ++i) {
    const int32_t idx = search.points[i];
    MapPoint& point = map.points[idx];
    if (i + kAhead < search.num) __builtin_prefetch(&map.points[search.points[i + kAhead]]);
    if (point.id < 0) continue;
    double x[3];
    transform(search.cam_from_world, point.position, x);
    Vec2 pixel;
    if (!project(odometry->camera, Vec3(x[0], x[1], x[2]), &pixel, nullptr)) continue;
    if (!(pixel.x() >= 0 && pixel.y() >= 0 && pixel.x() < model.width &&
          pixel.y() < model.height)) {
      continue;
    }
    __builtin_prefetch(descriptor_of(map, idx));
    __builtin_prefetch(descriptor_of(map, idx) + TV_DESCRIPTOR_BYTES / 2);
    point.num_visible += search.counts;
    const double radius = search.radius_px + 2 * depth_error_px(*odometry, point, centre, x);
    const float px = static_cast<float>(pixel.x()), py = static_cast<float>(pixel.y());
    const float near_sq = static_cast<float>(radius * radius);
    const float reach = static_cast<float>(std::max(radius, kComparedRadius));
    const int32_t x0 = clamped_cell(px - reach, columns), x1 = clamped_cell(px + reach, columns);
    const int32_t y0 = clamped_cell(py - reach, odometry->grid_rows);
    const int32_t y1 = clamped_cell(py + reach, odometry->grid_rows);
    int32_t candidates[kMostCandidates], distances[kMostCandidates], num = 0;
    for (int32_t cy = y0; cy <= y1; ++cy) {
      const int32_t begin = frame->cell_starts[cy * columns + x0];
      const int32_t end = frame->cell_starts[cy * columns + x1 + 1];
      for (int32_t n = begin; n < end && num < kMostCandidates; ++n) {
        const float dx = positions[n].x - px, dy = positions[n].y - py;
        candidates[num] = frame->cell_items[n];  // kept if it is near; a branch would mispredict
        num += dx * dx + dy * dy <= reach * reach;
      }
    }
    if (num == 0) continue;
    kernels.squared_distances(descriptor_of(map, idx), frame->descriptors, candidates, num,
                              distances);
    int32_t best = 0;
    for (int32_t n = 1; n < num; ++n) {
      if (distances[n] < distances[best]) best = n;
    }
    if (distances[best] > kMaxDistance * kMaxDistance) continue;
    const int32_t keypoint = candidates[best];
    const float near_x = frame->keypoints[keypoint].x - px;
    const float near_y = frame->keypoints[keypoint].y - py;
    if (near_x * near_x + near_y * near_y > near_sq) continue;
    int32_t second_sq = TVK_NEAREST_NONE;
    for (int32_t n = 0; n < num; ++n) {
      const tv_keypoint& other = frame->keypoints[candidates[n]];
      const float dx = other.x - frame->keypoints[keypoint].x;
      const float dy = other.y - frame->keypoints[keypoint].y;
      const int32_t counted = dx * dx + dy * dy >= kSameCornerSq ? distances[n] : TVK_NEAREST_NONE;
      second_sq = std::min(second_sq, counted);
    }
    if (distances[best] > kSearchRatio * kSearchRatio * second_sq) continue;
    if (distances[best] >= frame->distances[keypoint]) continue;
    frame->points[keypoint] = idx;
    frame->distances[keypoint] = distances[best];
  }
  int32_t num_matches = 0;
  for (int32_t k = 0; k < frame->num; ++k) num_matches += frame->points[k] != kNoPoint;
  return num_matches;
}

int32_t match_points(Odometry* odometry, const int32_t* points, int32_t num, double ratio,
                     Frame* frame) {
  ArenaScope scope(odometry->scratch);
  const int32_t most = odometry->max_matched;
  num = std::min(num, most);
  uint8_t* descriptors =
      arena_alloc<uint8_t>(odometry->scratch, static_cast<size_t>(num) * TV_DESCRIPTOR_BYTES);
  tv_correspondence* found = arena_alloc<tv_correspondence>(
      odometry->scratch, static_cast<size_t>(std::min(num, frame->num)));
  for (int32_t k = 0; k < num; ++k) {
    std::copy_n(descriptor_of(odometry->map, points[k]), TV_DESCRIPTOR_BYTES,
                descriptors + static_cast<size_t>(k) * TV_DESCRIPTOR_BYTES);
  }
  tv_features of_points, of_frame;
  tv_features_init(&of_points);
  tv_features_init(&of_frame);
  of_points.num = num;
  of_points.descriptors = descriptors;
  of_frame.num = frame->num;
  of_frame.descriptors = frame->descriptors;
  tv_match_options options;
  tv_match_options_init(&options);
  options.ratio = static_cast<float>(ratio);
  options.neighbourhood_px = 0;
  int32_t num_found = 0;
  tv_match(odometry->context, &of_points, &of_frame, &options, found, std::min(num, frame->num),
           &num_found);
  forget_points(frame);
  for (int32_t k = 0; k < num_found; ++k) {
    frame->points[found[k].idx1] = points[found[k].idx0];
    frame->distances[found[k].idx1] = static_cast<int32_t>(found[k].dist_sq);
  }
  return num_found;
}

}  // namespace tv
