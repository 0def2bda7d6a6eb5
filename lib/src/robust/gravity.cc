#include "robust/gravity.h"

#include <cmath>

namespace tv {
namespace {

// The least standard deviation that is used, finer than any accelerometer's. It keeps the weights
// finite.
constexpr double kSmallestSigmaRad = 1e-6;

// Chi-square of two degrees of freedom at 99 per cent.
constexpr double kAgreementSq = 9.21;

// The covariance of h = R down0, in a basis b of h's tangent plane, that follows from a pose's
// covariance C: the derivatives of (b[0], b[1]) . (w x h) by w are the rows H = h x b.
struct TangentRows {
  Vec3 b[2];
  double across[2][5];  // the product H C of the derivatives and the covariance
  double S[3];          // entries 00, 01 and 11 of H C H'
};

TangentRows tangent_rows(const Vec3& h, const double covariance[25]) {
  TangentRows rows;
  tangent_basis(h, &rows.b[0], &rows.b[1]);
  const Vec3 H[2] = {h.cross(rows.b[0]), h.cross(rows.b[1])};
  for (int i = 0; i < 2; ++i) {
    for (int c = 0; c < 5; ++c) {
      rows.across[i][c] =
          (H[i][0] * covariance[c] + H[i][1] * covariance[5 + c]) + H[i][2] * covariance[10 + c];
    }
  }
  int slot = 0;
  for (int i = 0; i < 2; ++i) {
    for (int j = i; j < 2; ++j) {
      const double* across = rows.across[i];
      rows.S[slot++] = (across[0] * H[j][0] + across[1] * H[j][1]) + across[2] * H[j][2];
    }
  }
  return rows;
}

// Writes e = h - down1, projected into h's tangent plane and scaled to the length of h - down1.
void tangent_residual(const GravityPrior& prior, const Mat3& R, const TangentRows& rows,
                      double e[2]) {
  const double chord = (R * prior.down[0] - prior.down[1]).norm();
  for (int i = 0; i < 2; ++i) e[i] = -rows.b[i].dot(prior.down[1]);
  const double length = std::sqrt(e[0] * e[0] + e[1] * e[1]);
  if (length > 0) {
    e[0] *= chord / length;
    e[1] *= chord / length;
  } else {
    e[0] = chord;  // down1 is h or its opposite
  }
}

// The symmetric matrix (S + variance I)^-1 with the rows (a, b) and (b, c).
struct Inverse2 {
  double a, b, c;
};

// Changes a covariance from the tangent basis of old_t to that of t, since the basis may turn far
// where t moves little.
void turn_tangent_basis(const Vec3& old_t, const Vec3& t, double covariance[25]) {
  Vec3 from[2], to[2];
  tangent_basis(old_t, &from[0], &from[1]);
  tangent_basis(t, &to[0], &to[1]);
  const double turn[2][2] = {{to[0].dot(from[0]), to[0].dot(from[1])},
                             {to[1].dot(from[0]), to[1].dot(from[1])}};
  for (int i = 0; i < 5; ++i) {  // covariance becomes covariance turn'
    double* row = covariance + 5 * i;
    const double a = row[3], b = row[4];
    row[3] = turn[0][0] * a + turn[0][1] * b;
    row[4] = turn[1][0] * a + turn[1][1] * b;
  }
  for (int i = 0; i < 5; ++i) {  // covariance becomes turn covariance
    const double a = covariance[15 + i], b = covariance[20 + i];
    covariance[15 + i] = turn[0][0] * a + turn[0][1] * b;
    covariance[20 + i] = turn[1][0] * a + turn[1][1] * b;
  }
  covariance[23] = covariance[19];
  for (int i = 0; i < 3; ++i) {
    covariance[15 + i] = covariance[5 * i + 3];
    covariance[20 + i] = covariance[5 * i + 4];
  }
}

Inverse2 inverse_sum(const TangentRows& rows, double variance) {
  const double a = rows.S[0] + variance, b = rows.S[1], c = rows.S[2] + variance;
  const double inverse = 1 / (a * c - b * b);
  return Inverse2{c * inverse, -b * inverse, a * inverse};
}

}  // namespace

GravityPrior gravity_prior(const double gravity0[3], const double gravity1[3], double sigma_rad) {
  GravityPrior prior;
  if (!(sigma_rad > 0)) return prior;
  const double* gravity[2] = {gravity0, gravity1};
  for (int v = 0; v < 2; ++v) {
    // The vector is divided by its largest entry first, so that its squares stay finite.
    double largest = 0, sum = 0;
    for (int k = 0; k < 3; ++k) {
      const double size = std::fabs(gravity[v][k]);
      if (size > largest) largest = size;
      sum += 0.25 * size;
    }
    if (!(largest > 0) || !(sum - sum == 0.0)) return prior;  // zero, infinite or not a number
    const Vec3 scaled(gravity[v][0] / largest, gravity[v][1] / largest, gravity[v][2] / largest);
    prior.down[v] = scaled.normalized();
  }
  prior.known = true;
  prior.sigma_rad = sigma_rad > kSmallestSigmaRad ? sigma_rad : kSmallestSigmaRad;
  return prior;
}

void add_turn_information(const Vec3& h, double weight, int parameters, double* upper) {
  int slot = 0;
  for (int p = 0; p < 3; ++p) {
    for (int r = p; r < 3; ++r) upper[slot++] += weight * ((p == r ? 1.0 : 0.0) - h[p] * h[r]);
    slot += parameters - 3;  // skips the other columns
  }
}

double add_gravity_prior(const GravityPrior& prior, const Mat3& R, double noise_px, double scale_px,
                         double upper[15], double gradient[5]) {
  const Vec3 h = R * prior.down[0];
  // J'(h - down1) = down1 x h. The residual is the chord, which increases up to half a turn; its
  // components in a tangent plane decrease beyond a quarter turn.
  const double weight =
      prior.weight * (noise_px * noise_px) / (2 * prior.sigma_rad * prior.sigma_rad);
  const Vec3 slope = prior.down[1].cross(h);
  add_turn_information(h, weight, PoseModel::kParameters, upper);
  for (int p = 0; p < 3; ++p) gradient[p] += weight * slope[p];
  return weight * (h - prior.down[1]).squaredNorm() / (scale_px * scale_px);
}

double gravity_distance_sq(const GravityPrior& prior, const Mat3& R, const double covariance[25]) {
  const TangentRows rows = tangent_rows(R * prior.down[0], covariance);
  double e[2];
  tangent_residual(prior, R, rows, e);
  const Inverse2 inverse = inverse_sum(rows, 2 * prior.sigma_rad * prior.sigma_rad);
  return (inverse.a * e[0] * e[0] + 2 * inverse.b * e[0] * e[1]) + inverse.c * e[1] * e[1];
}

double gravity_weight(double distance_sq) {
  if (!(distance_sq > kAgreementSq)) return 1;
  const double ratio = kAgreementSq / distance_sq;
  return ratio * ratio;
}

double gravity_weight(const GravityPrior& prior, const Mat3& R, const double covariance[25]) {
  return gravity_weight(gravity_distance_sq(prior, R, covariance));
}

void add_gravity_information(const GravityPrior& prior, const Mat3& R, double covariance[25]) {
  const TangentRows rows = tangent_rows(R * prior.down[0], covariance);
  const Inverse2 inverse = inverse_sum(rows, 2 * prior.sigma_rad * prior.sigma_rad / prior.weight);
  for (int r = 0; r < 5; ++r) {
    const double* u = rows.across[0];
    const double* v = rows.across[1];
    for (int c = r; c < 5; ++c) {
      const double less = (inverse.a * u[r] * u[c] + inverse.b * (u[r] * v[c] + v[r] * u[c])) +
                          inverse.c * v[r] * v[c];
      covariance[5 * r + c] -= less;
      covariance[5 * c + r] = covariance[5 * r + c];
    }
  }
}

void add_gravity(const GravityPrior& prior, Pose* pose, double covariance[25]) {
  const TangentRows rows = tangent_rows(pose->R * prior.down[0], covariance);
  const Inverse2 inverse = inverse_sum(rows, 2 * prior.sigma_rad * prior.sigma_rad / prior.weight);
  double e[2], step[5];
  tangent_residual(prior, pose->R, rows, e);
  const double u = inverse.a * e[0] + inverse.b * e[1], v = inverse.b * e[0] + inverse.c * e[1];
  for (int p = 0; p < 5; ++p) step[p] = -(rows.across[0][p] * u + rows.across[1][p] * v);
  add_gravity_information(prior, pose->R, covariance);
  const Vec3 old_t = pose->t;
  *pose = PoseModel{*pose}.stepped(step).pose;
  turn_tangent_basis(old_t, pose->t, covariance);
}

double GravityPoseModel::normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                          const RobustLoss& loss, double* upper,
                                          double* gradient) const {
  const double cost =
      PoseModel{pose}.normal_equations(pairs, indices, count, loss, upper, gradient);
  if (prior == nullptr || !prior->known) return cost;
  return cost + add_gravity_prior(*prior, pose.R, noise_px, loss.scale_px, upper, gradient);
}

GravityPoseModel GravityPoseModel::stepped(const double* step) const {
  GravityPoseModel result = *this;
  result.pose = PoseModel{pose}.stepped(step).pose;
  return result;
}

}  // namespace tv
