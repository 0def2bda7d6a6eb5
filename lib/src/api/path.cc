// The entry points of the path: they validate, call odometry/path.h, and write the results.
#include "twoview/path.h"

#include <algorithm>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "base/math.h"
#include "odometry/path.h"

namespace tv {
namespace {

size_t bytes_of(int32_t num_frames) {
  return static_cast<size_t>(num_frames) * sizeof(tv_path_frame);
}

tv_status check_frames(const tv_path_frame* frames, int32_t num_frames) {
  if (num_frames < 0) return TV_ERR_ARGUMENT;
  if (frames == nullptr && num_frames > 0) return TV_ERR_NULL;
  return is_in_order(frames, num_frames) ? TV_OK : TV_ERR_ARGUMENT;
}

void keep_pose(const tv_odometry_state& state, int32_t origin, tv_path_frame* frame) {
  frame->origin = origin;
  frame->reference_id = state.reference_id;
  std::copy_n(state.reference_from_cam_R, 9, frame->reference_from_cam_R);
  std::copy_n(state.reference_from_cam_t, 3, frame->reference_from_cam_t);
}

// Whether the frames, which are written, share a byte with the pictures or with is_found.
bool overlaps(const tv_path_frame* frames, size_t bytes, const tv_image& image,
              const tv_image* mask, const int32_t* is_found) {
  return overlap(frames, bytes, is_found, sizeof *is_found) ||
         overlap(frames, bytes, image.data, image_bytes(image)) ||
         (mask != nullptr && mask->data != nullptr &&
          overlap(frames, bytes, mask->data, image_bytes(*mask)));
}

// The id of the keyframe whose frame is nearest by its number; -1 without any.
int32_t nearest_keyframe(const Map& map, int32_t frame) {
  int32_t id = -1, least = 0;
  for (int32_t k = 0; k < map.num_keyframes; ++k) {
    const int32_t own = map.keyframes[k].frame, between = std::max(own - frame, frame - own);
    if (id >= 0 && between >= least) continue;
    id = map.keyframes[k].id;
    least = between;
  }
  return id;
}

}  // namespace
}  // namespace tv

tv_status tv_path_record(const tv_odometry_state* state, double time_s, tv_path_frame* frame) {
  if (state == nullptr || frame == nullptr) return TV_ERR_NULL;
  tv_odometry_state known{};
  const tv_status status = tv::read_sized(state, &known);
  if (status != TV_OK) return status;
  if (!tv::is_finite(time_s)) return TV_ERR_NOT_FINITE;
  if (tv::overlap(frame, sizeof *frame, state, state->struct_size)) return TV_ERR_OVERLAP;
  *frame = tv_path_frame{};
  frame->time_s = time_s;
  frame->frame = known.num_frames - 1;
  frame->reference_id = -1;
  if (known.has_pose == 0) return TV_OK;
  const bool is_turned = known.status == TV_ODOMETRY_ROTATION;
  tv::keep_pose(known, is_turned ? TV_PATH_TURNED : TV_PATH_TRACKED, frame);
  return TV_OK;
}

tv_status tv_path_poses(const tv_odometry* odometry, const tv_path_frame* frames,
                        int32_t num_frames, tv_path_pose* poses) {
  if (odometry == nullptr || (poses == nullptr && num_frames > 0)) return TV_ERR_NULL;
  const tv_status status = tv::check_frames(frames, num_frames);
  if (status != TV_OK) return status;
  const size_t bytes = static_cast<size_t>(num_frames) * sizeof *poses;
  if (tv::overlap(poses, bytes, frames, tv::bytes_of(num_frames))) return TV_ERR_OVERLAP;
  for (int32_t n = 0; n < num_frames; ++n) poses[n] = tv::path_pose(odometry->map, frames[n]);
  return TV_OK;
}

tv_status tv_path_locate(tv_odometry* odometry, tv_path_frame* frames, int32_t num_frames,
                         int32_t idx, const tv_image* image, const tv_image* mask,
                         int32_t* is_found) {
  if (odometry == nullptr || image == nullptr || is_found == nullptr) return TV_ERR_NULL;
  tv_status status = tv::check_frames(frames, num_frames);
  if (status != TV_OK) return status;
  if (!tv::within(idx, 0, num_frames - 1)) return TV_ERR_ARGUMENT;
  const tv::Map& map = odometry->map;
  tv_odometry_state state;
  tv_odometry_state_init(&state);
  const int32_t near_id = tv::nearest_keyframe(map, frames[idx].frame);
  status = tv_odometry_locate(odometry, image, mask, near_id, &state);  // checks the pictures
  if (status != TV_OK) return status;
  if (tv::overlaps(frames, tv::bytes_of(num_frames), *image, mask, is_found)) return TV_ERR_OVERLAP;
  *is_found = 0;
  // A weak pose that nothing before or after confirms is not kept as known.
  if (state.status != TV_ODOMETRY_TRACKING) return TV_OK;
  const tv_path_pose before = tv::path_pose(map, frames[idx]);
  tv_path_frame found = frames[idx];
  tv::keep_pose(state, TV_PATH_LOCATED, &found);
  const tv_path_pose pose = tv::path_pose(map, found);
  if (before.origin != TV_PATH_UNKNOWN && pose.segment != before.segment) return TV_OK;
  if (!tv::can_have_flown(map, frames, num_frames, idx, pose)) return TV_OK;
  frames[idx] = found;
  *is_found = 1;
  return TV_OK;
}
