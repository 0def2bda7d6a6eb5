#include "pair/simple_lens.h"

#include <cmath>
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
  if (lens.k1 == 0 && lens.k2 == 0) return camera;
  camera.model = TV_CAMERA_BROWN_CONRADY;
  // Least squares of d = r + k1 r^3 + k2 r^5 + k3 r^7 at distances of equal spacing.
  const double corner = std::hypot(width, height) / 2 / lens.focal_px;
  constexpr int kSamples = 100;
  cv::Matx33d N = cv::Matx33d::zeros();
  cv::Matx31d n = cv::Matx31d::zeros();
  for (int i = 1; i <= kSamples; ++i) {
    const double d = corner * i / kSamples, d_sq = d * d;
    const double r = d / (1 + lens.k1 * d_sq + lens.k2 * d_sq * d_sq), r_sq = r * r;
    const cv::Matx31d row(r * r_sq, r * r_sq * r_sq, r * r_sq * r_sq * r_sq);
    N += row * row.t();
    n += row * (d - r);
  }
  const cv::Matx31d k = N.inv() * n;
  camera.k[0] = k(0);
  camera.k[1] = k(1);
  camera.k[4] = k(2);
  return camera;
}

}  // namespace cli
