#include "room_model/posed_points.h"

#include <algorithm>

#include "base/error.h"

namespace cli {
namespace {

constexpr size_t kMostViews = 60;
// A view is matched with those so many before it: near ones see the same, far ones from elsewhere.
constexpr size_t kBack[] = {1, 2, 4, 8};
constexpr float kLeastAngle = 0.03f;  // radians between the rays: 1.7 degrees
constexpr float kMostError = 1.5f;    // pixels: a wrong match seldom lies so near its epipolar line

}  // namespace

PosedPoints::PosedPoints(const RoomScene& scene)
    : scene_(scene), session_(options_), step_(scene.views.size() / kMostViews + 1) {
  options_.settle();
}

void PosedPoints::add(size_t view, const cv::Mat& luma, const cv::Mat& mask) {
  Picture picture;
  picture.path = scene_.views[view].name;
  picture.luma = luma;
  picture.mask = mask;
  tv_context* const context = session_.context(luma.cols, luma.rows);
  seen_.push_back({view, extract(context, picture, options_)});
  for (const size_t back : kBack)
    if (seen_.size() > back) triangulate(seen_[seen_.size() - 1 - back], seen_.back());
}

void PosedPoints::triangulate(const Seen& first, const Seen& second) {
  const RoomView &v0 = scene_.views[first.view], &v1 = scene_.views[second.view];
  const std::vector<tv_correspondence> matches =
      match_features(session_.get(), first.features, second.features, options_.match);
  const Matrix3 cam1_from_world = transposed(v1.R);
  const Matrix3 R = product(cam1_from_world, v0.R);
  Vector3 way;
  for (size_t k = 0; k < 3; ++k) way[k] = v0.t[k] - v1.t[k];
  const Vector3 t = applied(cam1_from_world, way);
  if (matches.empty() || !(norm(t) > 0)) return;
  std::vector<double> pixels[2];
  for (const tv_correspondence& match : matches) {
    const tv_keypoint& a = first.features.keypoints[static_cast<size_t>(match.idx0)];
    const tv_keypoint& b = second.features.keypoints[static_cast<size_t>(match.idx1)];
    pixels[0].insert(pixels[0].end(), {static_cast<double>(a.x), static_cast<double>(a.y)});
    pixels[1].insert(pixels[1].end(), {static_cast<double>(b.x), static_cast<double>(b.y)});
  }
  std::vector<tv_point> points(matches.size());
  check(tv_triangulate(TV_TRIANGULATION_ITERATIVE_LS, &scene_.camera, &scene_.camera, R.data(),
                       t.data(), pixels[0].data(), pixels[1].data(),
                       static_cast<int32_t>(matches.size()), points.data()),
        "cannot triangulate " + v0.name + " and " + v1.name);
  for (const tv_point& point : points) {
    if (point.status != TV_POINT_OK || point.angle_rad < kLeastAngle || point.error_px > kMostError)
      continue;
    Vector3 world = applied(v0.R, {point.position[0], point.position[1], point.position[2]});
    for (size_t k = 0; k < 3; ++k) world[k] += v0.t[k];
    points_.push_back(world);
  }
}

}  // namespace cli
