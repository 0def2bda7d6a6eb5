#include "odometry/work.h"

#include "odometry/adjust.h"
#include "odometry/keyframe.h"
#include "odometry/loop_closure.h"
#include "odometry/metric.h"
#include "odometry/spread.h"

namespace tv {
namespace {

constexpr int32_t kWindowSteps = 4;  // of the adjustment after a keyframe
constexpr int32_t kLoopSteps = 8;    // and after a loop

// Makes the keyframe's other points, and adjusts it with its surroundings. `frame` became it.
void finish_keyframe(Odometry* odometry, int32_t keyframe, Frame* frame) {
  make_points(odometry, keyframe, *frame, false);
  const Rigid before = odometry->map.keyframes[keyframe].cam_from_world;
  const bool closed_loop = odometry->unfinished.closed_loop;
  adjust_around(odometry, keyframe, closed_loop ? kLoopSteps : kWindowSteps);
  odometry->was_moved_far = is_jump(odometry, before, keyframe);
  odometry->keyframe_inliers = odometry->map.keyframes[keyframe].num_observations;
  list_local_points(odometry, keyframe);
  take_keyframe(*odometry, keyframe, frame);
  if (closed_loop) measure_depth(odometry, *frame);
  // Not between keyframes of two maps, where one was added meanwhile.
  if (keyframe == odometry->map.num_keyframes - 1) measure_scale(odometry, frame);
}

}  // namespace

Work next_work(const Odometry& odometry) {
  if (find_keyframe(odometry.map, odometry.unfinished.id) >= 0) return Work::kFinishKeyframe;
  return is_spreading(odometry) ? Work::kStepSpread : Work::kNone;
}

Work do_next_work(Odometry* odometry, Frame* frame) {
  const Work work = next_work(*odometry);
  if (work == Work::kFinishKeyframe) {
    finish_keyframe(odometry, find_keyframe(odometry->map, odometry->unfinished.id), frame);
  } else if (work == Work::kStepSpread) {
    step_spread(odometry, frame);
  }
  odometry->unfinished.id = -1;
  return work;
}

void finish_work(Odometry* odometry) {
  while (do_next_work(odometry, &odometry->frame) != Work::kNone) continue;
}

}  // namespace tv
