// Poses with times: quaternions, the text of a TUM trajectory, and files of true poses.
#pragma once

#include <array>
#include <optional>
#include <string>
#include <vector>

#include "base/matrix.h"

namespace cli {

// A pose world_from_cam: a point X of the camera's frame is R X + t in the world.
struct Pose {
  Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 t{0, 0, 0};
};
struct TimedPose {
  double time_s = 0;
  Pose pose;
};
using Trajectory = std::vector<TimedPose>;  // sorted by time

Pose composed(const Pose& a_from_b, const Pose& b_from_c);
Pose inverse(const Pose& pose);

// The quaternion x y z w of a rotation, with w >= 0; and the rotation of any quaternion but 0.
std::array<double, 4> quaternion_of(const Matrix3& R);
Matrix3 rotation_of_quaternion(double x, double y, double z, double w);

// Throws BadInput that names the line where four numbers of a file are no unit quaternion: a length
// of 0, or more than a tenth off 1.
void require_unit_quaternion(const double* q, const std::string& file, int line);

// The angle of a rotation in radians, in [0, pi].
double angle_of(const Matrix3& R);

// A line of a TUM trajectory: timestamp tx ty tz qx qy qz qw.
std::string tum_line(double time_s, const Pose& pose);

// True poses, and how their times were read.
struct TruePoses {
  Trajectory poses;
  double unit_s = 1;  // of the file's times, in seconds; 0: the file has no times (KITTI)
  // The order of the quaternions' numbers. kKnown: the file names its columns; else the order is
  // assumed, and may be the other one.
  enum class Order { kKnown, kScalarLast, kScalarFirst } order = Order::kKnown;
  std::vector<std::string> notes;  // on what was left out, or is odd
};

// Reads true poses: TUM's lines; EuRoC's data.csv (nanoseconds, position, quaternion w x y z, more
// columns); the same with a line of names before them, by which the columns are chosen; or KITTI's
// lines of 12 numbers (16 with the row 0 0 0 1), which have no times and belong to `frame_times`
// one by one. A comment above the first pose that names each column counts, too. Blanks, commas and
// semicolons separate. Eight numbers with commas and no names are EuRoC's where the times are whole
// numbers, else TUM's. body_from_camera: of EuRoC's poses, which are the vehicle's; empty: taken as
// the camera's. Poses of a motion capture that lost its body, which are exactly 0 and far from
// those beside them, are left out. Throws BadInput that names the line.
TruePoses load_trajectory(const std::string& file, const std::vector<double>& frame_times,
                          const std::optional<std::array<double, 12>>& body_from_camera);

}  // namespace cli
