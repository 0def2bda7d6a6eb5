// A lens of few numbers, for a camera of which nothing is known.
#pragma once

#include "twoview/camera.h"

namespace cli {

// Square pixels. With d the pixel's distance from the principal point over the focal length, the
// slope of its ray is d / (1 + k1 d^2 + k2 d^4 + k3 d^6): the division model, whose first
// coefficient is that of Brown-Conrady. A. Fitzgibbon, "Simultaneous linear estimation of multiple
// view geometry and lens distortion", CVPR 2001. To the pixel Brown-Conrady's tangential terms are
// added, for a lens whose elements are not centred.
struct SimpleLens {
  double focal_px = 0;
  double k1 = 0, k2 = 0, k3 = 0;
  double cx = 0, cy = 0;  // the principal point, in pixels from the middle of the picture
  double p1 = 0, p2 = 0;

  // The lens of the same camera whose pictures are `factor` times as wide and as high.
  SimpleLens scaled(double factor) const {
    return {factor * focal_px, k1, k2, k3, factor * cx, factor * cy, p1, p2};
  }
};

// The lens as a camera of the library: a pinhole, or Brown-Conrady with the six radial coefficients
// that follow the division model best over the picture.
tv_camera camera_of_lens(const SimpleLens& lens, int width, int height);

// The focal length as for 35 mm film (film_camera), in millimetres, and its inverse.
double focal_35mm_of(double focal_px, int width, int height);
double focal_px_of(double focal_35mm, int width, int height);

// What is believed of a camera before its film is seen: the focal length as for 35 mm film, and the
// standard deviations of its logarithm and of the radial and tangential coefficients.
inline constexpr double kPriorFocal35mm = 27, kPriorLogFocal = 0.5, kPriorK = 0.15, kPriorP = 0.002;

// Above this relative standard deviation an estimated focal length is doubtful.
inline constexpr double kMostFocalSigma = 0.05;

}  // namespace cli
