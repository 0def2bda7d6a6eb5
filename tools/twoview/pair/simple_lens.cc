#include "pair/simple_lens.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <opencv2/core.hpp>

#include "files/camera_file.h"

namespace cli {

double focal_px_of(double focal_35mm, int width, int height) {
  return film_camera(focal_35mm, width, height).fx;
}

double focal_35mm_of(double focal_px, int width, int height) {
  return focal_px / film_camera(1, width, height).fx;
}

tv_camera camera_of_lens(const SimpleLens& lens, int width, int height) {
  tv_camera camera = film_camera(focal_35mm_of(lens.focal_px, width, height), width, height);
  camera.cx += lens.cx;
  camera.cy += lens.cy;
  const double k[] = {lens.k1, lens.k2, lens.k3, lens.p1, lens.p2};
  if (std::all_of(std::begin(k), std::end(k), [](double value) { return value == 0; }))
    return camera;
  camera.model = TV_CAMERA_BROWN_CONRADY;
  // Least squares of d (1 + k4 r^2 + k5 r^4 + k6 r^6) = r (1 + k1 r^2 + k2 r^4 + k3 r^6), the least
  // of those that fit alike, at distances of equal spacing.
  const double corner = std::hypot(width, height) / 2 / lens.focal_px;
  constexpr int kSamples = 100;
  cv::Mat1d rows(kSamples, 6), differences(kSamples, 1), fitted;
  for (int i = 0; i < kSamples; ++i) {
    const double d = corner * (i + 1) / kSamples, sq = d * d;
    const double r = d / (1 + sq * (lens.k1 + sq * (lens.k2 + sq * lens.k3)));
    double power = 1;
    for (int n = 0; n < 3; ++n) {
      power *= r * r;
      rows(i, n) = r * power;
      rows(i, 3 + n) = -d * power;
    }
    differences(i) = d - r;
  }
  cv::solve(rows, differences, fitted, cv::DECOMP_SVD);
  constexpr int kRadial[] = {0, 1, 4, 5, 6, 7};
  for (int n = 0; n < 6; ++n) camera.k[kRadial[n]] = fitted(n);
  camera.k[2] = lens.p1;
  camera.k[3] = lens.p2;
  return camera;
}

}  // namespace cli
