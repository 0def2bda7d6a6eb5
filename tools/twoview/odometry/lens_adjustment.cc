#include "odometry/lens_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>

namespace cli {
namespace {

// The parameters that all windows share: the logarithm of the focal length, the lens's three
// radial and two tangential coefficients, the principal point's distance from the middle of the
// picture over the focal length, and the time from the picture's first row to its last over that
// between two frames.
enum Parameter { kFocal, kK1, kK2, kK3, kP1, kP2, kCx, kCy, kReadout, kParameters };
using Lens = cv::Matx<double, kParameters, 1>;
using LensMatrix = cv::Matx<double, kParameters, kParameters>;

using Matx23 = cv::Matx<double, 2, 3>;
using Matx26 = cv::Matx<double, 2, 6>;
using Matx2L = cv::Matx<double, 2, kParameters>;
using MatxL3 = cv::Matx<double, kParameters, 3>;
using Matx6L = cv::Matx<double, 6, kParameters>;
using Matx63 = cv::Matx<double, 6, 3>;
using Matx66 = cv::Matx<double, 6, 6>;
using Vec6 = cv::Matx<double, 6, 1>;
using Vec3 = cv::Matx31d;
using Vec2 = cv::Matx21d;

// A window spans a turn, and is short enough that its bending is nearly linear in a step: with 40
// keyframes the steps of a turning car had to be ten times as small.
constexpr size_t kWindow = 16, kLeastViews = 3, kMostWindows = 15;
constexpr double kLossScale = 1;  // pixels of sigma 1, of Cauchy's loss
constexpr double kLostCost = 20;  // cost of an observation that comes behind its camera
// The covariance is that of the noise times this: what else bends a lens, and errors that the views
// of a point share, do not average out. Chosen, with less of the lens free, on seq_tsukuba,
// seq_corridor, seq_tum_fr1_rpy and three rendered flights (docs/algorithms/focal_length.md).
constexpr double kSharedErrors = 20;

struct View {
  cv::Matx33d R;  // cam_from_world
  Vec3 t;
  // How a point at rest turns and moves in the camera's frame from one frame to the next.
  Vec3 turn, move;
};
struct Seen {
  int view;
  Vec2 pixel;        // from the middle of the picture
  double row;        // from the middle, over the picture's height
  double precision;  // 1 / sigma
};
struct Point {
  Vec3 position;
  std::vector<Seen> seen;
};

cv::Matx33d cross_matrix(const Vec3& v) { return {0, -v(2), v(1), v(2), 0, -v(0), -v(1), v(0), 0}; }

cv::Matx33d exp_of(const Vec3& w) {
  const double angle = cv::norm(w);
  const double a = angle > 1e-9 ? std::sin(angle) / angle : 1;
  const double b = angle > 1e-9 ? (1 - std::cos(angle)) / (angle * angle) : 0.5;
  const cv::Matx33d W = cross_matrix(w);
  return cv::Matx33d::eye() + a * W + b * (W * W);
}

// The distance from the middle at the slope `rho`, over the focal length, and its slopes by rho,
// k1, k2 and k3. False where the lens shows no such ray.
bool bend(double rho, const Lens& lens, double* d, double slopes[4]) {
  constexpr int kMostSteps = 20;
  const double k1 = lens(kK1), k2 = lens(kK2), k3 = lens(kK3);
  const double inside = 1 - 4 * k1 * rho * rho;
  double at = inside > 0.01 ? 2 * rho / (1 + std::sqrt(inside)) : rho;
  for (int step = 0; step < kMostSteps; ++step) {
    const double sq = at * at, bent = 1 + sq * (k1 + sq * (k2 + sq * k3));
    // bent^2 times the slope of at / bent
    const double falls = 1 - sq * (k1 + sq * (3 * k2 + sq * 5 * k3));
    if (!(bent > 0.05) || !(falls > 0.05)) return false;
    const double error = at - rho * bent;
    slopes[0] = bent * bent / falls;
    slopes[1] = at * sq / falls;
    slopes[2] = slopes[1] * sq;
    slopes[3] = slopes[2] * sq;
    *d = at;
    if (std::fabs(error) < 1e-9) return true;
    at -= error * bent / falls;
  }
  return false;
}

// The image of a point of the camera's frame, in pixels from the middle, as the row `row` meets it,
// and its slopes by the point and by the lens. False where the point has no image.
bool project(const Lens& lens, const View& view, const Vec3& in_camera, double row, Vec2* pixel,
             Matx23* by_point, Matx2L* by_lens) {
  constexpr double kLeastDepth = 1e-6;
  const double late = row * lens(kReadout);
  const Vec3 moving = cross_matrix(view.turn) * in_camera + view.move;
  const Vec3 x = in_camera + late * moving;
  if (!(x(2) > kLeastDepth)) return false;
  const double f = std::exp(lens(kFocal)), inverse = 1 / x(2);
  const Vec2 slope(x(0) * inverse, x(1) * inverse);
  const double rho = cv::norm(slope);
  double d, slopes[4];
  if (!bend(rho, lens, &d, slopes)) return false;
  const bool is_middle = rho < 1e-9;
  const double s = is_middle ? 1 : d / rho;
  const double u = slope(0), v = slope(1), p1 = lens(kP1), p2 = lens(kP2);
  const Vec2 by_p1(2 * u * v, rho * rho + 2 * v * v), by_p2(rho * rho + 2 * u * u, 2 * u * v);
  *pixel = f * (s * slope + p1 * by_p1 + p2 * by_p2 + Vec2(lens(kCx), lens(kCy)));
  if (!by_point) return true;
  const Vec2 away = is_middle ? Vec2(0, 0) : (1 / rho) * slope;
  const double across = 2 * (p1 * u + p2 * v);
  const cv::Matx22d tangential(2 * p1 * v + 6 * p2 * u, across, across, 6 * p1 * v + 2 * p2 * u);
  const cv::Matx22d radial =
      s * cv::Matx22d::eye() + (is_middle ? 0 : slopes[0] - s) * (away * away.t());
  const cv::Matx22d by_slope = f * (radial + tangential);
  const Matx23 by_x =
      by_slope * Matx23(inverse, 0, -slope(0) * inverse, 0, inverse, -slope(1) * inverse);
  const Vec2 by_readout = by_x * (row * moving);
  *by_point = by_x + late * (by_x * cross_matrix(view.turn));
  for (int r = 0; r < 2; ++r) {
    (*by_lens)(r, kFocal) = (*pixel)(r);
    (*by_lens)(r, kK1) = f * slopes[1] * away(r);
    (*by_lens)(r, kK2) = f * slopes[2] * away(r);
    (*by_lens)(r, kK3) = f * slopes[3] * away(r);
    (*by_lens)(r, kP1) = f * by_p1(r);
    (*by_lens)(r, kP2) = f * by_p2(r);
    (*by_lens)(r, kCx) = r == 0 ? f : 0;
    (*by_lens)(r, kCy) = r == 1 ? f : 0;
    (*by_lens)(r, kReadout) = by_readout(r);
  }
  return true;
}

// The dense system of a window's views, of which the first is held, in the order view 1, view 2...
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

class Window {
 public:
  std::vector<View> views;
  std::vector<Point> points;

