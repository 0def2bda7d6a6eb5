// OpenGV's counterparts of our stages, with an interface of plain doubles. They are a shared
// library: OpenGV's Eigen is compiled with vector instructions and ours without, and neither
// program part may run the other's inline functions.
//
// Each ray is a unit vector of 3 numbers. R and t follow our convention: x1 = R x0 + t.
#pragma once

#include <memory>
#include <vector>

namespace bench {

inline constexpr char kOpengvName[] = "OpenGV 1.0";

enum class OpengvSolver { kStewenius, kNister, kKneip };  // kKneip gives rotations, the others E
enum class OpengvTriangulation { kLinear, kMidpoint };    // OpenGV's triangulate and triangulate2

// The matches of a pair in OpenGV's types. The constructor copies the rays.
class [[gnu::visibility("default")]] OpengvMatches {
 public:
  OpengvMatches(const std::vector<double>& rays0, const std::vector<double>& rays1);
  ~OpengvMatches();
  void set_pose(const double R[9], const double t[3]);  // call before triangulate()

  // Solves the five consecutive matches from `first`. Appends 9 numbers for each solution.
  void solve_five_point(OpengvSolver solver, int first, std::vector<double>* solutions) const;

  // RANSAC with Nister's solver, then, if `refine` is true, OpenGV's refinement over the inliers.
  // Returns false if no pose was found.
  bool estimate(double max_error_rad, double confidence, int max_iterations, bool refine,
                double R[9], double t[3]);

  void triangulate(OpengvTriangulation method, double* points) const;

 private:
  struct Data;
  std::unique_ptr<Data> data_;
};

}  // namespace bench
