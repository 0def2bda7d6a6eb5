#include "files/camera_doubts.h"

#include <cmath>
#include <cstdio>

#include "base/error.h"

namespace cli {
namespace {

// Where real principal points lie, as shares of the image's side from its middle. Of the
// 28 calibrated cameras of our data sets none lies farther than 0.05 on both axes.
constexpr double kNearMiddle = 0.05, kFarFromMiddle = 0.08;
// Differences of fx and fy, as shares: of one lens, and of two numbers that are not of one lens.
constexpr double kSameFocal = 0.05, kOtherFocal = 0.1;

double share_off_middle(double center, int side) { return std::abs((center + 0.5) / side - 0.5); }

double difference(double a, double b) { return std::abs(a / b - 1); }

// How the four numbers fit the image in another order; null where they do not, or fit as they are.
const char* exchanged(const tv_camera& camera) {
  const double fx = camera.fx, fy = camera.fy, cx = camera.cx, cy = camera.cy;
  const auto is_middle = [&](double x, double y) {
    return share_off_middle(x, camera.width) <= kNearMiddle &&
           share_off_middle(y, camera.height) <= kNearMiddle;
  };
  const bool is_x_far = share_off_middle(cx, camera.width) > kFarFromMiddle;
  const bool is_y_far = share_off_middle(cy, camera.height) > kFarFromMiddle;
  if (is_x_far && is_y_far && is_middle(cy, cx))
    return "are cx and cy exchanged, or is this camera of a turned picture?";
  if (difference(fx, fy) <= kOtherFocal) return nullptr;
  if ((is_x_far || is_y_far) && is_middle(fx, fy) && difference(cx, cy) <= kSameFocal)
    return "are fx and cx, fy and cy exchanged?";
  if (is_x_far && is_middle(fy, cy) && difference(fx, cx) <= kSameFocal)
    return "are fy and cx exchanged?";
  return nullptr;
}

}  // namespace

void refuse_exchanged(const tv_camera& camera, const std::string& where) {
  const char* const question = exchanged(camera);
  if (question == nullptr) return;
  char text[240];
  std::snprintf(text, sizeof text, ": fx %g, fy %g, cx %g, cy %g for an image of %dx%d: %s",
                camera.fx, camera.fy, camera.cx, camera.cy, camera.width, camera.height, question);
  throw BadInput(where + text);
}

}  // namespace cli
