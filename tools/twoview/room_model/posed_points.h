// Points that views with known poses see, for scenes that come without a map.
#pragma once

#include <optional>
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

  // Of the matches that nearby ones of these views confirm by themselves, without the poses: the
  // share that lie where poses of the scene's views (rotations and places, world_from_cam) put
  // them, to a tenth of their motion from picture to picture, and in front of both. Empty where
  // fewer than three pairs of pictures tell.
  std::optional<double> share_that_fits(const std::vector<Matrix3>& R,
                                        const std::vector<Vector3>& t) const;

  // By how many pixels such poses, and a camera whose focal length is `focal` times the scene's,
  // miss these matches in the median (the triangulated points' errors). Empty as above.
  std::optional<double> median_error_px(const std::vector<Matrix3>& R,
                                        const std::vector<Vector3>& t, double focal) const;

 private:
  struct Seen {
    size_t view;
    Features features;
  };
  // Matches of two views, by the views' pixels.
  struct Pairs {
    size_t views[2];
    std::vector<double> pixels[2];
    size_t size() const { return pixels[0].size() / 2; }
  };
  Pairs matched(const Seen& first, const Seen& second);
  std::vector<tv_point> points_of(const tv_camera& camera, const Pairs& pairs, const Matrix3 R[2],
                                  const Vector3 t[2]) const;
  void triangulate(const Pairs& pairs);
  void confirm(const Pairs& pairs);

  const RoomScene& scene_;
  Options options_;
  Session session_;
  size_t step_;
  std::vector<Seen> seen_;
  std::vector<Vector3> points_;
  std::vector<Pairs> confirmed_;
};

}  // namespace cli
