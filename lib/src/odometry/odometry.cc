#include "odometry/odometry.h"

#include <algorithm>

namespace tv {

void start_anew(tv_odometry* o) {
  o->camera = prepare_camera(o->given_camera);
  o->camera_evidence = CameraEvidence{};
  clear_map(&o->map);
  o->num_starts = o->num_local_points = 0;
  std::fill_n(o->still_cells, o->still_columns * o->still_rows, StillCell{});
  o->still_until = 0;
  o->reference_id = o->confirmed_id = -1;
  o->doubts = 0;
  o->doubtful_segment = -1;
  o->weak_loop.frame = -1;
  o->spread = {0, o->map.sizes.max_points, 0, 0, 0};
  o->unfinished = {-1, 0, false};
  o->done = Work::kNone;
  o->check = MapCheck{};
  o->has_motion = false;
  o->num_frames = o->segment = o->num_segments = o->other_segment = 0;
  o->num_relocations = o->num_loops = o->next_search = o->next_loop = 0;
  o->tracking = {TrackingState::kStarting, 0};
  o->gyro = Gyro{};
  o->gyro.bias_variance = kGyroBiasSigma * kGyroBiasSigma;
  o->frame.has_pose = o->previous.has_pose = false;
  o->frame.num = o->previous.num = 0;
  o->median_depth = 1;
  o->turn_sigma = o->drift_sq = 0;
  o->is_upright = o->is_found_again = o->was_moved_far = false;
  o->velocity_trust = o->num_contrary = 0;
  o->scale = o->other_scale = MetricScale{};
  o->last_time_s = o->most_m = 0;
}

}  // namespace tv
