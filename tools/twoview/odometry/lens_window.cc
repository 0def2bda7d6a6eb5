#include "odometry/lens_window.h"

#include <algorithm>
#include <cmath>

namespace cli {
namespace {

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
using View = LensWindow::View;

constexpr double kLossScale = 1;  // pixels of sigma 1, of Cauchy's loss
constexpr double kLostCost = 20;  // cost of an observation that comes behind its camera

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

}  // namespace

void LensWindow::reduce(const Lens& lens, double damping) {
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

void LensWindow::step(const Lens& of_lens, const Lens& next, std::vector<View>* new_views,
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
    // The step of a distant point is often far too long in depth: several lengths of the step are
    // tried, and the best one is kept.
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

double LensWindow::cost_of(const Lens& lens, const std::vector<View>& views,
                           const std::vector<Point>& points) {
  double sum = 0;
  for (const Point& point : points) sum += cost_of_point(lens, views, point);
  return sum;
}

double LensWindow::cost_of_point(const Lens& lens, const std::vector<View>& views,
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

Vec3 LensWindow::triangulation_step(const Lens& lens, const std::vector<View>& views,
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

void LensWindow::add_point(const Lens& lens, double damping, size_t p) {
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
        by_pose(row, c) =
            by_x(row, 0) * turned(0, c) + by_x(row, 1) * turned(1, c) + by_x(row, 2) * turned(2, c);
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

void LensWindow::hold_scale() {
  const auto centre = [](const View& view) { return -1 * (view.R.t() * view.t); };
  const Vec3 from = centre(views[0]);
  size_t farthest = 1;
  for (size_t n = 2; n < views.size(); ++n)
    if (cv::norm(centre(views[n]) - from) > cv::norm(centre(views[farthest]) - from)) farthest = n;
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

void LensWindow::add_view(int view, double w_slopes, double w_r, const Matx26& by_pose,
                          const Matx2L& by_lens, const Vec2& r) {
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

}  // namespace cli
