// views.png: the cloud from the front and from the side, like the paper's figure 16.

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <numeric>

#include "pictures/canvas.h"
#include "pictures/pictures.h"

namespace cli {
namespace {

// A cloud of so many points or more is drawn with smaller points, without a dark rim.
constexpr size_t kDense = 8000;

struct Range {
  double low = 0, high = 1;
  double length() const { return high - low; }
  double middle() const { return (low + high) / 2; }
  void include(double value) { low = std::min(low, value), high = std::max(high, value); }
};

// The range that contains 98 % of the points, so that a few distant points do not determine the
// scale.
Range span_of(const std::vector<CloudPoint>& cloud, double CloudPoint::*axis) {
  std::vector<double> values;
  for (const CloudPoint& point : cloud) values.push_back(point.*axis);
  Range range{percentile(values, 0.01), percentile(values, 0.99)};
  const double pad =
      std::max(0.05 * range.length(), 1e-3 * std::max(1.0, std::abs(range.middle())));
  return {range.low - pad, range.high + pad};
}

// A step of 1, 2 or 5 times a power of ten such that about `wanted` steps fill the length.
double nice_step(double length, double wanted) {
  const double raw = length / wanted, power = std::pow(10, std::floor(std::log10(raw)));
  const double digit = raw / power;
  return power * (digit < 1.5 ? 1 : digit < 3.5 ? 2 : digit < 7.5 ? 5 : 10);
}

std::string tick_text(double value, double step) {
  const int decimals = std::max(0, -static_cast<int>(std::floor(std::log10(step) + 1e-9)));
  char text[32];
  std::snprintf(text, sizeof text, "%.*f", decimals, std::abs(value) < step / 1e6 ? 0 : value);
  return text;
}

// A plot with the same scale on both axes; the second axis points down, as the camera's y axis
// does.
class Plot {
 public:
  Plot(cv::Mat& sheet, cv::Rect frame, Range across, Range down)
      : sheet_(sheet), frame_(frame), across_(across), down_(down) {
    scale_ = std::min(frame.width / across.length(), frame.height / down.length());
    // The scale fits the longer axis; the range of the other one grows until it fills the frame.
    grow(across_, frame.width / scale_);
    grow(down_, frame.height / scale_);
  }

  cv::Point2d at(double a, double d) const {  // pixels from the frame's top left corner
    return {(a - across_.low) * scale_, (d - down_.low) * scale_};
  }
  bool holds(double a, double d) const {
    return a >= across_.low && a <= across_.high && d >= down_.low && d <= down_.high;
  }
  cv::Mat part() { return sheet_(frame_); }

  void axes(const std::string& title, const std::string& across_name,
            const std::string& down_name) {
    cv::Mat inside = part();
    inside.setTo(ink::panel);
    const double step = nice_step(std::min(frame_.width, frame_.height) / scale_, 5);
    for (double a = std::ceil(across_.low / step) * step; a <= across_.high; a += step) {
      const double x = at(a, 0).x;
      put_line(inside, {x, 0}, {x, double(frame_.height)}, ink::grid);
      put_text(sheet_, tick_text(a, step), {frame_.x + x, frame_.br().y + 20.0}, 10, ink::faint,
               Align::kCentre);
    }
    for (double d = std::ceil(down_.low / step) * step; d <= down_.high; d += step) {
      const double y = at(0, d).y;
      put_line(inside, {0, y}, {double(frame_.width), y}, ink::grid);
      put_text(sheet_, tick_text(d, step), {frame_.x - 8.0, frame_.y + y + 4}, 10, ink::faint,
               Align::kRight);
    }
    put_text(sheet_, title, {double(frame_.x), frame_.y - 20.0}, 14, ink::text);
    put_text(sheet_, "horizontal: " + across_name, {double(frame_.br().x), frame_.br().y + 44.0},
             11, ink::text, Align::kRight);
    put_text(sheet_, "vertical: " + down_name, {double(frame_.br().x), frame_.y - 20.0}, 11,
             ink::text, Align::kRight);
  }