  double cost(const Lens& lens) const { return cost_of(lens, views, points); }

  // Linearises at the lens and eliminates points and poses: what is left is of the lens alone.
  // Nothing is left where the poses are not determined.
  void reduce(const Lens& lens, double damping) {
    const size_t size = 6 * (views.size() - 1);
    system_ = DenseSystem(size);
    gradient_.assign(size, 0);
    for (auto& column : with_lens_) column.assign(size, 0);
    information = LensMatrix::zeros();
    score = Lens::zeros();
    weight = weighted_sq = 0;
    eliminated_.assign(points.size(), {});
    for (size_t p = 0; p < points.size(); ++p) add_point(lens, damping, p);
    hold_scale();
    for (size_t k = 0; k < size; ++k) system_.at(k, k) = system_.at(k, k) * (1 + damping) + 1e-9;
    if (!system_.factor()) {
      information = LensMatrix::zeros();
      score = Lens::zeros();
      std::fill(gradient_.begin(), gradient_.end(), 0.0);
      for (auto& column : with_lens_) std::fill(column.begin(), column.end(), 0.0);
      for (size_t k = 0; k < size; ++k) system_.at(k, k) = 1;
      return;
    }
    system_.forward(gradient_);
    for (auto& column : with_lens_) system_.forward(column);
    for (int r = 0; r < kParameters; ++r)
      for (size_t k = 0; k < size; ++k) {
        const double entry = with_lens_[static_cast<size_t>(r)][k];
        score(r) -= entry * gradient_[k];
        for (int c = 0; c < kParameters; ++c)
          information(r, c) -= entry * with_lens_[static_cast<size_t>(c)][k];
      }
  }

