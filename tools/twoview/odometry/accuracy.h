// The comparison of a trajectory with the truth: the absolute trajectory error (ATE) after the
// least-squares similarity (Umeyama, IEEE PAMI 13(4), 1991) and the relative pose error (RPE) from
// one frame to the next (Sturm et al., IROS 2012). The figures are those of the program evo.
#pragma once

#include <string>
#include <vector>

#include "odometry/poses.h"

namespace cli {

// Which pose of the estimate belongs to which of the truth.
struct Association {
  size_t idx_estimate, idx_truth;
};

// evo's rule: for each pose of the shorter trajectory the one of the other that is nearest in time,
// if it is at most max_difference_s away.
std::vector<Association> associated(const Trajectory& estimate, const Trajectory& truth,
                                    double max_difference_s = 0.01);

// y = scale R x + t, the least-squares fit from the positions of the estimate to those of the
// truth.
struct Similarity {
  double scale = 1;
  Matrix3 R{1, 0, 0, 0, 1, 0, 0, 0, 1};
  Vector3 t{0, 0, 0};
};
Similarity fitted(const std::vector<Vector3>& from, const std::vector<Vector3>& to,
                  bool with_scale);

struct Accuracy {
  // Whether there are errors: a truth that stays in one place has no size to fit a similarity to.
  bool has_errors() const { return num_poses >= 3 && path_length > 0; }
  size_t num_poses = 0;             // associated ones; below 3 nothing else is filled
  double ate_rmse = 0;              // in the truth's unit, after the similarity
  double ate_rigid_rmse = 0;        // after the best rigid motion, without a scale
  double path_length = 0;           // of the truth, over the associated poses
  double rpe_rotation_deg = 0;      // rms over consecutive associated poses
  double rpe_translation_rmse = 0;  // the same of the translation, in the truth's unit
  Similarity similarity;
  std::vector<double> errors;  // of each associated pose, after the similarity
  std::vector<Association> pairs;
};
Accuracy accuracy_of(const Trajectory& estimate, const Trajectory& truth);

}  // namespace cli
