// Simulated matches of two views, as twoview_tools.accuracy.robust500 draws them, and errors of
// poses.
//
// Two 640x480 pinhole views (f 500). The rotation turns by 1 to 12 degrees about any axis, the
// baseline has any direction; true matches lie 2 to 8 baselines deep, wrong ones pair two points
// spread evenly.
#pragma once

#include <cmath>
#include <cstdint>
#include <vector>

#include "twoview/twoview.h"

namespace bench {

struct Problem {
  tv_camera camera;
  double R[9], t[3];
  std::vector<double> pixels[2];  // x, y; true and wrong matches mixed

  int size() const { return static_cast<int>(pixels[0].size() / 2); }
  std::vector<double> unit_rays(int view) const;
};

// The first num_true of the matches are true before they are mixed. Depends on the arguments alone.
Problem make_problem(uint64_t seed, int num, int num_true, double noise_px);

// The larger of the angle between the rotations and that between the directions of translation.
double pose_error_deg(const double R[9], const double t[3], const double true_R[9],
                      const double true_t[3]);

// 0 for none.
double median(std::vector<double> values);

}  // namespace bench
