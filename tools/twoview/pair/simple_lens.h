// A lens of one coefficient, for a camera of which nothing is known.
#pragma once

#include "twoview/camera.h"

namespace cli {

// Square pixels, and the principal point in the middle of the picture. With d the pixel's distance
// from the middle over the focal length, the slope of its ray is d / (1 + k1 d^2): the division
// model, whose coefficient is the first one of Brown-Conrady.
// A. Fitzgibbon, "Simultaneous linear estimation of multiple view geometry and lens distortion",
// CVPR 2001.
struct SimpleLens {
  double focal_px = 0;
  double k1 = 0;
};

// The lens as a camera of the library: a pinhole, or Brown-Conrady's three radial coefficients that
// follow the division model best over the picture.
tv_camera camera_of_lens(const SimpleLens& lens, int width, int height);

// The focal length as for 35 mm film (film_camera), in millimetres, and its inverse.
double focal_35mm_of(double focal_px, int width, int height);
double focal_px_of(double focal_35mm, int width, int height);

// What is believed of a camera before its film is seen: the focal length as for 35 mm film, and the
// standard deviations of its logarithm and of k1.
inline constexpr double kPriorFocal35mm = 27, kPriorLogFocal = 0.5, kPriorK1 = 0.15;

// Above this relative standard deviation an estimated focal length is doubtful.
inline constexpr double kMostFocalSigma = 0.05;

}  // namespace cli
