#include "odometry/accuracy.h"

#include <algorithm>
#include <cmath>
#include <opencv2/core.hpp>

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;

Vector3 moved(const Similarity& s, const Vector3& x) {
  Vector3 y = applied(s.R, x);
  for (size_t k = 0; k < 3; ++k) y[k] = s.scale * y[k] + s.t[k];
  return y;
}

Vector3 mean_of(const std::vector<Vector3>& points) {
  Vector3 mean{0, 0, 0};
  for (const Vector3& p : points)
    for (size_t k = 0; k < 3; ++k) mean[k] += p[k] / static_cast<double>(points.size());
  return mean;
}

double rms(double sum_sq, size_t count) { return std::sqrt(sum_sq / static_cast<double>(count)); }

double residual_rms(const Similarity& s, const std::vector<Vector3>& from,
                    const std::vector<Vector3>& to) {
  double sum = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Vector3 d = minus(moved(s, from[i]), to[i]);
    sum += dot(d, d);
  }
  return rms(sum, from.size());
}

// The pose of b in the frame of a.
Pose relative(const Pose& a, const Pose& b) { return composed(inverse(a), b); }

}  // namespace

std::vector<Association> associated(const Trajectory& estimate, const Trajectory& truth,
                                    double max_difference_s) {
  const bool estimate_is_shorter = truth.size() > estimate.size();
  const Trajectory& few = estimate_is_shorter ? estimate : truth;
  const Trajectory& many = estimate_is_shorter ? truth : estimate;
  std::vector<Association> pairs;
  for (size_t i = 0; i < few.size(); ++i) {
    const double time = few[i].time_s;
    const auto after =
        std::lower_bound(many.begin(), many.end(), time,
                         [](const TimedPose& pose, double t) { return pose.time_s < t; });
    size_t best = static_cast<size_t>(after - many.begin());
    // On a tie the earlier pose, as numpy's argmin.
    if (best == many.size() ||
        (best > 0 && std::abs(many[best - 1].time_s - time) <= std::abs(many[best].time_s - time)))
      --best;
    if (!(std::abs(many[best].time_s - time) <= max_difference_s)) continue;
    pairs.push_back(estimate_is_shorter ? Association{i, best} : Association{best, i});
  }
  return pairs;
}

Similarity fitted(const std::vector<Vector3>& from, const std::vector<Vector3>& to,
                  bool with_scale) {
  const Vector3 mean_from = mean_of(from), mean_to = mean_of(to);
  const double n = static_cast<double>(from.size());
  cv::Matx33d covariance = cv::Matx33d::zeros();
  double variance = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    const Vector3 x = minus(from[i], mean_from), y = minus(to[i], mean_to);
    variance += dot(x, x) / n;
    for (int r = 0; r < 3; ++r)
      for (int c = 0; c < 3; ++c)
        covariance(r, c) += y[static_cast<size_t>(r)] * x[static_cast<size_t>(c)] / n;
  }
  cv::Matx31d w;
  cv::Matx33d u, vt;
  cv::SVD::compute(covariance, w, u, vt);
  const double sign = cv::determinant(u) * cv::determinant(vt) < 0 ? -1 : 1;
  const cv::Matx33d s = cv::Matx33d::diag(cv::Vec3d(1, 1, sign));
  const cv::Matx33d R = u * s * vt;
  Similarity fit;
  std::copy(R.val, R.val + 9, fit.R.begin());
  if (with_scale && variance > 0) fit.scale = (w(0) + w(1) + sign * w(2)) / variance;
  const Vector3 turned = applied(fit.R, mean_from);
  for (size_t k = 0; k < 3; ++k) fit.t[k] = mean_to[k] - fit.scale * turned[k];
  return fit;
}

Accuracy accuracy_of(const Trajectory& estimate, const Trajectory& truth) {
  Accuracy a;
  if (estimate.empty() || truth.empty()) return a;
  a.pairs = associated(estimate, truth);
  a.num_poses = a.pairs.size();
  if (a.num_poses < 3) return a;
  std::vector<Vector3> from, to;
  for (const Association& pair : a.pairs) {
    from.push_back(estimate[pair.idx_estimate].pose.t);
    to.push_back(truth[pair.idx_truth].pose.t);
  }
  a.similarity = fitted(from, to, true);
  a.ate_rmse = residual_rms(a.similarity, from, to);
  a.ate_rigid_rmse = residual_rms(fitted(from, to, false), from, to);
  double turn = 0, way = 0;
  for (size_t i = 0; i < from.size(); ++i) {
    a.errors.push_back(norm(minus(moved(a.similarity, from[i]), to[i])));
    if (i == 0) continue;
    a.path_length += norm(minus(to[i], to[i - 1]));
    Pose e = relative(estimate[a.pairs[i - 1].idx_estimate].pose,
                      estimate[a.pairs[i].idx_estimate].pose);
    for (double& value : e.t) value *= a.similarity.scale;
    const Pose q = relative(truth[a.pairs[i - 1].idx_truth].pose, truth[a.pairs[i].idx_truth].pose);
    const Pose error = relative(q, e);
    const double angle = kDegrees * angle_of(error.R);
    turn += angle * angle;
    way += dot(error.t, error.t);
  }
  a.rpe_rotation_deg = rms(turn, from.size() - 1);
  a.rpe_translation_rmse = rms(way, from.size() - 1);
  return a;
}

}  // namespace cli
