#include "odometry/lens_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <map>
#include <opencv2/core.hpp>

namespace cli {
namespace {

using Matx23 = cv::Matx<double, 2, 3>;
using Matx26 = cv::Matx<double, 2, 6>;
using Matx62 = cv::Matx<double, 6, 2>;
using Matx63 = cv::Matx<double, 6, 3>;
using Matx66 = cv::Matx<double, 6, 6>;
using Vec6 = cv::Matx<double, 6, 1>;
using Vec3 = cv::Matx31d;
using Vec2 = cv::Matx21d;

// A window spans a turn, and is short enough that its bending is nearly linear in a step: with 40
// keyframes the steps of a turning car had to be ten times as small.
constexpr size_t kWindow = 16, kLeastViews = 3, kMostWindows = 15;
constexpr double kLossScale = 1;  // pixels of sigma 1, of Cauchy's loss
constexpr double kLostCost = 20;  // of an observation that a step brings behind its camera
// The covariance is that of the noise times this: rolling shutter, the rest of the lens, and errors
// that the views of a point share do not average out. Chosen on seq_tsukuba, seq_corridor,
// seq_tum_fr1_rpy and three rendered flights (docs/algorithms/focal_length.md).
constexpr double kSharedErrors = 20;

struct View {
  cv::Matx33d R;  // cam_from_world
  Vec3 t;
};
struct Seen {
  int view;
  Vec2 pixel;        // from the middle of the picture
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

// A lens with its logarithm of the focal length: the two parameters.
using Lens = std::array<double, 2>;

// The image of a point in the camera's frame, in pixels from the middle, and its slopes by the
// point and by the lens. False where the point has no image.
bool project(const Lens& lens, const Vec3& x, Vec2* pixel, Matx23* by_point, cv::Matx22d* by_lens) {
  constexpr double kLeastDepth = 1e-6;
  if (!(x(2) > kLeastDepth)) return false;
  const double f = std::exp(lens[0]), inverse = 1 / x(2);
  const Vec2 slope(x(0) * inverse, x(1) * inverse);
  const double r_sq = slope(0) * slope(0) + slope(1) * slope(1);
  const double inside = 1 - 4 * lens[1] * r_sq;
  if (!(inside > 0.01)) return false;
  const double root = std::sqrt(inside), s = 2 / (1 + root);
  *pixel = f * s * slope;
  if (!by_point) return true;
  const double bend = lens[1] * s * s / root;  // ds / d(r^2)
  const cv::Matx22d by_slope = f * (s * cv::Matx22d::eye() + 2 * bend * (slope * slope.t()));
  const Matx23 by_x(inverse, 0, -slope(0) * inverse, 0, inverse, -slope(1) * inverse);
  *by_point = by_slope * by_x;
  const Vec2 by_k = f * r_sq * s * s / root * slope;
  *by_lens = {(*pixel)(0), by_k(0), (*pixel)(1), by_k(1)};
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
    information = cv::Matx22d::zeros();
    score = Vec2::zeros();
    weight = weighted_sq = 0;
    eliminated_.assign(points.size(), {});
    for (size_t p = 0; p < points.size(); ++p) add_point(lens, damping, p);
    hold_scale();
    for (size_t k = 0; k < size; ++k) system_.at(k, k) = system_.at(k, k) * (1 + damping) + 1e-9;
    if (!system_.factor()) {
      information = cv::Matx22d::zeros();
      score = Vec2::zeros();
      std::fill(gradient_.begin(), gradient_.end(), 0.0);
      for (auto& column : with_lens_) std::fill(column.begin(), column.end(), 0.0);
      for (size_t k = 0; k < size; ++k) system_.at(k, k) = 1;
      return;
    }
    system_.forward(gradient_);
    for (auto& column : with_lens_) system_.forward(column);
    for (int r = 0; r < 2; ++r)
      for (size_t k = 0; k < size; ++k) {
        const double entry = with_lens_[static_cast<size_t>(r)][k];
        score(r) -= entry * gradient_[k];
        for (int c = 0; c < 2; ++c)
          information(r, c) -= entry * with_lens_[static_cast<size_t>(c)][k];
      }
  }

