// How a file of true poses was meant, by the path that is compared with it: the unit of its times,
// or what they count, and the order of its quaternions.
#pragma once

#include <string>
#include <vector>

#include "odometry/poses.h"

namespace cli {

// The clocks that a truth's times may follow.
struct FrameClock {
  double film_start_s = 0;  // of the film's own clock
  // For each frame of the source that was used: its number, from 0, its time and its name.
  std::vector<int> numbers;
  std::vector<double> times_s;
  std::vector<std::string> names;
};

// Where fewer than three poses of the truth belong to poses of the estimate: takes its times as
// those of another unit (s, ms, us, ns), or as of the film's own clock, where that makes them
// belong together. Times that are whole numbers, of which fewer than half meet, are taken as the
// frames' numbers, from 0 or 1, or as the numbers in the pictures' names, where at least twice as
// many then meet. Returns a line on what was done, or on why few meet; empty where they meet as
// they are.
std::string fit_times(const Trajectory& estimate, TruePoses& truth, const FrameClock& clock);

// A line where the truth turns by the same angles as the estimate, but about other axes: its
// quaternions may be in the other order (then the line says so), or its rotations those of another
// body; and where it does not turn at all while the estimate does. Empty where the axes agree, or
// where too little turns.
std::string rotation_words(const Trajectory& estimate, const TruePoses& truth);

// Poses of a file as another program may have meant them, when they were read as world_from_cam
// with x to the right, y down and z ahead.
struct PoseReading {
  std::string words;  // what the file's poses are then, and what to do
  std::vector<Pose> poses;
};
std::vector<PoseReading> other_readings(const std::vector<Pose>& poses, TruePoses::Order order);

}  // namespace cli
