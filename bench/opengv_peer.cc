#include "opengv_peer.h"

#include <cmath>
#include <numeric>
#include <opengv/relative_pose/CentralRelativeAdapter.hpp>
#include <opengv/relative_pose/methods.hpp>
#include <opengv/sac/Ransac.hpp>
#include <opengv/sac_problems/relative_pose/CentralRelativePoseSacProblem.hpp>
#include <opengv/triangulation/methods.hpp>

namespace bench {
namespace {

using Problem = opengv::sac_problems::relative_pose::CentralRelativePoseSacProblem;

opengv::bearingVectors_t bearings(const std::vector<double>& rays) {
  opengv::bearingVectors_t vectors;
  for (size_t k = 0; k + 2 < rays.size(); k += 3) {
    vectors.emplace_back(rays[k], rays[k + 1], rays[k + 2]);
  }
  return vectors;
}

template <typename Matrices>
void append(const Matrices& matrices, std::vector<double>* out) {
  for (const auto& m : matrices) {
    for (int k = 0; k < 9; ++k) out->push_back(m(k / 3, k % 3));
  }
}

// Converts OpenGV's pose of camera 1 in camera 0, [R' | -R' t], to ours: x1 = R x0 + t, |t| = 1.
void store_pose(const opengv::transformation_t& camera1, double R[9], double t[3]) {
  const Eigen::Matrix3d rotation = camera1.leftCols<3>().transpose();
  const Eigen::Vector3d translation = -(rotation * camera1.col(3)).normalized();
  for (int k = 0; k < 9; ++k) R[k] = rotation(k / 3, k % 3);
  for (int k = 0; k < 3; ++k) t[k] = translation[k];
}

}  // namespace

struct OpengvMatches::Data {
  opengv::bearingVectors_t bearings0, bearings1;
  opengv::relative_pose::CentralRelativeAdapter adapter{bearings0, bearings1};
};

OpengvMatches::OpengvMatches(const std::vector<double>& rays0, const std::vector<double>& rays1)
    : data_(new Data{bearings(rays0), bearings(rays1)}) {}

OpengvMatches::~OpengvMatches() = default;

void OpengvMatches::set_pose(const double R[9], const double t[3]) {
  Eigen::Matrix3d rotation;
  for (int k = 0; k < 9; ++k) rotation(k / 3, k % 3) = R[k];
  data_->adapter.setR12(rotation.transpose());
  data_->adapter.sett12(-rotation.transpose() * Eigen::Vector3d(t[0], t[1], t[2]));
}

void OpengvMatches::solve_five_point(OpengvSolver solver, int first,
                                     std::vector<double>* solutions) const {
  std::vector<int> five(5);
  std::iota(five.begin(), five.end(), first);
  switch (solver) {
    case OpengvSolver::kNister:
      return append(opengv::relative_pose::fivept_nister(data_->adapter, five), solutions);
    case OpengvSolver::kKneip:
      return append(opengv::relative_pose::fivept_kneip(data_->adapter, five), solutions);
    case OpengvSolver::kStewenius: {
      std::vector<Eigen::Matrix3d> real;
      for (const auto& m : opengv::relative_pose::fivept_stewenius(data_->adapter, five)) {
        if (m.imag().cwiseAbs().maxCoeff() < 1e-6) real.push_back(m.real());
      }
      return append(real, solutions);
    }
  }
}

bool OpengvMatches::estimate(double max_error_rad, double confidence, int max_iterations,
                             bool refine, double R[9], double t[3]) {
  opengv::sac::Ransac<Problem> ransac;
  ransac.sac_model_ = std::make_shared<Problem>(data_->adapter, Problem::NISTER, false);
  // OpenGV's residual is the sum of 1 - cos(angular error) over both views, as in its own programs.
  ransac.threshold_ = 2 * (1 - std::cos(max_error_rad));
  ransac.probability_ = confidence;
  ransac.max_iterations_ = max_iterations;
  if (!ransac.computeModel()) return false;
  opengv::transformation_t pose = ransac.model_coefficients_;
  if (refine) {
    data_->adapter.sett12(pose.col(3));
    data_->adapter.setR12(pose.leftCols<3>());
    pose = opengv::relative_pose::optimize_nonlinear(data_->adapter, ransac.inliers_);
  }
  store_pose(pose, R, t);
  return true;
}

void OpengvMatches::triangulate(OpengvTriangulation method, double* points) const {
  const size_t count = data_->bearings0.size();
  for (size_t k = 0; k < count; ++k) {
    const opengv::point_t point = method == OpengvTriangulation::kLinear
                                      ? opengv::triangulation::triangulate(data_->adapter, k)
                                      : opengv::triangulation::triangulate2(data_->adapter, k);
    for (int i = 0; i < 3; ++i) points[3 * k + static_cast<size_t>(i)] = point[i];
  }
}

}  // namespace bench