  // The views and points after the step that belongs to a step of the lens. After reduce.
  void step(const Vec2& of_lens, const Lens& next, std::vector<View>* new_views,
            std::vector<Point>* new_points) {
    std::vector<double> v(gradient_.size());
    for (size_t k = 0; k < v.size(); ++k)
      v[k] = -gradient_[k] - with_lens_[0][k] * of_lens(0) - with_lens_[1][k] * of_lens(1);
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
      if (!project(lens, view.R * point.position + view.t, &pixel, nullptr, nullptr)) {
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

  cv::Matx22d information;
  Vec2 score;
  double weight = 0, weighted_sq = 0;  // of the residuals along an axis

 private:
  // The Gauss-Newton step of a point alone.
  static Vec3 triangulation_step(const Lens& lens, const std::vector<View>& views,
                                 const Point& point) {
    cv::Matx33d V = 1e-12 * cv::Matx33d::eye();
    Vec3 g = Vec3::zeros();
    Vec2 pixel;
    Matx23 by_x;
    cv::Matx22d by_lens;
    for (const Seen& seen : point.seen) {
      const View& view = views[static_cast<size_t>(seen.view)];
      if (!project(lens, view.R * point.position + view.t, &pixel, &by_x, &by_lens)) continue;
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
    Matx23 with_lens = Matx23::zeros();
    std::vector<std::pair<int, Matx63>> with_view;
  };

  void add_point(const Lens& lens, double damping, size_t p) {
    const Point& point = points[p];
    Eliminated& e = eliminated_[p];
    cv::Matx33d V = cv::Matx33d::zeros();
    Vec2 pixel;
    Matx23 by_x;
    cv::Matx22d by_lens;
    for (const Seen& seen : point.seen) {
      const View& view = views[static_cast<size_t>(seen.view)];
      const Vec3 x = view.R * point.position + view.t;
      if (!project(lens, x, &pixel, &by_x, &by_lens)) continue;
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
    const Matx23 lens_inverse = e.with_lens * e.inverse;
    information -= lens_inverse * e.with_lens.t();
    score -= lens_inverse * e.gradient;
    for (const auto& [i, Wi] : e.with_view) {
      if (i == 0) continue;
      const size_t row = 6 * static_cast<size_t>(i - 1);
      const Matx63 inverse = Wi * e.inverse;
      const Vec6 of_gradient = inverse * e.gradient;
      const Matx62 of_lens = inverse * e.with_lens.t();
      for (size_t k = 0; k < 6; ++k) {
        gradient_[row + k] -= of_gradient(static_cast<int>(k));
        for (size_t q = 0; q < 2; ++q)
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

  void add_view(int view, double w_slopes, double w_r, const Matx26& by_pose,
                const cv::Matx22d& by_lens, const Vec2& r) {
    const size_t first = 6 * static_cast<size_t>(view - 1);
    const Matx66 block = w_slopes * (by_pose.t() * by_pose);
    const Vec6 right = w_r * (by_pose.t() * r);
    const Matx62 with = w_slopes * (by_pose.t() * by_lens);
    for (size_t k = 0; k < 6; ++k) {
      gradient_[first + k] += right(static_cast<int>(k));
      for (size_t q = 0; q < 2; ++q)
        with_lens_[q][first + k] += with(static_cast<int>(k), static_cast<int>(q));
      for (size_t c = 0; c < 6; ++c)
        system_.at(first + k, first + c) += block(static_cast<int>(k), static_cast<int>(c));
    }
  }

  DenseSystem system_{0};
  std::vector<double> gradient_;
  std::array<std::vector<double>, 2> with_lens_;
  std::vector<Eliminated> eliminated_;
};

Window window_of(const std::vector<const FlightKeyframe*>& keyframes,
                 const std::vector<tv_map_point>& points, int width, int height) {
  Window window;
  std::map<int32_t, Point> by_index;
  for (const FlightKeyframe* key : keyframes) {
    const auto view = static_cast<int>(window.views.size());
    const cv::Matx33d R = cv::Matx33d(key->keyframe.world_from_cam_R).t();
    window.views.push_back({R, -1 * (R * Vec3(key->keyframe.world_from_cam_t))});
    for (const tv_map_observation& o : key->observations) {
      Point& point = by_index[o.idx_point];
      point.position = Vec3(points[static_cast<size_t>(o.idx_point)].position);
      point.seen.push_back({view,
                            {static_cast<double>(o.x) - (width - 1) / 2.0,
                             static_cast<double>(o.y) - (height - 1) / 2.0},
                            1.0 / std::max(static_cast<double>(o.sigma), 0.01)});
    }
  }
  for (auto& [index, point] : by_index)
    if (point.seen.size() >= 2) window.points.push_back(point);
  return window;
}

// Windows of nearly equal length, spread over the map.
std::vector<Window> windows_of(const std::vector<FlightKeyframe>& keyframes,
                               const std::vector<tv_map_point>& points, int width, int height) {
  std::map<int32_t, std::vector<const FlightKeyframe*>> segments;
  for (const FlightKeyframe& key : keyframes) segments[key.keyframe.segment].push_back(&key);
  std::vector<std::vector<const FlightKeyframe*>> parts;
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

// Levenberg-Marquardt over the windows and the lens that they share.
class Adjustment {
 public:
  Adjustment(std::vector<Window> windows, const SimpleLens& start, double prior_log_focal)
      : windows_(std::move(windows)),
        lens_{std::log(start.focal_px), start.k1},
        prior_(prior_log_focal) {}

  const Lens& lens() const { return lens_; }
  double cost() const { return cost_; }
  double noise_sq() const { return noise_sq_; }
  void move_focal_length(double log_step) { lens_[0] += log_step; }

  // is_free: the focal length and k1; the others stay as they are.
  void minimise(std::array<bool, 2> is_free, int most_steps) {
    constexpr double kSmallMove = 2e-4, kUndamped = 1e-4, kMostDamping = 1e3, kLeastDamping = 1e-8;
    const Vec2 longest(0.2, 0.1);
    double damping = 1e-4, growth = 2;
    bool is_fresh = false;
    for (int step = 0; step < most_steps && !windows_.empty(); ++step) {
      linearise(damping, is_free);
      if (!is_fresh) measure_cost();  // under the prior of the noise as it is now
      is_fresh = true;
      cv::Matx22d damped = information_;
      for (int k = 0; k < 2; ++k) damped(k, k) *= 1 + damping;
      Vec2 move = -1 * (damped.inv() * score_);
      for (int k = 0; k < 2; ++k) move(k) = std::clamp(move(k), -longest(k), longest(k));
      const Lens next = {lens_[0] + move(0), lens_[1] + move(1)};
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
      const bool is_small = std::fabs(move(0)) < kSmallMove && std::fabs(move(1)) < kSmallMove;
      const bool holds_focal = !is_free[0] && gain < noise_sq_;
      if (damping < kUndamped && is_small && (is_free[0] || holds_focal)) return;
      damping = std::max(damping / 3, kLeastDamping);
      growth = 2;
    }
  }

  // The covariance of the two parameters: that of the noise, and how much the windows contradict
  // each other.
  cv::Matx22d covariance(std::array<bool, 2> is_free) {
    constexpr double kToInvert = 1e-6;
    linearise(kToInvert, is_free);
    measure_cost();
    const cv::Matx22d inverse = information_.inv();
    cv::Matx22d spread = cv::Matx22d::zeros();
    for (const Window& window : windows_) {
      Vec2 s = window.score;
      for (int k = 0; k < 2; ++k)
        if (!is_free[static_cast<size_t>(k)]) s(k) = 0;
      spread += s * s.t();
    }
    return kSharedErrors * noise_sq_ * inverse + inverse * spread * inverse;
  }

 private:
  void measure_cost() {
    cost_ = cost_of_prior(lens_);
    for (const Window& window : windows_) cost_ += window.cost(lens_);
  }
  Vec2 prior_weights() const {
    const double weight = kSharedErrors * noise_sq_;
    return {weight / (kPriorLogFocal * kPriorLogFocal), weight / (kPriorK1 * kPriorK1)};
  }
  double cost_of_prior(const Lens& at) const {
    const double d = at[0] - prior_;
    return prior_weights()(0) * d * d + prior_weights()(1) * at[1] * at[1];
  }

  void linearise(double damping, std::array<bool, 2> is_free) {
    information_ = cv::Matx22d::zeros();
    score_ = Vec2::zeros();
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
    const Vec2 w = prior_weights();
    score_ += Vec2(w(0) * (lens_[0] - prior_), w(1) * lens_[1]);
    for (int k = 0; k < 2; ++k) information_(k, k) += w(k);
    for (int k = 0; k < 2; ++k) {
      if (is_free[static_cast<size_t>(k)]) continue;
      information_(0, 1) = information_(1, 0) = 0;
      information_(k, k) = 1;
      score_(k) = 0;
    }
  }

  std::vector<Window> windows_;
  Lens lens_;
  double prior_;
  cv::Matx22d information_ = cv::Matx22d::eye();
  Vec2 score_ = Vec2::zeros();
  double noise_sq_ = 1, cost_ = 0;
};

// The variance of the log of the focal length by what it costs to hold another one. Where a camera
// moves without turning, the slopes at the optimum are of noise and promise more than is known.
double variance_by_cost(const Adjustment& best, bool frees_k1) {
  constexpr double kAway = 0.1;
  constexpr int kSteps = 20;
  double least = -1;
  for (const double step : {-kAway, kAway}) {
    Adjustment other = best;
    other.move_focal_length(step);
    other.minimise({false, frees_k1}, kSteps);
    const double more = other.cost() - best.cost();
    least = least < 0 ? std::max(more, 0.0) : std::min(least, std::max(more, 0.0));
  }
  const double chi2 = least / (kSharedErrors * best.noise_sq());
  constexpr double kPriorVariance = kPriorLogFocal * kPriorLogFocal;
  return 1 / (chi2 / (kAway * kAway) + 1 / kPriorVariance);
}

}  // namespace

LensEstimate adjust_lens(const std::vector<FlightKeyframe>& keyframes,
                         const std::vector<tv_map_point>& points, int width, int height,
                         const SimpleLens& start) {
  constexpr int kMostSteps = 50;
  constexpr size_t kLeastKeyframes = 8;  // three views and one turn fit any lens
  // Standard deviations of k1 from 0. At 3 a rolling shutter (seq_tum_fr1_rpy) passes for a lens.
  constexpr double kSignificant = 5;
  LensEstimate estimate;
  estimate.lens = start;
  estimate.focal_variance = kPriorLogFocal * kPriorLogFocal;
  const std::vector<Window> windows = windows_of(keyframes, points, width, height);
  size_t num_views = 0;
  for (const Window& window : windows) num_views += window.views.size();
  if (num_views < kLeastKeyframes) return estimate;
  const double prior = std::log(focal_px_of(kPriorFocal35mm, width, height));
  for (const bool frees_k1 : {true, false}) {
    const SimpleLens from{start.focal_px, frees_k1 ? start.k1 : 0};
    Adjustment adjustment(windows, from, prior);
    adjustment.minimise({true, frees_k1}, kMostSteps);
    const cv::Matx22d V = adjustment.covariance({true, frees_k1});
    const double k1 = adjustment.lens()[1];
    if (frees_k1 && !(k1 * k1 > kSignificant * kSignificant * V(1, 1))) continue;
    estimate.lens = {std::exp(adjustment.lens()[0]), k1};
    const double by_cost = variance_by_cost(adjustment, frees_k1);
    estimate.focal_variance =
        V(0, 0) < estimate.focal_variance ? std::max(V(0, 0), by_cost) : estimate.focal_variance;
    break;
  }
  estimate.is_known = true;
  return estimate;
}

}  // namespace cli
