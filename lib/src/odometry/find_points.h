// Which keypoints of a frame see which points of the map, by where the points must appear.
#pragma once

#include "odometry/odometry.h"

namespace tv {

struct PointSearch {
  const int32_t* points;
  int32_t num;
  const Rigid& cam_from_world;
  double radius_px;  // for a point whose place is known exactly
  bool counts;       // the points as visible; not where the map must stay as it is
};

// Sorts the keypoints of a frame into the cells of its grid.
void make_grid(const Odometry& odometry, Frame* frame);

// Finds the keypoints that see the points, and returns how many see one then. A keypoint that sees
// one already gives it up for one whose descriptor is nearer.
int32_t find_points(Odometry* odometry, const PointSearch& search, Frame* frame);

// The nearest descriptors among all points of a list, without regard to place.
int32_t match_points(Odometry* odometry, const int32_t* points, int32_t num, double ratio,
                     Frame* frame);

void forget_points(Frame* frame);

// The standard deviation, in pixels, of a point's projection that the error of its depth causes,
// for a camera whose centre is at `centre`; x is the point in that camera's frame.
double depth_error_px(const Odometry& odometry, const MapPoint& point, const double centre[3],
                      const double x[3]);

}  // namespace tv
