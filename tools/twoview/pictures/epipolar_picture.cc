// epipolar.png: epipolar lines and epipoles for a check by eye, as the paper shows them for
// sideways and forward flight.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <optional>

#include "pictures/canvas.h"
#include "pictures/pictures.h"

namespace cli {
namespace {

constexpr int kNumLines = 15;

using Pixel = cv::Point2d;
using Curve = std::vector<Pixel>;

// The epipolar geometry as curves in pixels, from the pose and the lens models, or from F alone.
class Epipolar {
 public:
  explicit Epipolar(const Outcome& outcome) : outcome_(outcome) {
    const tv_two_view& v = outcome.two_view;
    by_rays_ = has_full_pose(v) && outcome.has_cameras;
    if (by_rays_) {
      const tv_camera_pair pair = corrected_pair(outcome);
      camera_[0] = pair.camera0;
      camera_[1] = pair.camera1;
      const Matrix3 R = rotation_of(v);
      const Vector3 t = translation_of(v);
      matrix_ = product(Matrix3{0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0}, R);
      epipole_[1] = t;
      epipole_[0] = applied(transposed(R), t);
    } else {
      std::copy(v.F, v.F + 9, matrix_.begin());
      epipole_[0] = null_vector(matrix_);
      epipole_[1] = null_vector(transposed(matrix_));
    }
  }

  // The epipolar curve in image `to` of a pixel of the other image.
  std::vector<Curve> curve(int to, const Pixel& other) const {
    const Matrix3 m = to == 1 ? matrix_ : transposed(matrix_);
    if (!by_rays_) return {straight(to, applied(m, Vector3{other.x, other.y, 1}))};
    const double pixel[2] = {other.x, other.y};
    Vector3 ray;
    if (tv_camera_unproject(&camera_[1 - to], pixel, ray.data(), nullptr) != TV_OK) return {};
    return bent(camera_[to], applied(m, ray));
  }

  // The pixel of the epipole. If the lens model cannot project it, the result is the pixel of a
  // lens without distortion in the same direction, and `exact` is false (for a pinhole camera
  // true).
  Pixel epipole(int image, bool& exact) const {
    Vector3 e = epipole_[image];
    exact = true;
    if (!by_rays_) return finite_pixel(e);
    if (e[2] < 0) e = {-e[0], -e[1], -e[2]};
    const tv_camera& camera = camera_[image];
    double pixel[2];
    if (tv_camera_project(&camera, e.data(), pixel, nullptr) == TV_OK &&
        std::hypot(pixel[0], pixel[1]) < 1e7)
      return {pixel[0], pixel[1]};
    exact = camera.model == TV_CAMERA_PINHOLE;
    const Vector3 image_point = {camera.fx * e[0] + camera.cx * e[2],
                                 camera.fy * e[1] + camera.cy * e[2], e[2]};
    return finite_pixel(image_point);
  }

 private:
  static Vector3 null_vector(const Matrix3& m) {
    cv::Mat solution;
    cv::SVD::solveZ(cv::Mat(3, 3, CV_64F, const_cast<double*>(m.data())).clone(), solution);
    return {solution.at<double>(0), solution.at<double>(1), solution.at<double>(2)};
  }

  static Pixel finite_pixel(const Vector3& h) {
    const double w = std::abs(h[2]) > 1e-12 ? h[2] : 1e-12;
    return {h[0] / w, h[1] / w};
  }

  Curve straight(int image, const Vector3& line) const {
    const double length = std::hypot(line[0], line[1]);
    if (length == 0) return {};
    const cv::Mat& luma = outcome_.picture[image].luma;
    const Pixel middle(luma.cols / 2.0, luma.rows / 2.0),
        normal(line[0] / length, line[1] / length);
    const Pixel foot = middle - (middle.dot(normal) + line[2] / length) * normal;
    const double reach = luma.cols + luma.rows;
    return {foot - reach * Pixel(-normal.y, normal.x), foot + reach * Pixel(-normal.y, normal.x)};
  }