 private:
  static void grow(Range& range, double length) {
    const double middle = range.middle();
    range = {middle - length / 2, middle + length / 2};
  }
  cv::Mat& sheet_;
  cv::Rect frame_;
  Range across_, down_;
  double scale_ = 1;
};

// Dark colours are brightened so that they are visible on the dark background.
Colour shown(const CloudPoint& point) {
  const auto lift = [](uint8_t v) { return 52 + v * 203.0 / 255; };
  return {lift(point.blue), lift(point.green), lift(point.red)};
}

// Draws the points, the farthest from the viewer first. Returns the number of points outside the
// plot.
int draw_cloud(Plot& plot, const std::vector<CloudPoint>& cloud, double CloudPoint::*across,
               double CloudPoint::*away, double radius) {
  std::vector<size_t> order(cloud.size());
  std::iota(order.begin(), order.end(), size_t{0});
  std::stable_sort(order.begin(), order.end(),
                   [&](size_t a, size_t b) { return cloud[a].*away > cloud[b].*away; });
  cv::Mat part = plot.part();
  int outside = 0;
  for (const size_t i : order) {
    const CloudPoint& point = cloud[i];
    if (!plot.holds(point.*across, point.y)) {
      ++outside;
      continue;
    }
    const cv::Point2d at = plot.at(point.*across, point.y);
    if (cloud.size() < kDense) put_disc(part, at, radius + 0.9, ink::panel);
    put_disc(part, at, radius, shown(point));
  }
  return outside;
}

// Draws the frustum of a camera, seen along the x axis of camera 0.
void draw_camera(Plot& plot, const Frustum& frustum, const Colour& colour) {
  cv::Mat part = plot.part();
  const auto at = [&](const Vector3& p) { return plot.at(p[2], p[1]); };
  for (size_t i = 0; i < 4; ++i) {
    put_line(part, at(frustum.centre), at(frustum.corners[i]), colour);
    put_line(part, at(frustum.corners[i]), at(frustum.corners[(i + 1) % 4]), colour, 2);
  }
  put_disc(part, at(frustum.centre), 3, colour);
}

}  // namespace

cv::Mat views_picture(const Outcome& outcome, const std::vector<CloudPoint>& cloud) {
  const tv_two_view& v = outcome.two_view;
  const Range x = span_of(cloud, &CloudPoint::x), y = span_of(cloud, &CloudPoint::y);
  Range z = span_of(cloud, &CloudPoint::z);
  // The side view also shows the cameras, unless this would reduce the cloud to less than half of
  // the plot.
  Range with_cameras = z;
  for (int camera = 0; camera < 2; ++camera)
    with_cameras.include(frustum_of(outcome, camera, 0).centre[2]);
  with_cameras.low -= 0.04 * with_cameras.length();
  const bool show_cameras = z.length() > 0.5 * with_cameras.length();
  if (show_cameras) z = with_cameras;

  constexpr int width = 860, left = 78, top = 62, bottom = 92, right = 22;
  const double wanted = std::max(width * y.length() / x.length(), width * y.length() / z.length());
  const int height = static_cast<int>(std::min(std::max(wanted, 380.0), 720.0));
  cv::Mat sheet(top + height + bottom, 2 * (left + width) + right, CV_8UC3, ink::paper);
  const double least = cloud.size() < kDense ? 1.8 : 1.1;
  const double radius =
      std::min(std::max(std::sqrt(0.12 * width * height / double(cloud.size())) / 2, least), 5.0);

  Plot front(sheet, {left, top, width, height}, x, y);
  const std::string unit = outcome.scale ? " [m]" : " [baselines]";
  front.axes("From the front, as camera 0 sees it", "x, right" + unit, "y, down" + unit);
  const int outside_front = draw_cloud(front, cloud, &CloudPoint::x, &CloudPoint::z, radius);
  Plot side(sheet, {2 * left + width, top, width, height}, z, y);
  side.axes("From the side", "z, forward" + unit, "y, down" + unit);
  const int outside_side = draw_cloud(side, cloud, &CloudPoint::z, &CloudPoint::x, radius);
  if (show_cameras) {
    const double size = 0.06 * with_cameras.length();
    draw_camera(side, frustum_of(outcome, 1, size), ink::accent);
    draw_camera(side, frustum_of(outcome, 0, size), Colour(255, 255, 255));
  }

  char caption[256];
  const double parallax = v.median_parallax_rad * 57.29577951308232;
  std::snprintf(caption, sizeof caption, "%zu points; %smedian parallax %.2f deg%s", cloud.size(),
                outcome.scale ? "" : "one baseline is the distance between the cameras; ", parallax,
                show_cameras ? "; cameras: 0 white, 1 orange" : "");
  std::string text = caption;
  if (outside_front + outside_side > 0)
    text += "; beyond the frame: " + std::to_string(outside_front) + " and " +
            std::to_string(outside_side);
  put_text(sheet, text, {double(left), sheet.rows - 16.0}, 11, ink::faint);
  return sheet;
}

}  // namespace cli