  // The views and points after the step that belongs to a step of the lens. After reduce.
  void step(const Lens& of_lens, const Lens& next, std::vector<View>* new_views,
            std::vector<Point>* new_points) {
    std::vector<double> v(gradient_.size());
    for (size_t k = 0; k < v.size(); ++k) {
      v[k] = -gradient_[k];
      for (int q = 0; q < kParameters; ++q)
        v[k] -= with_lens_[static_cast<size_t>(q)][k] * of_lens(q);
    }
    system_.backward(v);
    *new_views = views;
    *new_points = points;
    for (size_t n = 1; n < views.size(); ++n) {
      const double* const d = &v[6 * (n - 1)];
      const cv::Matx33d turn = exp_of({d[0], d[1], d[2]});
      (*new_views)[n].R = turn * views[n].R;
      (*new_views)[n].t = turn * views[n].t + Vec3(d[3], d[4], d[5]);
    }
    for (size_t p = 0; p < points.size(); ++p) {
      const Eliminated& e = eliminated_[p];
      Vec3 right = e.gradient + e.with_lens.t() * of_lens;
      for (const auto& [view, W] : e.with_view) {
        if (view == 0) continue;
        const double* const d = &v[6 * static_cast<size_t>(view - 1)];
        right += W.t() * Vec6(d);
      }
      const Vec3 move = -1 * (e.inverse * right);
      Point& point = (*new_points)[p];
      // The step of a distant point is often far too long in depth: of these, the best.
      double least = -1;
      for (const double share : {1.0, 0.3, 0.0}) {
        Point shifted = points[p];
        shifted.position += share * move;
        const double of_point = cost_of_point(next, *new_views, shifted);
        if (least >= 0 && !(of_point < least)) continue;
        least = of_point;
        point.position = shifted.position;
      }
      Point again = point;
      again.position += triangulation_step(next, *new_views, point);
      if (cost_of_point(next, *new_views, again) < least) point.position = again.position;
    }
  }

  static double cost_of_point(const Lens& lens, const std::vector<View>& views,
                              const Point& point) {
    double sum = 0;
    Vec2 pixel;
    for (const Seen& seen : point.seen) {
      const View& view = views[static_cast<size_t>(seen.view)];
      if (!project(lens, view, view.R * point.position + view.t, seen.row, &pixel, nullptr,
                   nullptr)) {
        sum += kLostCost;
        continue;
      }
      const Vec2 r = seen.precision * (pixel - seen.pixel);
      sum += kLossScale * kLossScale * std::log1p(r.dot(r) / (kLossScale * kLossScale));
    }
    return sum;
  }
  static double cost_of(const Lens& lens, const std::vector<View>& views,
                        const std::vector<Point>& points) {
    double sum = 0;
    for (const Point& point : points) sum += cost_of_point(lens, views, point);
    return sum;
  }

  LensMatrix information;
  Lens score;
  double weight = 0, weighted_sq = 0;  // of the residuals along an axis

 private:
  // The Gauss-Newton step of a point alone.
  static Vec3 triangulation_step(const Lens& lens, const std::vector<View>& views,
                                 const Point& point) {
    cv::Matx33d V = 1e-12 * cv::Matx33d::eye();
    Vec3 g = Vec3::zeros();
    Vec2 pixel;
    Matx23 by_x;
    Matx2L by_lens;
    for (const Seen& seen : point.seen) {
      const View& view = views[static_cast<size_t>(seen.view)];
      if (!project(lens, view, view.R * point.position + view.t, seen.row, &pixel, &by_x, &by_lens))
        continue;
      const Vec2 r = seen.precision * (pixel - seen.pixel);
      const double w = seen.precision / (1 + r.dot(r) / (kLossScale * kLossScale));
      const Matx23 slopes = by_x * view.R;
      V += w * seen.precision * (slopes.t() * slopes);
      g += w * (slopes.t() * r);
    }
    return -1 * (V.inv(cv::DECOMP_CHOLESKY) * g);
  }

