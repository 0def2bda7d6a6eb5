// Camera models behind one interface: pixels to unit rays and back, with Jacobians; the matrix K of
// a camera; and the vector and matrix types of the geometry.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>  // for cross() of two Vec3
#include <algorithm>

#include "twoview/camera.h"

namespace tv {

using Vec2 = Eigen::Matrix<double, 2, 1>;
using Vec3 = Eigen::Matrix<double, 3, 1>;
using Mat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;  // row-major, as in the C API
using Mat23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using Mat32 = Eigen::Matrix<double, 3, 2>;

// A matrix and the nine numbers of the C API, row by row.
inline Mat3 matrix_of(const double entries[9]) { return Eigen::Map<const Mat3>(entries); }
inline void write_matrix(const Mat3& M, double entries[9]) { std::copy_n(M.data(), 9, entries); }

// A checked camera with the bounds of its valid region, which prepare_camera computes once.
struct Camera {
  tv_camera model;         // a Brown-Conrady model without distortion is a pinhole here
  double valid_angle_rad;  // rays at a larger angle from the optical axis are invalid
  // Brown-Conrady: valid_angle_rad as a radius on the plane z = 1; the other models: infinity.
  double valid_radius_undistorted;
  // The largest valid radius of a distorted point, in focal lengths; infinity for a pinhole. For
  // Brown-Conrady it is only an upper bound, and unproject rejects further pixels.
  double valid_radius_distorted;
};

// Whether every ray that the lens sees meets the plane z = 1. Without one it may see what is beside
// the camera and behind it, too.
inline bool has_image_plane(const Camera& camera) {
  return camera.model.model != TV_CAMERA_KANNALA_BRANDT;
}

// K and its inverse. K maps a point (x, y, 1) of the plane z = 1 to its pixel in the undistorted
// image. inverse_intrinsics accepts any invertible matrix of the form [a 0 c; 0 b d; 0 0 1].
Mat3 intrinsics_of(const tv_camera& camera);
Mat3 inverse_intrinsics(const Mat3& K);

// Computes the bounds of a camera that has passed tv_camera_check.
Camera prepare_camera(const tv_camera& camera);

// project maps a point of the camera's frame to its pixel, unproject a pixel to its unit ray. Both
// return false, and leave the outputs as they were, where the lens model has no answer: beyond the
// valid angle; z <= 0 (only a Kannala-Brandt camera may see such points); a point at the origin or
// not finite; a result that overflows. jacobian (d pixel / d point, d ray / d pixel) may be null.
bool project(const Camera& camera, const Vec3& point, Vec2* pixel, Mat23* jacobian);
bool unproject(const Camera& camera, const Vec2& pixel, Vec3* ray, Mat32* jacobian);

// unproject in two steps: where the pixel's ray meets the plane z = 1, and the unit ray to there.
// undistort returns false for Kannala-Brandt, too.
bool undistort(const Camera& camera, const Vec2& pixel, Vec2* plane);
Vec3 ray_through(const Vec2& plane);

}  // namespace tv
