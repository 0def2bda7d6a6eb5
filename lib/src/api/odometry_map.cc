// The entry points that show the odometry's map, and that turn it into bytes and back.
#include <algorithm>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "odometry/adjust.h"
#include "odometry/keyframe.h"
#include "odometry/loop_closure.h"
#include "odometry/map_bytes.h"
#include "odometry/work.h"
#include "twoview/odometry.h"

namespace tv {
namespace {

// Whether an array of `cap` elements has room for `needed` ones. Writes how many that is.
tv_status check_room(const tv_odometry* odometry, const void* elements, size_t element_bytes,
                     int32_t cap, int32_t needed, int32_t* num) {
  if (odometry == nullptr || num == nullptr || (elements == nullptr && cap > 0)) return TV_ERR_NULL;
  if (cap < 0) return TV_ERR_ARGUMENT;
  if (overlap(elements, static_cast<size_t>(cap) * element_bytes, num, sizeof *num)) {
    return TV_ERR_OVERLAP;
  }
  *num = needed;
  return needed > cap ? TV_ERR_CAPACITY : TV_OK;
}

// rank_points in the odometry's scratch memory.
int32_t* points_in_order(const tv_odometry& odometry, int32_t** ranks) {
  Arena scratch = odometry.scratch;
  const size_t room = static_cast<size_t>(odometry.map.end_points);
  int32_t* places = arena_alloc<int32_t>(scratch, room);
  *ranks = arena_alloc<int32_t>(scratch, room);
  rank_points(odometry.map, places, *ranks);
  return places;
}

}  // namespace
}  // namespace tv

tv_status tv_odometry_keyframe(const tv_odometry* odometry, int32_t idx, tv_keyframe* keyframe) {
  if (odometry == nullptr || keyframe == nullptr) return TV_ERR_NULL;
  const tv_status status = tv::check_sized(keyframe);
  if (status != TV_OK) return status;
  if (!tv::within(idx, 0, odometry->map.num_keyframes - 1)) return TV_ERR_ARGUMENT;
  const tv::MapKeyframe& k = odometry->map.keyframes[idx];
  const tv::Rigid world_from_cam = tv::inverse(k.cam_from_world);
  tv_keyframe packed{};
  packed.id = k.id;
  packed.segment = k.segment;
  packed.frame = k.frame;
  packed.time_s = k.time_s;
  tv::write_rigid(world_from_cam, packed.world_from_cam_R, packed.world_from_cam_t);
  packed.num_keypoints = k.num_keypoints;
  packed.num_observations = k.num_observations;
  tv::write_sized(packed, keyframe);
  return TV_OK;
}

tv_status tv_odometry_covariance(tv_odometry* odometry, int32_t idx, double covariance[36],
                                 int32_t* is_known) {
  if (odometry == nullptr || covariance == nullptr || is_known == nullptr) return TV_ERR_NULL;
  if (!tv::within(idx, 0, odometry->map.num_keyframes - 1)) return TV_ERR_ARGUMENT;
  if (tv::overlap(covariance, 36 * sizeof *covariance, is_known, sizeof *is_known)) {
    return TV_ERR_OVERLAP;
  }
  *is_known = tv::estimate_covariance(odometry, idx, covariance);
  if (*is_known == 0) std::fill(covariance, covariance + 36, 0.0);
  return TV_OK;
}

tv_status tv_odometry_points(const tv_odometry* odometry, tv_map_point* points, int32_t cap_points,
                             int32_t* num_points) {
  const int32_t needed = odometry != nullptr ? odometry->map.num_points : 0;
  const tv_status status =
      tv::check_room(odometry, points, sizeof *points, cap_points, needed, num_points);
  if (status != TV_OK) return status;
  int32_t* ranks;
  const int32_t* places = tv::points_in_order(*odometry, &ranks);
  for (int32_t n = 0; n < needed; ++n) {
    const tv::MapPoint& point = odometry->map.points[places[n]];
    points[n] = tv_map_point{};
    points[n].id = point.id;
    points[n].segment = point.segment;
    points[n].num_observations = point.num_observations;
    points[n].grey = point.grey;
    std::copy_n(point.position, 3, points[n].position);
    tv::point_covariance(*odometry, point, points[n].covariance);
  }
  return TV_OK;
}