  // Samples the line n . (x, y, 1) = 0 at equal angles and projects it with the lens model. A new
  // piece begins where the lens model cannot project.
  static std::vector<Curve> bent(const tv_camera& camera, const Vector3& n) {
    std::vector<Curve> pieces(1);
    const double length_sq = n[0] * n[0] + n[1] * n[1];
    if (length_sq == 0) return {};
    const Pixel foot(-n[2] * n[0] / length_sq, -n[2] * n[1] / length_sq);
    const Pixel along = Pixel(-n[1], n[0]) / std::sqrt(length_sq);
    const double distance = std::hypot(1.0, std::hypot(foot.x, foot.y));
    for (int step = -355; step <= 355; ++step) {
      const Pixel p = foot + distance * std::tan(step * 0.25 * CV_PI / 180) * along;
      const double point[3] = {p.x, p.y, 1};
      double pixel[2];
      if (tv_camera_project(&camera, point, pixel, nullptr) == TV_OK && std::abs(pixel[0]) < 3e4 &&
          std::abs(pixel[1]) < 3e4)
        pieces.back().emplace_back(pixel[0], pixel[1]);
      else if (!pieces.back().empty())
        pieces.emplace_back();
    }
    return pieces;
  }

  const Outcome& outcome_;
  bool by_rays_ = false;
  tv_camera camera_[2]{};
  Matrix3 matrix_{};  // E for rays (by_rays_), else F for pixels
  Vector3 epipole_[2]{};
};

// Chooses inliers far from each other in image 0: first the one with the best ratio, then
// repeatedly the one farthest from those chosen.
std::vector<int> spread_inliers(const tv_reconstruction& r, int most) {
  std::vector<int> inliers, chosen;
  for (int i = 0; i < r.num_matches; ++i)
    if (r.inlier_mask[i]) inliers.push_back(i);
  if (inliers.empty()) return chosen;
  int next = *std::min_element(inliers.begin(), inliers.end(), [&](int a, int b) {
    return r.matches[a].ratio < r.matches[b].ratio;
  });
  std::vector<double> nearest(inliers.size(), 1e30);
  while (static_cast<int>(chosen.size()) < most) {
    chosen.push_back(next);
    const tv_keypoint& last = r.keypoints[0][r.matches[next].idx0];
    size_t best = 0;
    for (size_t j = 0; j < inliers.size(); ++j) {
      const tv_keypoint& k = r.keypoints[0][r.matches[inliers[j]].idx0];
      nearest[j] = std::min(nearest[j], std::hypot(double(k.x) - last.x, double(k.y) - last.y));
      if (nearest[j] > nearest[best]) best = j;
    }
    if (nearest[best] < 1) break;
    next = inliers[best];
  }
  return chosen;
}

void draw_epipole(PairSheet& pair, int image, const cv::Mat& luma, Pixel epipole) {
  const Pixel middle(luma.cols / 2.0, luma.rows / 2.0);
  const cv::Rect frame = pair.frame(image);
  cv::Mat part = pair.part(image);
  const cv::Point2d corner = frame.tl();
  const double edge = 14;
  if (epipole.x >= 0 && epipole.y >= 0 && epipole.x < luma.cols && epipole.y < luma.rows) {
    const Pixel at = pair.at(image, epipole.x, epipole.y) - corner;
    for (const auto& [colour, width] :
         {std::pair(ink::paper, 4), std::pair(Colour(255, 255, 255), 2)}) {
      put_ring(part, at, 10, colour, width);
      put_line(part, at - Pixel(16, 0), at + Pixel(16, 0), colour, width);
      put_line(part, at - Pixel(0, 16), at + Pixel(0, 16), colour, width);
    }
    return;
  }
  // Draws an arrow at the image border that points from the middle towards the epipole.
  const Pixel way = epipole - middle;
  const Pixel direction = way / std::hypot(way.x, way.y);
  const double half_width = frame.width / 2.0 - edge, half_height = frame.height / 2.0 - edge;
  const double reach = std::min(half_width / std::max(std::abs(direction.x), 1e-9),
                                half_height / std::max(std::abs(direction.y), 1e-9));
  const Pixel tip = Pixel(frame.width / 2.0, frame.height / 2.0) + reach * direction;
  put_arrow(part, tip - 52 * direction, tip, ink::paper, 6);
  put_arrow(part, tip - 50 * direction, tip - 2 * direction, {255, 255, 255}, 3);
}

std::string epipole_text(int image, Pixel epipole, bool exact, const cv::Mat& luma) {
  char text[96];
  const bool inside =
      epipole.x >= 0 && epipole.y >= 0 && epipole.x < luma.cols && epipole.y < luma.rows;
  if (std::hypot(epipole.x, epipole.y) > 1e6)
    std::snprintf(text, sizeof text, "epipole %d at infinity (arrow)", image);
  else
    std::snprintf(text, sizeof text, "epipole %d at (%.0f, %.0f)%s", image, epipole.x, epipole.y,
                  inside  ? " (cross)"
                  : exact ? ", outside (arrow)"
                          : ", beyond the lens (arrow)");
  return text;
}

}  // namespace

bool has_epipolar_geometry(const Outcome& outcome) {
  return outcome.two_view.has_F || (has_full_pose(outcome.two_view) && outcome.has_cameras);
}

cv::Mat epipolar_picture(const Outcome& outcome) {
  const Epipolar geometry(outcome);
  const tv_reconstruction& r = outcome.reconstruction;
  PairSheet pair(outcome.picture[0].luma, outcome.picture[1].luma, 0.8);
  const std::vector<int> chosen = spread_inliers(r, kNumLines);
  for (int image = 0; image < 2; ++image) {
    cv::Mat part = pair.part(image);  // drawing in `part` clips at the image's border
    const cv::Point2d corner = pair.frame(image).tl();
    cv::Mat layer = part.clone();
    for (size_t i = 0; i < chosen.size(); ++i) {
      const tv_correspondence& match = r.matches[chosen[i]];
      const tv_keypoint& other =
          image == 1 ? r.keypoints[0][match.idx0] : r.keypoints[1][match.idx1];
      for (const Curve& piece : geometry.curve(image, Pixel(other.x, other.y)))
        for (size_t j = 1; j < piece.size(); ++j)
          put_line(layer, pair.at(image, piece[j - 1].x, piece[j - 1].y) - corner,
                   pair.at(image, piece[j].x, piece[j].y) - corner, distinct(static_cast<int>(i)),
                   2);
    }
    cv::addWeighted(layer, 0.75, part, 0.25, 0, part);
    for (size_t i = 0; i < chosen.size(); ++i) {
      const tv_correspondence& match = r.matches[chosen[i]];
      const tv_keypoint& own = image == 0 ? r.keypoints[0][match.idx0] : r.keypoints[1][match.idx1];
      const Pixel at = pair.at(image, own.x, own.y) - corner;
      put_disc(part, at, 7, ink::paper);
      put_disc(part, at, 5.4, {255, 255, 255});
      put_disc(part, at, 4, distinct(static_cast<int>(i)));
    }
  }
  std::string caption = "each point lies on the line of its colour; ";
  for (int image = 0; image < 2; ++image) {
    bool exact = true;
    const Pixel epipole = geometry.epipole(image, exact);
    const cv::Mat& luma = outcome.picture[image].luma;
    draw_epipole(pair, image, luma, epipole);
    caption += (image ? "; " : "") + epipole_text(image, epipole, exact, luma);
  }
  pair.label(outcome.picture[0].name, outcome.picture[1].name, caption);
  return pair.sheet();
}

}  // namespace cli
