// The pose of a calibrated camera from three points in space and their rays, after Y. Ding, J.
// Yang, V. Larsson, C. Olsson, K. Astrom, "Revisiting the P3P problem", CVPR 2023: the depths are
// where two conics meet; a degenerate conic of their pencil, found as one root of a cubic, is a
// pair of lines, and each line meets a conic in at most two points.
// docs/algorithms/absolute_pose.md. Tests: test/unit/test_absolute_pose_3pt.cc.
#pragma once

#include "geometry/essential.h"

namespace tv {

inline constexpr int kMaxAbsolutePose3pt = 4;

// Writes the poses R, t with R point + t = depth ray, depth > 0, for three unit rays; t has the
// unit of the points. Returns how many there are: 0 where the points lie on a line, where two of
// them or two rays are equal, or where the input is not finite.
int absolute_pose_3pt(const double rays[3][3], const double points[3][3],
                      Pose poses[kMaxAbsolutePose3pt]);

}  // namespace tv
