// A stretch of a map whose poses and points are adjusted together with the lens that all stretches
// share: the equations of the lens that are left when poses and points are eliminated.
#pragma once

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <utility>
#include <vector>

namespace cli {

// The parameters that all windows share: the logarithm of the focal length, the lens's three
// radial and two tangential coefficients, the principal point's distance from the middle of the
// picture over the focal length, and the time from the picture's first row to its last over that
// between two frames.
enum LensParameter { kFocal, kK1, kK2, kK3, kP1, kP2, kCx, kCy, kReadout, kParameters };
using Lens = cv::Matx<double, kParameters, 1>;
using LensMatrix = cv::Matx<double, kParameters, kParameters>;

class LensWindow {
 public:
  struct View {
    cv::Matx33d R;  // cam_from_world
    cv::Matx31d t;
    // How a point at rest turns and moves in the camera's frame from one frame to the next.
    cv::Matx31d turn, move;
  };
  struct Seen {
    int view;
    cv::Matx21d pixel;  // from the middle of the picture
    double row;         // from the middle, over the picture's height
    double precision;   // 1 / sigma
  };
  struct Point {
    cv::Matx31d position;
    std::vector<Seen> seen;
  };

  std::vector<View> views;
  std::vector<Point> points;

  double cost(const Lens& lens) const { return cost_of(lens, views, points); }

  // Linearises at the lens and eliminates points and poses: what is left is of the lens alone.
  // Nothing is left where the poses are not determined.
  void reduce(const Lens& lens, double damping);

  // The views and points after the step that belongs to a step of the lens. After reduce.
  void step(const Lens& of_lens, const Lens& next, std::vector<View>* new_views,
            std::vector<Point>* new_points);

  static double cost_of(const Lens& lens, const std::vector<View>& views,
                        const std::vector<Point>& points);

  // What is left of the lens after reduce.
  LensMatrix information;
  Lens score;
  double weight = 0, weighted_sq = 0;  // of the residuals along an axis

 private:
  // The dense system of a window's views, of which the first is held, in the order view 1,
  // view 2...
  class DenseSystem {
   public:
    explicit DenseSystem(size_t size) : size_(size), entries_(size * size) {}
    double& at(size_t r, size_t c) { return entries_[r * size_ + c]; }
    // Replaces the lower triangle by its Cholesky factor; false where it has none.
    bool factor() {
      for (size_t c = 0; c < size_; ++c) {
        for (size_t r = c; r < size_; ++r) {
          double sum = at(r, c);
          const double *const a = &at(r, 0), *const b = &at(c, 0);
          for (size_t k = 0; k < c; ++k) sum -= a[k] * b[k];
          if (r == c && !(sum > 0)) return false;
          at(r, c) = r == c ? std::sqrt(sum) : sum / at(c, c);
        }
      }
      return true;
    }
    void forward(std::vector<double>& v) {
      for (size_t r = 0; r < size_; ++r) {
        for (size_t k = 0; k < r; ++k) v[r] -= at(r, k) * v[k];
        v[r] /= at(r, r);
      }
    }
    void backward(std::vector<double>& v) {
      for (size_t r = size_; r-- > 0;) {
        v[r] /= at(r, r);
        for (size_t k = 0; k < r; ++k) v[k] -= at(r, k) * v[r];
      }
    }

   private:
    size_t size_;
    std::vector<double> entries_;
  };
  struct Eliminated {
    cv::Matx33d inverse = cv::Matx33d::zeros();
    cv::Matx31d gradient = cv::Matx31d::zeros();
    cv::Matx<double, kParameters, 3> with_lens = cv::Matx<double, kParameters, 3>::zeros();
    std::vector<std::pair<int, cv::Matx<double, 6, 3>>> with_view;
  };

  static double cost_of_point(const Lens& lens, const std::vector<View>& views, const Point& point);
  // The Gauss-Newton step of a point alone.
  static cv::Matx31d triangulation_step(const Lens& lens, const std::vector<View>& views,
                                        const Point& point);
  void add_point(const Lens& lens, double damping, size_t p);
  // Nothing determines the window's unit: the distance from the first view to the farthest is held.
  void hold_scale();
  void add_view(int view, double w_slopes, double w_r, const cv::Matx<double, 2, 6>& by_pose,
                const cv::Matx<double, 2, kParameters>& by_lens, const cv::Matx21d& r);

  DenseSystem system_{0};
  std::vector<double> gradient_;
  std::array<std::vector<double>, kParameters> with_lens_;
  std::vector<Eliminated> eliminated_;
};

}  // namespace cli
