// Optimal triangulation: the epipolar plane whose lines are nearest to two pixels, by the sum of
// squared distances (Poly) or of distances (Poly-Abs), and the nearest points on them. R. Hartley,
// P. Sturm, "Triangulation", CVIU 68(2), 1997. Derivation: docs/algorithms/triangulation.md.
#pragma once

#include "triangulation/frame.h"

namespace tv {

// The pencil of epipolar planes, which are all planes that contain the baseline, and how a step of
// a pixel changes its distance from them. A plane is written as v: its normal is v[0] axis[0] +
// v[1] axis[1]. A pixel with the ray x has the coordinates alpha = (axis[0] . x, axis[1] . x). It
// lies on the plane v where alpha . v = 0, and two pixels lie on a common plane where alpha0 x
// alpha1 = 0. A step d (in pixels along the basis of RayFrame) moves alpha by step d. The pixel's
// distance from the line in which the plane v cuts the image is |alpha . v| / sqrt(v^T step step^T
// v) pixels.
struct EpipolarPencil {
  Vec3 axis[2][2];         // the axes of camera i, in its own frame
  double step[2][2][2];    // for camera i: d alpha[axis] / d (pixels along basis)
  double turned[2][2][2];  // `step` in bases turned so that step0^T [0 1; -1 0] step1 is diagonal
  double singular[2];      // entries of the diagonal matrix above, |singular[1]| <= singular[0]
};

// Sets `axis` alone. center1: the centre of camera 1, as a unit vector in camera 0's frame.
void set_pencil_axes(const Vec3& center1, const Mat3& cam1_from_cam0_R, EpipolarPencil* pencil);

// Sets `step`, `turned` and `singular`. On an image plane they are the same for all rays; on the
// sphere each ray has its own.
void set_pencil_steps(const RayFrame& frame0, const RayFrame& frame1, EpipolarPencil* pencil);

struct Correction {
  Vec3 ray[2];        // rays on a common epipolar plane within rounding; depth 1, not unit vectors
  double step[2][2];  // the step of each image's pixel, in pixels along the frame's basis
};

enum class PixelCost { kSumOfSquares, kSumOfDistances };

// Returns the correction of least cost, which is the global minimum. With numbers too large for
// doubles the result is not finite.
Correction correct_rays(PixelCost cost, const EpipolarPencil& pencil, const RayFrame& frame0,
                        const RayFrame& frame1);

}  // namespace tv
