#include "base/upright.h"

#include <opencv2/core.hpp>

namespace cli {

Vector3 up_of_cameras(const std::vector<Matrix3>& world_from_cam, int turn_deg) {
  // Standard deviations, radians: of an x axis from the level, and of a y axis, about the x axis,
  // from straight down.
  constexpr double kRoll = 0.05, kPitch = 0.45;
  const cv::Matx33d shown_from_stored[] = {cv::Matx33d::eye(),
                                           {0, -1, 0, 1, 0, 0, 0, 0, 1},
                                           {-1, 0, 0, 0, -1, 0, 0, 0, 1},
                                           {0, 1, 0, -1, 0, 0, 0, 0, 1}};
  const cv::Matx33d turned = shown_from_stored[(turn_deg / 90 % 4 + 4) % 4].t();
  cv::Matx33d not_level = cv::Matx33d::zeros();
  cv::Vec3d down(0, 0, 0);
  for (const Matrix3& R : world_from_cam) {
    const cv::Matx33d axes = cv::Matx33d(R.data()) * turned;
    const cv::Vec3d x(axes(0, 0), axes(1, 0), axes(2, 0));
    not_level += x * x.t();
    down += cv::Vec3d(axes(0, 1), axes(1, 1), axes(2, 1));
  }
  const double length = cv::norm(down);
  if (!(length > 0)) return {0, -1, 0};
  down /= length;
  // The cost of a direction u as up: how far the cameras are from level, and how far their mean is
  // from down, each over its variance. Its least eigenvector is up.
  const cv::Matx33d cost =
      not_level * (1 / (kRoll * kRoll * static_cast<double>(world_from_cam.size()))) +
      (cv::Matx33d::eye() - down * down.t()) * (1 / (kPitch * kPitch));
  cv::Vec3d values;
  cv::Matx33d vectors;  // rows, the least eigenvalue last
  cv::eigen(cost, values, vectors);
  cv::Vec3d up(vectors(2, 0), vectors(2, 1), vectors(2, 2));
  if (up.dot(down) > 0) up = -up;
  return {up[0], up[1], up[2]};
}

void DownSum::add(const Matrix3& world_from_cam, const Matrix3& upright_from_cam) {
  const Matrix3& u = upright_from_cam;
  const Vector3 down = applied(world_from_cam, {u[6], u[7], u[8]});
  for (size_t k = 0; k < 3; ++k) sum_[k] += down[k];
  ++count_;
}

std::optional<Vector3> DownSum::down() const {
  constexpr double kLeastMean = 0.97;  // directions that spread by 20 degrees have it
  const double length = norm(sum_);
  if (!(length > kLeastMean * count_)) return {};
  return Vector3{sum_[0] / length, sum_[1] / length, sum_[2] / length};
}

}  // namespace cli