  struct Eliminated {
    cv::Matx33d inverse = cv::Matx33d::zeros();
    Vec3 gradient = Vec3::zeros();
    MatxL3 with_lens = MatxL3::zeros();
    std::vector<std::pair<int, Matx63>> with_view;
  };

  void add_point(const Lens& lens, double damping, size_t p) {
    const Point& point = points[p];
    Eliminated& e = eliminated_[p];
    cv::Matx33d V = cv::Matx33d::zeros();
    Vec2 pixel;
    Matx23 by_x;
    Matx2L by_lens;
    for (const Seen& seen : point.seen) {
      const View& view = views[static_cast<size_t>(seen.view)];
      const Vec3 x = view.R * point.position + view.t;
      if (!project(lens, view, x, seen.row, &pixel, &by_x, &by_lens)) continue;
      const Vec2 r = seen.precision * (pixel - seen.pixel);
      const double w = 1 / (1 + r.dot(r) / (kLossScale * kLossScale));
      const double w_slopes = w * seen.precision * seen.precision, w_r = w * seen.precision;
      weight += 2 * w;
      weighted_sq += w * r.dot(r);
      const Matx23 by_point = by_x * view.R;
      const cv::Matx33d turned = -1 * cross_matrix(x);
      Matx26 by_pose;
      for (int row = 0; row < 2; ++row)
        for (int c = 0; c < 3; ++c) {
          by_pose(row, c) = by_x(row, 0) * turned(0, c) + by_x(row, 1) * turned(1, c) +
                            by_x(row, 2) * turned(2, c);
          by_pose(row, 3 + c) = by_x(row, c);
        }
      V += w_slopes * (by_point.t() * by_point);
      e.gradient += w_r * (by_point.t() * r);
      e.with_lens += w_slopes * (by_lens.t() * by_point);
      information += w_slopes * (by_lens.t() * by_lens);
      score += w_r * (by_lens.t() * r);
      const Matx63 W = w_slopes * (by_pose.t() * by_point);
      e.with_view.emplace_back(seen.view, W);
      if (seen.view > 0) add_view(seen.view, w_slopes, w_r, by_pose, by_lens, r);
    }
    for (int k = 0; k < 3; ++k) V(k, k) = V(k, k) * (1 + damping) + 1e-12;
    e.inverse = V.inv(cv::DECOMP_CHOLESKY);
    const MatxL3 lens_inverse = e.with_lens * e.inverse;
    information -= lens_inverse * e.with_lens.t();
    score -= lens_inverse * e.gradient;
    for (const auto& [i, Wi] : e.with_view) {
      if (i == 0) continue;
      const size_t row = 6 * static_cast<size_t>(i - 1);
      const Matx63 inverse = Wi * e.inverse;
      const Vec6 of_gradient = inverse * e.gradient;
      const Matx6L of_lens = inverse * e.with_lens.t();
      for (size_t k = 0; k < 6; ++k) {
        gradient_[row + k] -= of_gradient(static_cast<int>(k));
        for (size_t q = 0; q < kParameters; ++q)
          with_lens_[q][row + k] -= of_lens(static_cast<int>(k), static_cast<int>(q));
      }
      for (const auto& [j, Wj] : e.with_view) {
        if (j == 0 || j > i) continue;  // the lower triangle
        const Matx66 block = inverse * Wj.t();
        const size_t column = 6 * static_cast<size_t>(j - 1);
        for (size_t r = 0; r < 6; ++r)
          for (size_t c = 0; c < 6; ++c)
            system_.at(row + r, column + c) -= block(static_cast<int>(r), static_cast<int>(c));
      }
    }
  }

