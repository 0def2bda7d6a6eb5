// The lens of a film's camera from the map that was made of it: bundle adjustment of keyframes and
// points together with the lens, and with the time that the picture's rows take.
// docs/algorithms/focal_length.md.
#pragma once

#include <array>
#include <vector>

#include "odometry/flight.h"
#include "pair/simple_lens.h"

namespace cli {

struct LensEstimate {
  SimpleLens lens;
  double focal_variance = 0;  // of the log of the focal length
  bool is_known = false;      // false: the keyframes are too few, and `lens` is the start
};

// A keyframe and how a point at rest turns and moves in its camera's frame from one frame to the
// next, in radians and in the map's unit; zeros: unknown.
struct LensKeyframe {
  const FlightKeyframe* key = nullptr;
  std::array<double, 3> turn{}, move{};
};

// The keyframes with how they moved from the frame before them to the frame after, as both were
// tracked: what a rolling shutter makes of it is a part of the adjustment.
std::vector<LensKeyframe> in_motion(const std::vector<FlightKeyframe>& keyframes,
                                    const Flight& flight);

// Adjusts the lens in windows of successive keyframes of a segment, each with poses and points of
// its own. The keyframes are of pictures of this size, and were tracked with the lens `start`.
LensEstimate adjust_lens(const std::vector<LensKeyframe>& keyframes,
                         const std::vector<tv_map_point>& points, int width, int height,
                         const SimpleLens& start);

// What a map says of the camera that it was made with: of its focal length, of its principal point,
// and of how its lens bends the picture four fifths of the way from the middle to a corner.
struct CameraEvidence {
  bool is_known = false;    // false: the keyframes are too few
  double focal_change = 0;  // that of the camera that fits the map, over the given one, less 1
  double focal_sigma = 0;   // its standard deviation
  // The relative change, with its standard deviation, of the distance from the middle of the
  // picture at which a ray is seen, four fifths of the way to a corner, from the given camera to
  // the one that fits.
  double edge_change = 0, edge_sigma = 0;
  // How far the principal point of the camera that fits the map lies from the given one, x and y in
  // pixels, and the standard deviations. A wrong ratio of fx and fy shows here, too.
  std::array<double, 2> centre_shift_px{}, centre_sigma_px{};
  double focal_px = 1;  // of the given camera

  bool contradicts_focal() const;
  bool contradicts_lens() const;
  bool contradicts_centre() const;
  bool contradicts() const {
    return contradicts_focal() || contradicts_lens() || contradicts_centre();
  }
};

// Adjusts the camera, of any model, as adjust_lens does: in six windows and with few points of
// each, and with all where these are evidence against the camera.
CameraEvidence evidence_on_camera(const std::vector<LensKeyframe>& keyframes,
                                  const std::vector<tv_map_point>& points, const tv_camera& camera);

}  // namespace cli
