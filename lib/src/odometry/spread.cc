#include "odometry/spread.h"

#include "odometry/adjust_segment.h"

namespace tv {
namespace {

constexpr int32_t kPointSteps = 3;  // of the adjustment of some points alone

}  // namespace

void begin_spread(Odometry* odometry, int32_t segment, int32_t first_id) {
  const Map& map = odometry->map;
  odometry->spread = {kSpreadSteps, 0, segment, first_id, map.keyframes[map.num_keyframes - 1].id};
}

bool is_spreading(const Odometry& odometry) {
  return odometry.spread.num_steps > 0 || odometry.spread.next_place < odometry.map.end_points;
}

void step_spread(Odometry* odometry, Frame* frame) {
  Spread* spread = &odometry->spread;
  if (spread->num_steps == 0) {
    spread->next_place = adjust_points(odometry, spread->segment, spread->next_place, kPointSteps);
    return;
  }
  --spread->num_steps;
  const int32_t k = find_keyframe(odometry->map, odometry->reference_id);
  if (k < 0) return;
  const MapKeyframe& reference = odometry->map.keyframes[k];
  const Rigid before = reference.cam_from_world;
  const Rigid relative = compose(frame->cam_from_world, inverse(before));
  if (!adjust_segment(odometry, spread->segment, spread->first_id, 1)) spread->num_steps = 0;
  frame->cam_from_world = compose(relative, reference.cam_from_world);
  // The place from which the next way is measured, for the comparison with the velocities, moves
  // with the map.
  double from[3];
  transform(before, odometry->travel.from, from);
  transform(inverse(reference.cam_from_world), from, odometry->travel.from);
}

}  // namespace tv
