// The lines of a room's plan: its upright surfaces from above.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "room_model/scene.h"

namespace cli {

struct PlanLine {
  cv::Point2d a, b;            // in room axes; from a to b the free side is to the right
  double low = 0, high = 0;    // the heights between which it was measured or inferred
  double sigma = 0;            // of where it lies across its direction
  bool is_wall = false;        // of the room; else a cupboard, a door that stands open, a screen
  bool is_carried = false;     // hidden: between two parts of a wall, or from one to a corner
  cv::Point2d along() const;   // of length 1
  cv::Point2d normal() const;  // towards the free side, of length 1
};

// Needs the model's axes and free cells.
std::vector<PlanLine> plan_lines(const RoomModel& model);

}  // namespace cli
