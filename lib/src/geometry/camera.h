// Camera models behind one interface: pixels to unit rays and back, with Jacobians; the matrix K of
// a camera; and the vector and matrix types of the geometry.
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>  // for cross() of two Vec3

#include "twoview/camera.h"

namespace tv {

using Vec2 = Eigen::Matrix<double, 2, 1>;
using Vec3 = Eigen::Matrix<double, 3, 1>;
using Mat3 = Eigen::Matrix<double, 3, 3, Eigen::RowMajor>;  // row-major, as in the C API
using Mat23 = Eigen::Matrix<double, 2, 3, Eigen::RowMajor>;
using Mat32 = Eigen::Matrix<double, 3, 2>;

// A checked camera with the bounds of its valid region, which prepare_camera computes once.
struct Camera {
  tv_camera model;                  // a Brown-Conrady model without distortion is a pinhole here
  double valid_angle_rad;           // rays at a larger angle from the optical axis are invalid
  double valid_radius_undistorted;  // valid_angle_rad as a radius on z = 1 (Brown-Conrady)
  double valid_radius_distorted;    // a bound on distorted radii; unproject rejects more pixels
};

// K and its inverse: the plane z = 1 to the undistorted image, in pixels, and back. K may also be
// any other matrix with the same zeros.
Mat3 intrinsics_of(const tv_camera& camera);
Mat3 inverse_intrinsics(const Mat3& K);

// Computes the bounds of a camera that has passed tv_camera_check.
Camera prepare_camera(const tv_camera& camera);

// project and unproject return false, and leave the outputs as they were, for a point or a pixel
// beyond the valid angle or behind the camera. jacobian may be null.
bool project(const Camera& camera, const Vec3& point, Vec2* pixel, Mat23* jacobian);
bool unproject(const Camera& camera, const Vec2& pixel, Vec3* ray, Mat32* jacobian);

}  // namespace tv
