#include "pose/reprojection.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

#include "robust/gravity.h"
#include "robust/ldlt.h"

namespace tv {
namespace {

constexpr double kInfinity = __builtin_inf();

// Two doubles; each operation is the IEEE operation on both.
typedef double Doubles __attribute__((vector_size(16)));

// The error of a match and its derivatives by the point p = R X + t of the camera's frame.
struct ErrorRows {
  double error[2], rows[2][3];
};

bool error_rows(const PoseProblem& problem, int i, const double p[3], ErrorRows* out) {
  const Sightings& s = problem.sightings;
  const Sighting& sighting = s.all[i];
  if (problem.exact != nullptr) {
    const SightingInput& in = *problem.exact;
    Vec2 pixel;
    Mat23 slope;
    if (!project(in.camera, Vec3(p[0], p[1], p[2]), &pixel, &slope)) return false;
    const int32_t of_caller = s.order[i];
    const double inverse = 1 / in.sigma(of_caller);
    for (int r = 0; r < 2; ++r) {
      out->error[r] = (pixel[r] - in.pixels[2 * of_caller + r]) * inverse;
      for (int c = 0; c < 3; ++c) out->rows[r][c] = slope(r, c) * inverse;
    }
    return true;
  }
  const double depth = dot(sighting.axis, p);
  if (!(depth > 0)) return false;
  const double inverse = 1 / depth;
  for (int r = 0; r < 2; ++r) {
    out->error[r] = dot(sighting.rows[r], p) * inverse;
    for (int c = 0; c < 3; ++c) {
      out->rows[r][c] = (sighting.rows[r][c] - out->error[r] * sighting.axis[c]) * inverse;
    }
  }
  return true;
}

}  // namespace

int64_t reprojection_cost(const Sightings& s, const Pose& pose, double threshold_px,
                          int64_t bound) {
  float m[12];
  for (int k = 0; k < 9; ++k) m[k] = static_cast<float>(pose.R.data()[k]);
  for (int k = 0; k < 3; ++k) m[9 + k] = static_cast<float>(pose.t[k]);
  const double inverse = 1 / (threshold_px * threshold_px);
  const float inverse_sq = static_cast<float>(std::min(inverse, 1e30));
  const int padded = (s.num + kSightingBlock - 1) / kSightingBlock * kSightingBlock;
  // The padding, whose axes are zero, costs as much as wrong matches do.
  int64_t sum = -static_cast<int64_t>(padded - s.num) * kSightingCost;
  for (int done = 0; done < padded;) {
    sum += s.kernels->sighting_costs(s.fast, done, m, inverse_sq);
    done += kSightingBlock;
    // Gives up where the first matches cost two standard deviations more than the share of `bound`
    // that falls on them; the deviation of one match's cost is taken as 0.4.
    if (bound < INT64_MAX && done < s.num) {
      const double share = static_cast<double>(bound) * done / s.num;
      if (static_cast<double>(sum) > share + 0.8 * kSightingCost * std::sqrt(double(done))) {
        return INT64_MAX;
      }
    }
  }
  return sum;
}

double reprojection_sq(const Sighting& s, const Pose& pose) {
  double p[3];
  place(pose, s.point, p);
  const double depth = dot(s.axis, p);
  if (!(depth > 0)) return kInfinity;
  const double u = dot(s.rows[0], p), v = dot(s.rows[1], p);
  const double error_sq = (u * u + v * v) / (depth * depth);
  return error_sq == error_sq ? error_sq : kInfinity;
}

void pose_equations(const PoseProblem& problem, const Pose& pose, PoseEquations* e) {
  *e = PoseEquations{};
  const double inverse_sq = 1 / (problem.scale_px * problem.scale_px);
  Doubles sums[27] = {};  // of the matches: upper, then gradient
  for (int k = 0; k < problem.count; ++k) {
    const int i = problem.indices[k];
    double turned[3], p[3];
    rotate(pose.R, problem.sightings.all[i].point, turned);
    for (int d = 0; d < 3; ++d) p[d] = turned[d] + pose.t[d];
    ErrorRows at;
    if (!error_rows(problem, i, p, &at)) {
      e->cost += 1;
      continue;
    }
    const double error_sq = at.error[0] * at.error[0] + at.error[1] * at.error[1];
    const double q = error_sq * inverse_sq, share = 1 / (1 + q), weight = share * share;
    const double slope = weight * (1 - q) * share;
    e->cost += q * share;
    e->sums.weight += weight;
    e->sums.psi_sq += error_sq * weight * weight;
    e->sums.slope += slope;
    e->sums.slope_sq += slope * slope;
    e->visible += 1;
    // Both rows at once, one in each lane.
    Doubles row[6];
    for (int c = 0; c < 3; ++c) row[3 + c] = Doubles{at.rows[0][c], at.rows[1][c]};
    row[0] = turned[1] * row[5] - turned[2] * row[4];
    row[1] = turned[2] * row[3] - turned[0] * row[5];
    row[2] = turned[0] * row[4] - turned[1] * row[3];
    const Doubles error = {at.error[0], at.error[1]};
    Doubles* sum = sums;
    for (int a = 0; a < 6; ++a) {
      const Doubles weighted = weight * row[a];
      for (int b = a; b < 6; ++b) *sum++ += weighted * row[b];
      sums[21 + a] += weighted * error;
    }
  }
  static_assert(offsetof(PoseEquations, upper) == 0 && sizeof e->upper == 21 * sizeof(double) &&
                    offsetof(PoseEquations, gradient) == sizeof e->upper,
                "the sums are written as one array");
  double* total = reinterpret_cast<double*>(e);
  for (const Doubles& sum : sums) *total++ = sum[0] + sum[1];
  if (!(problem.gravity.weight > 0)) return;
  const Vec3 h = pose.R * problem.gravity.in_world;
  const Vec3 slope = problem.gravity.in_camera.cross(h);
  const double weight = problem.noise_sq * problem.gravity.weight;
  add_turn_information(h, weight, 6, e->upper);
  for (int a = 0; a < 3; ++a) e->gradient[a] += weight * slope[a];
  e->cost += weight * inverse_sq * (h - problem.gravity.in_camera).squaredNorm();
}

void refine_absolute(const PoseProblem& problem, int max_iterations, double small_gain, Pose* pose,
                     PoseEquations* equations) {
  PoseEquations of[2];
  int current = 0;
  Damping damping;
  pose_equations(problem, *pose, &of[0]);
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    const PoseEquations& now = of[current];
    double step[6];
    if (!solve_damped(6, now.upper, now.gradient, damping.lambda, step)) break;
    const double stretch = stretch_of(now.sums.weight, now.sums.slope);
    for (double& x : step) x *= stretch;
    const Pose moved{orthonormal_product(rotation_step(Vec3(step[0], step[1], step[2])), pose->R),
                     pose->t + Vec3(step[3], step[4], step[5])};
    PoseEquations& next = of[1 - current];
    pose_equations(problem, moved, &next);
    if (!(next.cost < now.cost)) {
      if (!damping.tighten()) break;
      continue;
    }
    const double gain = now.cost - next.cost;
    *pose = moved;
    current = 1 - current;
    damping.ease();
    if (gain < small_gain * next.cost) break;
  }
  if (equations != nullptr) *equations = of[current];
}

}  // namespace tv
