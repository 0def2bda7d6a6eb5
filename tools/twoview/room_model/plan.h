// The room from above: walls as lines, the floor with its area, a scale bar. The floor is what was
// looked across, and what lies between walls: a cell from which in three of the four directions
// along the room's axes a wall is met.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

#include "room_model/plan_lines.h"
#include "room_model/scene.h"

namespace cli {

// What was looked across, from above: each ray from a camera to a surface of the model is free.
class FreeArea {
 public:
  // For a model whose axes and vertices are known.
  explicit FreeArea(const RoomModel& model);
  // A ray in the world from a camera's centre to what it shows. It counts where the model has a
  // surface near its end.
  void add_ray(const Vector3& centre, const Vector3& hit);
  // 255 where at least three rays pass, and the small gaps between.
  cv::Mat cells() const;

  double cell() const { return cell_; }           // its side, in the unit of the poses
  cv::Point2d origin() const { return origin_; }  // the corner of the first cell, in room axes

 private:
  int64_t key_of(const Vector3& point) const;

  const Matrix3 axes_;
  double cell_ = 1, near_ = 1;
  cv::Point2d origin_;
  cv::Mat counts_;
  std::vector<int64_t> surface_;  // sorted keys of where the model has a surface
};

struct RoomPlan {
  std::vector<PlanLine> lines;                  // of upright planes
  std::vector<std::vector<cv::Point2d>> floor;  // its outlines
  std::vector<cv::Rect2d> upright;              // covers surfaces that stand upright
  std::vector<cv::Point2d> path;                // of the camera
  double area = 0;                              // of the floor, squares of the unit
};
RoomPlan plan_of(const RoomScene& scene, const RoomModel& model);

// The plan as a drawing, and the same drawing as a picture.
std::string plan_svg(const RoomPlan& plan, const RoomScene& scene, const RoomModel& model);
cv::Mat plan_picture(const RoomPlan& plan, const RoomScene& scene, const RoomModel& model);

}  // namespace cli
