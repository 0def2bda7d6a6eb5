#include "files/camera_doubts.h"

#include <algorithm>
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
// kOtherScale: an image size that differs by more than this factor is no error of a principal
// point. kSameScale: the factors of both axes agree to this share. kSameIntrinsics: two
// calibrations of one camera agree to this share.
constexpr double kOtherScale = 1.15, kSameScale = 0.1, kSameIntrinsics = 0.1;

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
    return "are cx and cy exchanged, is this camera of a turned picture, or its size [rows, "
           "columns] (MATLAB's)?";
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

void refuse_other_scale(const tv_camera& camera, const std::string& where) {
  const double x = 2 * (camera.cx + 0.5) / camera.width;
  const double y = 2 * (camera.cy + 0.5) / camera.height;
  const bool is_larger = std::min(x, y) > kOtherScale;
  const bool is_smaller = std::min(x, y) > 0 && std::max(x, y) < 1 / kOtherScale;
  // Where the principal point lies outside the image, it belongs to another image, whatever the
  // ratio of its axes.
  const bool is_outside = std::max(x, y) > 2;
  if (!(is_larger && is_outside) && !((is_larger || is_smaller) && difference(x, y) <= kSameScale))
    return;
  char text[320];
  std::snprintf(text, sizeof text,
                ": fx %g, cx %g, cy %g are of pictures of about %.0fx%.0f, but this one is %dx%d: "
                "scale them, or give a camera file that has its size (--camera FILE, with "
                "--scale-camera where the whole pictures were made smaller or larger)",
                camera.fx, camera.cx, camera.cy, 2 * camera.cx + 1, 2 * camera.cy + 1, camera.width,
                camera.height);
  throw BadInput(where + text);
}

void refuse_other_intrinsics(const tv_camera& camera, const tv_camera& entry,
                             const std::string& where) {
  if (difference(camera.fx, entry.fx) <= kSameIntrinsics &&
      difference(camera.fy, entry.fy) <= kSameIntrinsics &&
      std::abs(camera.cx - entry.cx) <= kSameIntrinsics * entry.width &&
      std::abs(camera.cy - entry.cy) <= kSameIntrinsics * entry.height)
    return;
  char text[320];
  std::snprintf(text, sizeof text,
                ": fx %g, fy %g, cx %g, cy %g, but cameras.yaml has fx %g, fy %g, cx %g, cy %g for "
                "pictures of this size, %dx%d: are they of pictures of another size? Correct one "
                "of the two",
                camera.fx, camera.fy, camera.cx, camera.cy, entry.fx, entry.fy, entry.cx, entry.cy,
                entry.width, entry.height);
  throw BadInput(where + text);
}

}  // namespace cli