  // Nothing determines the window's unit: the distance from the first view to the farthest is held.
  void hold_scale() {
    const auto centre = [](const View& view) { return -1 * (view.R.t() * view.t); };
    const Vec3 from = centre(views[0]);
    size_t farthest = 1;
    for (size_t n = 2; n < views.size(); ++n)
      if (cv::norm(centre(views[n]) - from) > cv::norm(centre(views[farthest]) - from))
        farthest = n;
    const Vec3 away = views[farthest].R * (centre(views[farthest]) - from);
    const size_t first = 6 * (farthest - 1) + 3;
    const double size_sq = std::max(away.dot(away), 1e-12);
    double largest = 0;
    for (size_t k = 0; k < 3; ++k) largest = std::max(largest, system_.at(first + k, first + k));
    for (size_t r = 0; r < 3; ++r)
      for (size_t c = 0; c < 3; ++c)
        system_.at(first + r, first + c) +=
            largest * away(static_cast<int>(r)) * away(static_cast<int>(c)) / size_sq;
  }

  void add_view(int view, double w_slopes, double w_r, const Matx26& by_pose, const Matx2L& by_lens,
                const Vec2& r) {
    const size_t first = 6 * static_cast<size_t>(view - 1);
    const Matx66 block = w_slopes * (by_pose.t() * by_pose);
    const Vec6 right = w_r * (by_pose.t() * r);
    const Matx6L with = w_slopes * (by_pose.t() * by_lens);
    for (size_t k = 0; k < 6; ++k) {
      gradient_[first + k] += right(static_cast<int>(k));
      for (size_t q = 0; q < kParameters; ++q)
        with_lens_[q][first + k] += with(static_cast<int>(k), static_cast<int>(q));
      for (size_t c = 0; c < 6; ++c)
        system_.at(first + k, first + c) += block(static_cast<int>(k), static_cast<int>(c));
    }
  }

  DenseSystem system_{0};
  std::vector<double> gradient_;
  std::array<std::vector<double>, kParameters> with_lens_;
  std::vector<Eliminated> eliminated_;
};

Window window_of(const std::vector<const LensKeyframe*>& keyframes,
                 const std::vector<tv_map_point>& points, int width, int height) {
  Window window;
  std::map<int32_t, Point> by_index;
  for (const LensKeyframe* given : keyframes) {
    const FlightKeyframe* const key = given->key;
    const auto view = static_cast<int>(window.views.size());
    const cv::Matx33d R = cv::Matx33d(key->keyframe.world_from_cam_R).t();
    window.views.push_back({R, -1 * (R * Vec3(key->keyframe.world_from_cam_t)),
                            Vec3(given->turn.data()), Vec3(given->move.data())});
    for (const tv_map_observation& o : key->observations) {
      Point& point = by_index[o.idx_point];
      point.position = Vec3(points[static_cast<size_t>(o.idx_point)].position);
      const double y = static_cast<double>(o.y) - (height - 1) / 2.0;
      point.seen.push_back({view,
                            {static_cast<double>(o.x) - (width - 1) / 2.0, y},
                            y / height,
                            1.0 / std::max(static_cast<double>(o.sigma), 0.01)});
    }
  }
  for (auto& [index, point] : by_index)
    if (point.seen.size() >= 2) window.points.push_back(point);
  return window;
}

// Windows of nearly equal length, spread over the map.
std::vector<Window> windows_of(const std::vector<LensKeyframe>& keyframes,
                               const std::vector<tv_map_point>& points, int width, int height) {
  std::map<int32_t, std::vector<const LensKeyframe*>> segments;
  for (const LensKeyframe& key : keyframes) segments[key.key->keyframe.segment].push_back(&key);
  std::vector<std::vector<const LensKeyframe*>> parts;
  for (const auto& [segment, keys] : segments) {
    const size_t count = (keys.size() + kWindow - 1) / kWindow;
    for (size_t k = 0; k < count; ++k) {
      const auto first = keys.begin() + static_cast<std::ptrdiff_t>(k * keys.size() / count);
      const auto last = keys.begin() + static_cast<std::ptrdiff_t>((k + 1) * keys.size() / count);
      if (static_cast<size_t>(last - first) >= kLeastViews) parts.emplace_back(first, last);
    }
  }
  std::vector<Window> windows;
  const size_t count = std::min(parts.size(), kMostWindows);
  for (size_t k = 0; k < count; ++k)
    windows.push_back(window_of(parts[k * parts.size() / count], points, width, height));
  return windows;
}

// The standard deviations of what is believed before the film is seen.
Lens prior_sigmas(int width, int height, double focal_px) {
  // The principal points of calibrated cameras are up to some per cent of the picture's diagonal
  // away from its middle. A rolling shutter takes up to the whole time between two frames.
  constexpr double kPriorCentre = 0.02, kPriorReadout = 0.5;
  const double centre = kPriorCentre * std::hypot(width, height) / focal_px;
  return {kPriorLogFocal, kPriorK, kPriorK, kPriorK,      kPriorP,
          kPriorP,        centre,  centre,  kPriorReadout};
}

// Levenberg-Marquardt over the windows and the lens that they share.
class Adjustment {
 public:
  Adjustment(std::vector<Window> windows, const Lens& start, const Lens& prior,
             const Lens& prior_sigma)
      : windows_(std::move(windows)), lens_(start), prior_(prior), prior_sigma_(prior_sigma) {}

