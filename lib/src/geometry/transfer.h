// The transfer residual of matches from a homography or a rotation H, which predicts where view 1
// sees the ray of view 0.
//
// With d = the displacement in image 1, in pixels, from the matched pixel to the one that H
// predicts, weighted for noise in both images alike,
//     r^2 = d' (I + D D')^-1 d,  D = d (prediction) / d pixel0,
// which is Sampson's distance of the two equations (Hartley & Zisserman 4.2.6). The kernels that
// compute many at once are in kernels/transfer.h. Tests: test/unit/test_residuals.cc.
#pragma once

#include <cstdint>

#include "geometry/ray_pairs.h"

namespace tv {

// Both fields are +inf where H sends the ray behind view 1. A homography is known up to sign: the
// caller's H has the sign that sends points in front.
struct TransferResidual {
  double r_sq;
  double d_sq;  // |d|^2, d the displacement in view 1
};
TransferResidual transfer_residual(const RayPairs& pairs, int i, const Mat3& H);

// Computes r_sq alone of the matches first .. first + count - 1, or of those listed.
void transfer_squares(const RayPairs& pairs, int first, int count, const Mat3& H, double* squares);
void transfer_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& H,
                      double* squares);

}  // namespace tv
