// Simulated matches of two views, drawn as in twoview_tools.accuracy.robust500, and the pose error.
//
// Two 640x480 pinhole views (f 500). The rotation turns by 1 to 12 degrees about any axis, the
// baseline has any direction. The points of true matches have depths of 2 to 8 baselines; a wrong
// match pairs two independent pixels, uniform over the images.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "twoview/twoview.h"

namespace bench {

struct Problem {
  tv_camera camera;
  double R[9], t[3];
  std::vector<double> pixels[2];  // x y of each match; true and wrong matches are mixed

  int size() const { return static_cast<int>(pixels[0].size() / 2); }
  std::vector<double> unit_rays(int view) const;
};

// Makes `num` matches, of which `num_true` are true, in random order. Equal arguments give equal
// problems.
Problem make_problem(uint64_t seed, int num, int num_true, double noise_px);

// The pose error in degrees: the larger of the angle between the rotations and the angle between
// the directions of translation.
double pose_error_deg(const double R[9], const double t[3], const double true_R[9],
                      const double true_t[3]);

// The median; 0 for an empty list.
double median(std::vector<double> values);

}  // namespace bench