  const Lens& lens() const { return lens_; }
  double cost() const { return cost_; }
  double noise_sq() const { return noise_sq_; }
  size_t num_observations() const {
    size_t count = 0;
    for (const Window& window : windows_)
      for (const Point& point : window.points) count += point.seen.size();
    return count;
  }

  void minimise(int most_steps) {
    constexpr double kSmallMove = 2e-4, kUndamped = 1e-4, kMostDamping = 1e3, kLeastDamping = 1e-8;
    const Lens longest(0.2, 0.1, 0.1, 0.1, 0.005, 0.005, 0.05, 0.05, 0.3);
    double damping = 1e-4, growth = 2;
    bool is_fresh = false;
    for (int step = 0; step < most_steps && !windows_.empty(); ++step) {
      linearise(damping);
      if (!is_fresh) measure_cost();  // under the prior of the noise as it is now
      is_fresh = true;
      LensMatrix damped = information_;
      for (int k = 0; k < kParameters; ++k) damped(k, k) *= 1 + damping;
      Lens move = -1 * (damped.inv() * score_);
      for (int k = 0; k < kParameters; ++k) move(k) = std::clamp(move(k), -longest(k), longest(k));
      const Lens next = lens_ + move;
      double next_cost = cost_of_prior(next);
      std::vector<std::vector<View>> views(windows_.size());
      std::vector<std::vector<Point>> points(windows_.size());
      for (size_t n = 0; n < windows_.size(); ++n) {
        windows_[n].step(move, next, &views[n], &points[n]);
        next_cost += Window::cost_of(next, views[n], points[n]);
      }
      if (!(next_cost < cost_)) {
        damping *= growth;
        growth *= 2;
        if (damping > kMostDamping) return;
        continue;
      }
      const double gain = cost_ - next_cost;
      lens_ = next;
      is_fresh = false;
      cost_ = next_cost;
      for (size_t n = 0; n < windows_.size(); ++n) {
        windows_[n].views.swap(views[n]);
        windows_[n].points.swap(points[n]);
      }
      const bool is_settled = holds_focal_ ? gain < noise_sq_ : true;
      if (damping < kUndamped && cv::norm(move, cv::NORM_INF) < kSmallMove && is_settled) return;
      damping = std::max(damping / 3, kLeastDamping);
      growth = 2;
    }
  }

  // The variance of the log of the focal length: that of the noise, and how much the windows
  // contradict each other.
  double focal_variance() {
    constexpr double kToInvert = 1e-6;
    linearise(kToInvert);
    measure_cost();
    const LensMatrix inverse = information_.inv();
    LensMatrix spread = LensMatrix::zeros();
    for (const Window& window : windows_) spread += window.score * window.score.t();
    return kSharedErrors * noise_sq_ * inverse(kFocal, kFocal) +
           LensMatrix(inverse * spread * inverse)(kFocal, kFocal);
  }

  // The cost with the focal length held this far away and all else adjusted again.
  double cost_away(double log_step, int most_steps) const {
    Adjustment other = *this;
    other.lens_(kFocal) += log_step;
    other.holds_focal_ = true;
    other.minimise(most_steps);
    return other.cost_;
  }

