// Which other views a keyframe is compared with for its depth map.
#pragma once

#include <vector>

#include "room_model/scene.h"

namespace cli {

// The range of depth that is searched for a keyframe, and the depth that is most common.
struct DepthRange {
  double near = 0, median = 0, far = 0;  // along the optical axis; near 0: not known
  bool is_known() const { return near > 0; }
};

// The range by the scene's points that the view shows; not known where these are fewer than twenty.
DepthRange depth_range(const RoomScene& scene, const RoomView& view);

// Whether a view may be a partner of views near another one, which may then be one beside it: by a
// step of 2 % of the median depth, what is nearer being no partner, or a turn of 2 degrees.
// median_depth 0: not known, which every view passes.
bool is_elsewhere(const RoomView& last, const RoomView& view, double median_depth);

// Whether a view sees something new beside another one: by a step of an eighth of the median depth
// or a turn of 12 degrees.
bool is_new_beside(const RoomView& last, const RoomView& view, double median_depth);

// The keyframes that get a depth map: those that see something new beside the one chosen before.
// median_depth 0: all.
std::vector<size_t> choose_keyframes(const RoomScene& scene, double median_depth);

// The indices of up to four views of the scene that show what view `key` shows, from places a tenth
// and a fifth of the median depth away, to both sides of it. Empty where there are none.
std::vector<size_t> choose_partners(const RoomScene& scene, size_t key, double median_depth);

}  // namespace cli
