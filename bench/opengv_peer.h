// OpenGV's part of the work, behind plain doubles: a shared library of its own, for OpenGV's Eigen
// is compiled with vectors and ours without, and neither may run the other's inline functions.
//
// Rays are unit, 3 numbers each; R and t are ours (x1 = R x0 + t).
#pragma once

#include <memory>
#include <vector>

namespace bench {

inline constexpr char kOpengvName[] = "OpenGV 1.0";

enum class OpengvSolver { kStewenius, kNister, kKneip };  // kKneip: rotations, not matrices
enum class OpengvTriangulation { kLinear, kMidpoint };    // triangulate, triangulate2

// Matches, copied once.
class [[gnu::visibility("default")]] OpengvMatches {
 public:
  OpengvMatches(const std::vector<double>& rays0, const std::vector<double>& rays1);
  ~OpengvMatches();
  void set_pose(const double R[9], const double t[3]);  // for triangulate

  // Of five consecutive matches from `first`: 9 numbers a solution, appended.
  void solve_five_point(OpengvSolver solver, int first, std::vector<double>* solutions) const;

  // RANSAC with Nister's solver, then OpenGV's refinement on the inliers where `refine` is set.
  // false: no pose.
  bool estimate(double max_error_rad, double confidence, int max_iterations, bool refine,
                double R[9], double t[3]);

  void triangulate(OpengvTriangulation method, double* points) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace bench