 private:
  void measure_cost() {
    cost_ = cost_of_prior(lens_);
    for (const Window& window : windows_) cost_ += window.cost(lens_);
  }
  double prior_weight(int k) const {
    return kSharedErrors * noise_sq_ / (prior_sigma_(k) * prior_sigma_(k));
  }
  double cost_of_prior(const Lens& at) const {
    double sum = 0;
    for (int k = 0; k < kParameters; ++k)
      sum += prior_weight(k) * (at(k) - prior_(k)) * (at(k) - prior_(k));
    return sum;
  }

  void linearise(double damping) {
    information_ = LensMatrix::zeros();
    score_ = Lens::zeros();
    double weight = 0, sum = 0;
    for (Window& window : windows_) {
      window.reduce(lens_, damping);
      information_ += window.information;
      score_ += window.score;
      weight += window.weight;
      sum += window.weighted_sq;
    }
    constexpr double kLeastNoiseSq = 1e-4;
    if (weight > 0) noise_sq_ = std::max(sum / weight, kLeastNoiseSq);
    for (int k = 0; k < kParameters; ++k) {
      score_(k) += prior_weight(k) * (lens_(k) - prior_(k));
      information_(k, k) += prior_weight(k);
    }
    if (!holds_focal_) return;
    for (int k = 0; k < kParameters; ++k) information_(kFocal, k) = information_(k, kFocal) = 0;
    information_(kFocal, kFocal) = 1;
    score_(kFocal) = 0;
  }

  std::vector<Window> windows_;
  Lens lens_, prior_, prior_sigma_;
  bool holds_focal_ = false;
  LensMatrix information_ = LensMatrix::eye();
  Lens score_ = Lens::zeros();
  double noise_sq_ = 1, cost_ = 0;
};

// The variance of the log of the focal length by what it costs to hold another one. Where a camera
// moves without turning, the slopes at the optimum are of noise and promise more than is known. So
// does their number: what bends all observations alike by a hundredth of their sigma does not
// average out, and such a camera shows no more of a focal length that is 10 per cent off.
double variance_by_cost(const Adjustment& best) {
  constexpr double kAway = 0.1, kAlike = 0.01;
  constexpr int kSteps = 20;
  const double least =
      std::min(best.cost_away(-kAway, kSteps), best.cost_away(kAway, kSteps)) - best.cost();
  const double of_chance = kSharedErrors * best.noise_sq();
  const double alike = kAlike * kAlike * static_cast<double>(best.num_observations());
  const double chi2 = std::max(least, 0.0) / (of_chance + alike);
  constexpr double kPriorVariance = kPriorLogFocal * kPriorLogFocal;
  return 1 / (chi2 / (kAway * kAway) + 1 / kPriorVariance);
}

}  // namespace

LensEstimate adjust_lens(const std::vector<LensKeyframe>& keyframes,
                         const std::vector<tv_map_point>& points, int width, int height,
                         const SimpleLens& start) {
  constexpr int kMostSteps = 50;
  constexpr size_t kLeastKeyframes = 8;  // three views and one turn fit any lens
  constexpr double kPriorVariance = kPriorLogFocal * kPriorLogFocal;
  LensEstimate estimate;
  estimate.lens = start;
  estimate.focal_variance = kPriorVariance;
  std::vector<Window> windows = windows_of(keyframes, points, width, height);
  size_t num_views = 0;
  for (const Window& window : windows) num_views += window.views.size();
  if (num_views < kLeastKeyframes) return estimate;
  const double prior_px = focal_px_of(kPriorFocal35mm, width, height), f = start.focal_px;
  Adjustment adjustment(std::move(windows),
                        {std::log(f), start.k1, start.k2, start.k3, start.p1, start.p2,
                         start.cx / f, start.cy / f, 0},
                        {std::log(prior_px), 0, 0, 0, 0, 0, 0, 0, 0},
                        prior_sigmas(width, height, prior_px));
  adjustment.minimise(kMostSteps);
  const double variance = adjustment.focal_variance();
  const Lens& lens = adjustment.lens();
  const double focal_px = std::exp(lens(kFocal));
  estimate.lens = {
      focal_px,  lens(kK1), lens(kK2), lens(kK3), focal_px * lens(kCx), focal_px * lens(kCy),
      lens(kP1), lens(kP2)};
  if (variance < kPriorVariance)
    estimate.focal_variance = std::max(variance, variance_by_cost(adjustment));
  estimate.is_known = true;
  return estimate;
}

}  // namespace cli
