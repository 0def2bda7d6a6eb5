// The direction of gravity in both views, as a prior of a pose. docs/algorithms/gravity.md.
#pragma once

#include "robust/models.h"

namespace tv {

struct GravityPrior {
  bool known = false;
  Vec3 down[2] = {Vec3::Zero(), Vec3::Zero()};  // unit vectors, each in its camera's frame
  double sigma_rad = 0;  // standard deviation of each direction, about each axis across it
  double weight = 1;     // in (0, 1]; less where the points contradict gravity (gravity_weight)
};

// Makes the prior of the caller's two gravity vectors, which need not be unit vectors. The prior
// has known = false if sigma_rad is 0, or if a vector is zero or not finite.
GravityPrior gravity_prior(const double gravity0[3], const double gravity1[3], double sigma_rad);

// Adds the information on a turn to the packed upper triangle of normal equations whose first three
// of `parameters` rows are it. A turn by w moves h by w x h, so that J = -[h]x and J'J = I - h h':
// the two rows of a tangent basis, whichever it is, summed.
void add_turn_information(const Vec3& h, double weight, int parameters, double* upper);

// Adds the prior's rows to the normal equations of PoseModel. With h = R down0, the term weight
// noise_px^2 |h - down1|^2 / (2 sigma^2) is added to the sum of the matches' r^2; noise_px is the
// standard deviation of r. Returns what it adds to the cost, which is in units of scale_px^2.
double add_gravity_prior(const GravityPrior& prior, const Mat3& R, double noise_px, double scale_px,
                         double upper[15], double gradient[5]);

// How far gravity is from a pose that the points alone gave, in standard deviations, squared: with
// the pose's covariance it follows chi-square with two degrees of freedom where both are right.
double gravity_distance_sq(const GravityPrior& prior, const Mat3& R, const double covariance[25]);

// The weight of gravity against a pose that the points alone gave, by the squared distance between
// them: 1 while the two agree at 99 per cent, then falling with the fourth power of their distance
// in standard deviations. A wrong direction then pulls the pose no farther than one at that limit
// does.
double gravity_weight(double distance_sq);
double gravity_weight(const GravityPrior& prior, const Mat3& R, const double covariance[25]);

// The covariance of a pose that the points gave, once the prior has been added to them: the two
// informations' sum, C - C H' (H C H' + 2 sigma^2 / weight I)^-1 H C with the prior's rows H.
void add_gravity_information(const GravityPrior& prior, const Mat3& R, double covariance[25]);

// Adds the prior to a pose that was refined without it, and to its covariance: the step of Kalman's
// filter, to first order the refinement's result. (R. E. Kalman, "A new approach to linear
// filtering", 1960.)
void add_gravity(const GravityPrior& prior, Pose* pose, double covariance[25]);

// PoseModel with the prior; without one (null, or not known) it is PoseModel, bit for bit.
struct GravityPoseModel {
  static constexpr int kParameters = PoseModel::kParameters;
  Pose pose;
  const GravityPrior* prior = nullptr;
  double noise_px = 0;
  double normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                          const RobustLoss& loss, double* upper, double* gradient) const;
  GravityPoseModel stepped(const double* step) const;
};

}  // namespace tv