tv_status tv_odometry_observations(const tv_odometry* odometry, int32_t idx,
                                   tv_map_observation* observations, int32_t cap_observations,
                                   int32_t* num_observations) {
  if (odometry == nullptr || num_observations == nullptr) return TV_ERR_NULL;
  const tv::Map& map = odometry->map;
  if (!tv::within(idx, 0, map.num_keyframes - 1)) return TV_ERR_ARGUMENT;
  const tv::MapKeyframe& keyframe = map.keyframes[idx];
  const tv_status status =
      tv::check_room(odometry, observations, sizeof *observations, cap_observations,
                     keyframe.num_observations, num_observations);
  if (status != TV_OK) return status;
  int32_t* ranks;
  tv::points_in_order(*odometry, &ranks);
  const tv::MapKeypoint* own = tv::keypoints_of(map, keyframe);
  const int32_t* seen = tv::seen_by(map, keyframe);
  for (int32_t k = 0; k < keyframe.num_keypoints; ++k) {
    if (seen[k] == tv::kNoPoint) continue;
    *observations++ = {
        ranks[seen[k]], k, own[k].x, own[k].y, static_cast<float>(tv::sigma_of(own[k])), 0};
  }
  return TV_OK;
}

tv_status tv_odometry_last_frame(const tv_odometry* odometry, tv_map_observation* observations,
                                 int32_t cap_observations, int32_t* num_observations) {
  const int32_t needed = odometry != nullptr ? odometry->frame.num : 0;
  const tv_status status = tv::check_room(odometry, observations, sizeof *observations,
                                          cap_observations, needed, num_observations);
  if (status != TV_OK) return status;
  const tv::Frame& frame = odometry->frame;
  int32_t* ranks;
  tv::points_in_order(*odometry, &ranks);
  for (int32_t k = 0; k < needed; ++k) {
    const int32_t point = frame.has_pose ? frame.points[k] : tv::kNoPoint;
    const bool is_seen = point != tv::kNoPoint && odometry->map.points[point].id >= 0;
    observations[k] = {is_seen ? ranks[point] : -1,
                       k,
                       frame.keypoints[k].x,
                       frame.keypoints[k].y,
                       frame.sigmas[k],
                       0};
  }
  return TV_OK;
}

tv_status tv_odometry_save_size(const tv_odometry* odometry, size_t* size_bytes) {
  if (odometry == nullptr || size_bytes == nullptr) return TV_ERR_NULL;
  *size_bytes = tv::write_map(*odometry, nullptr);
  return TV_OK;
}

tv_status tv_odometry_save(const tv_odometry* odometry, uint8_t* bytes, size_t cap_bytes,
                           size_t* num_bytes) {
  if (odometry == nullptr || num_bytes == nullptr || (bytes == nullptr && cap_bytes > 0)) {
    return TV_ERR_NULL;
  }
  if (tv::overlap(bytes, cap_bytes, num_bytes, sizeof *num_bytes)) return TV_ERR_OVERLAP;
  *num_bytes = tv::write_map(*odometry, nullptr);
  if (*num_bytes > cap_bytes) return TV_ERR_CAPACITY;
  tv::write_map(*odometry, bytes);
  return TV_OK;
}

tv_status tv_odometry_load(tv_odometry* odometry, const uint8_t* bytes, size_t num_bytes) {
  if (odometry == nullptr || bytes == nullptr) return TV_ERR_NULL;
  return tv::read_map(bytes, num_bytes, true, odometry);
}

tv_status tv_odometry_add(tv_odometry* odometry, const uint8_t* bytes, size_t num_bytes,
                          int32_t* num_joined) {
  if (odometry == nullptr || bytes == nullptr || num_joined == nullptr) return TV_ERR_NULL;
  if (tv::overlap(num_joined, sizeof *num_joined, bytes, num_bytes)) return TV_ERR_OVERLAP;
  const int32_t num_keyframes = odometry->map.num_keyframes;
  const tv_status status = tv::read_map(bytes, num_bytes, false, odometry);
  if (status != TV_OK) return status;
  tv::finish_work(odometry);
  *num_joined = tv::join_segments(odometry, num_keyframes);
  return TV_OK;
}

tv_status tv_odometry_set_clock(tv_odometry* odometry, tv_clock now_ns, void* user) {
  if (odometry == nullptr) return TV_ERR_NULL;
  return tv_context_set_clock(odometry->context, now_ns, user);
}

tv_status tv_odometry_take_times(tv_odometry* odometry, uint64_t* stage_ns, int32_t cap_stages) {
  if (odometry == nullptr) return TV_ERR_NULL;
  return tv_context_take_times(odometry->context, stage_ns, cap_stages);
}
