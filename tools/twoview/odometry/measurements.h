// What a vehicle measured beside its pictures, as the file imu.txt of a set folder has it
// (docs/formats.md): attitudes, heights, velocities and rates of turn with their standard
// deviations.
#pragma once

#include <string>
#include <vector>

#include "odometry/frames.h"
#include "odometry/poses.h"

namespace cli {

class Measurements {
 public:
  // Reads the file. Throws BadInput that names the line. A height or a velocity that no drone has
  // (above 3000 m, 150 m/s) is none that was measured. Where most of the heights, or most of the
  // velocities, are such ones, the file is not in metres, and neither counts.
  static Measurements read(const std::string& file);

  // Adds what was measured at the frame's time, in the camera's terms, between the two samples
  // around it. A quantity that one of the two does not have, or two samples more than 0.25 s apart,
  // add nothing.
  void add_to(SourceFrame& frame) const;

  // Adds the turn since the frame before, of the time before_s, where the gyro's samples reach from
  // one to the other.
  void add_turn(double before_s, SourceFrame& frame) const;

  // What is to be said of the file, for frames of these times (rising); empty where nothing is.
  std::string note(const std::vector<double>& frame_times_s) const;

 private:
  struct Sample {
    double time_s = 0;
    // A standard deviation of 0: not measured.
    std::array<double, 4> world_from_body{};  // quaternion x y z w
    double attitude_sigma_rad = 0;
    double height_m = 0, height_sigma_m = 0;
    Vector3 velocity_m_s{};  // along the axes of the body
    double velocity_sigma_m_s = 0;
  };
  // The samples before and behind a time, both the same one where it is at that time; null where
  // one is missing, or where they are too far apart.
  std::array<const Sample*, 2> around(double time_s) const;
  std::string note_on_clock(const std::vector<double>& frame_times_s) const;
  std::string note_on_units() const;
  Sample sample_of(const std::vector<double>& numbers, const std::string& where);
  void add_gyro(const std::vector<double>& numbers, const std::string& where);
  bool are_metres() const;

  Matrix3 body_from_camera_{};
  std::vector<Sample> samples_;       // sorted by time
  std::vector<tv_gyro_sample> gyro_;  // on the camera's axes, sorted by time
  double gyro_sigma_rad_s_ = 0;       // the largest one that was given
  std::string file_;
  // Of a quantity, how many were measured, and how many of these no drone has.
  struct Count {
    int measured = 0, impossible = 0;
  };
  Count heights_, velocities_;
};

}  // namespace cli
