// Matches as rays with their pixel scale, and what a model leaves of them, in pixels.
//
// A match is a pair of rays f0, f1 and, for each, the 3x2 Jacobian J = d ray / d pixel. Sampson's
// distance of f1' M f0 = 0 (P. D. Sampson 1982; Hartley & Zisserman 11.4.3) is then
//     r = f1' M f0 / sqrt(|J0' M' f1|^2 + |J1' M f0|^2),
// in pixels of the images as they are, whatever the lens. Rays are points (x, y, 1) of the plane
// z = 1 where the model allows (this is exactly the textbook's formula for a pinhole), unit vectors
// for a fisheye.
#pragma once

#include <cstdint>

#include "base/arena.h"
#include "geometry/camera.h"
#include "geometry/essential.h"
#include "kernels/kernels.h"

namespace tv {

inline constexpr int kScoreBlock = TVK_SCORE_BLOCK;
inline constexpr int kCostOne = TVK_SCORE_ONE;  // what an outlier costs in an integer score

// Structure of arrays: component-major, so that a loop over matches can be vectorised.
struct RayPairs {
  const tvk_table* kernels;
  int num;
  bool on_plane;  // both views: rays have z = 1, so the third rows of the Jacobians are zero
  double* ray[2][3];
  double* jacobian[2][6];  // row-major 3x2
  double* pixel_angle;  // the angle, in radians, that a pixel of noise in both images makes between
                        // the two rays
  // For scoring only, single precision, padded with zeros to a multiple of kScoreBlock, in an order
  // of their own: the first few are a fair sample of all.
  // On the plane: x0 y0 x1 y1, then J J' of view 0 and of view 1 (xx, xy, yy).
  // Else: the rays (6) and the Jacobians (12).
  float* fast[18];
};

size_t ray_pairs_bytes(int max_matches);
RayPairs alloc_ray_pairs(Arena& arena, int max_matches, bool on_plane);

inline Vec3 ray_of(const RayPairs& pairs, int view, int i) {
  return Vec3(pairs.ray[view][0][i], pairs.ray[view][1][i], pairs.ray[view][2][i]);
}
// For loops over matches, which without Eigen's types are short at -Os, too. R times view 0's ray:
inline void turn_ray0(const RayPairs& pairs, int i, const Mat3& R, double turned[3]) {
  const double x = pairs.ray[0][0][i], y = pairs.ray[0][1][i], z = pairs.ray[0][2][i];
  for (int r = 0; r < 3; ++r) turned[r] = (R(r, 0) * x + R(r, 1) * y) + R(r, 2) * z;
}
inline void cross(const double a[3], const double b[3], double product[3]) {
  product[0] = a[1] * b[2] - a[2] * b[1];
  product[1] = a[2] * b[0] - a[0] * b[2];
  product[2] = a[0] * b[1] - a[1] * b[0];
}
inline double dot(const double a[3], const double b[3]) {
  return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2];
}
inline Mat32 jacobian_of(const RayPairs& pairs, int view, int i) {
  Mat32 jacobian;
  for (int k = 0; k < 6; ++k) jacobian(k / 2, k % 2) = pairs.jacobian[view][k][i];
  return jacobian;
}

void set_ray(RayPairs& pairs, int view, int i, const Vec3& ray, const Mat32& jacobian);
void set_ray(RayPairs& pairs, int view, int i, const double ray[3], const double jacobian[6]);
// After the last set_ray: fills what follows from the rays. Only the first num_scored matches (none
// given: all) are for scoring.
void finish_rays(RayPairs& pairs);
void finish_rays(RayPairs& pairs, int num_scored);

// Squared Sampson distance; +inf for a match that the model says nothing about (both rays at the
// epipoles).
double sampson_sq(const RayPairs& pairs, int i, const Mat3& M);

// Sampson's distance with its sign; its slopes by the entries of M, row by row; and by the
// coordinates of a point that all pixels of both views move away from, as a principal point is:
// rays move by -J, Jacobians by -d J. curvature: null, or d^2 ray / d pixel^2 of each view, 3 x
// (xx, xy, yy), row by row.
struct SampsonSlopes {
  double residual, by_entry[9], by_point[2];
};
// False where the model says nothing about the match.
bool sampson_slopes(const RayPairs& pairs, int i, const Mat3& M, const double curvature[2][9],
                    SampsonSlopes* slopes);

// sampson_sq of the matches first .. first + count - 1, or of those listed.
void sampson_squares(const RayPairs& pairs, int first, int count, const Mat3& M, double* squares);
void sampson_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& M,
                     double* squares);

// The same of a pose, which is to have the matches in front of both cameras: +inf too for one that
// is behind by more than scale_px pixels (depth_vote). Sees the matches first .. first + count - 1.
void pose_squares(const RayPairs& pairs, int first, int count, const Pose& pose, double scale_px,
                  double* squares);

// Sum over the matches for scoring (pairs.num of them) of min(r^2 / T^2, 1), each truncated to a
// multiple of 1/kCostOne: an integer, so that neither order nor vector width matters. Above `bound`
// it may be anything above it; so it is, once in a while, for a model just below `bound`, which the
// first few matches spoke against.
int64_t msac_cost_fast(const RayPairs& pairs, const Mat3& M, double threshold_px, int64_t bound);

// What a homography (or a rotation) leaves: d = the displacement in image 1, in pixels, between
// what H predicts from view 0 and what view 1 saw; weighted for noise in both images alike,
//     r^2 = d' (I + D D')^-1 d,  D = d (prediction) / d pixel0,
// Sampson's distance of the two equations (Hartley & Zisserman 4.2.6).
struct TransferResidual {
  double r_sq;
  double d_sq;  // |d|^2
};
TransferResidual transfer_residual(const RayPairs& pairs, int i, const Mat3& H);

// r_sq alone of the matches first .. first + count - 1, or of those listed.
void transfer_squares(const RayPairs& pairs, int first, int count, const Mat3& H, double* squares);
void transfer_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& H,
                      double* squares);

// Of the listed matches: the square of the sine of the angle between the rays, R taken off, and 2
// beyond a right angle.
void squared_sines(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& R,
                   double* sines_sq);

// What a pixel of noise in each coordinate adds to the information about the direction, whose rows
// b . (R f0 x f1) / |gradient of the residual| are as small as the parallax: the block's three
// entries.
void direction_noise(const RayPairs& pairs, const int32_t* indices, int count, const Pose& pose,
                     double block[3]);

enum class Loss { kTruncated, kCauchy };

struct RobustLoss {
  Loss kind;
  double scale_px;
};

// A scale that no residual reaches.
inline constexpr RobustLoss kLeastSquares{Loss::kTruncated, 1e140};

// Normal equations of sum rho(r_i^2) over the listed matches for a model matrix M with at most nine
// parameters, columns[p] = dM / dparameter p. upper: the packed upper triangle, row by row. Returns
// the sum of rho, in units of scale^2. indices null: matches 0 .. count - 1.
double sampson_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                const Mat3& M, const Mat3* columns, int num_parameters,
                                const RobustLoss& loss, double* upper, double* gradient);

// The same for the transfer residual of a matrix H; columns null: H's nine entries themselves.
double transfer_normal_equations(const RayPairs& pairs, const int32_t* indices, int count,
                                 const Mat3& H, const Mat3* columns, int num_parameters,
                                 const RobustLoss& loss, double* upper, double* gradient);

}  // namespace tv
