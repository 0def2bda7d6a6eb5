// Points that views with known poses see, for scenes that come without a map.
#pragma once

#include <vector>

#include "files/image_file.h"
#include "pair/session.h"
#include "room_model/scene.h"

namespace cli {

// Matches the corners of some views, and triangulates them with the poses.
class PosedPoints {
 public:
  explicit PosedPoints(const RoomScene& scene);
  // Whether the view is one of those that are matched: at most 60, spread evenly.
  bool wants(size_t view) const { return view % step_ == 0; }
  // The picture of such a view, of the size of the scene's camera; in the order of the views.
  void add(size_t view, const cv::Mat& luma, const cv::Mat& mask);
  // The points, in the world.
  const std::vector<Vector3>& points() const { return points_; }

 private:
  struct Seen {
    size_t view;
    Features features;
  };
  void triangulate(const Seen& first, const Seen& second);

  const RoomScene& scene_;
  Options options_;
  Session session_;
  size_t step_;
  std::vector<Seen> seen_;
  std::vector<Vector3> points_;
};

}  // namespace cli
