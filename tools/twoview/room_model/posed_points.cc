#include "room_model/posed_points.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "base/error.h"
#include "base/median.h"
#include "base/two_views.h"

namespace cli {
namespace {

constexpr size_t kMostViews = 60;
// A view is matched with the views so many places before it: near ones see much in common, far ones
// give a longer baseline.
constexpr size_t kBack[] = {1, 2, 4, 8};
constexpr float kLeastAngle = 0.03f;  // radians between the rays: 1.7 degrees
constexpr size_t kFewestPairs = 3;    // of pictures that confirm each other
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
  for (const size_t back : kBack) {
    if (seen_.size() <= back) continue;
    const Pairs pairs = matched(seen_[seen_.size() - 1 - back], seen_.back());
    if (pairs.size() == 0) continue;
    triangulate(pairs);
    if (back == 1 || back == 4) confirm(pairs);
  }
}

PosedPoints::Pairs PosedPoints::matched(const Seen& first, const Seen& second) {
  Pairs pairs{{first.view, second.view}, {}};
  for (const tv_correspondence& match :
       match_features(session_.get(), first.features, second.features, options_.match)) {
    const tv_keypoint& a = first.features.keypoints[static_cast<size_t>(match.idx0)];
    const tv_keypoint& b = second.features.keypoints[static_cast<size_t>(match.idx1)];
    pairs.pixels[0].insert(pairs.pixels[0].end(),
                           {static_cast<double>(a.x), static_cast<double>(a.y)});
    pairs.pixels[1].insert(pairs.pixels[1].end(),
                           {static_cast<double>(b.x), static_cast<double>(b.y)});
  }
  return pairs;
}

// The points of these matches by two poses world_from_cam, in the first camera's frame; none where
// the poses are at one place.
std::vector<tv_point> PosedPoints::points_of(const tv_camera& camera, const Pairs& pairs,
                                             const Matrix3 R[2], const Vector3 t[2]) const {
  const Matrix3 cam1_from_world = transposed(R[1]);
  const Matrix3 rotation = product(cam1_from_world, R[0]);
  Vector3 way;
  for (size_t k = 0; k < 3; ++k) way[k] = t[0][k] - t[1][k];
  const Vector3 translation = applied(cam1_from_world, way);
  if (!(norm(translation) > 0)) return {};
  std::vector<tv_point> points(pairs.size());
  const tv_camera_pair cameras = camera_pair(camera, camera, rotation, translation);
  const tv_pixel_pairs pixels = pixel_pairs(pairs.pixels);
  check(tv_triangulate(&cameras, &pixels, TV_TRIANGULATION_ITERATIVE_LS, points.data()),
        "cannot triangulate " + scene_.views[pairs.views[0]].name + " and " +
            scene_.views[pairs.views[1]].name);
  return points;
}

void PosedPoints::triangulate(const Pairs& pairs) {
  const RoomView &v0 = scene_.views[pairs.views[0]], &v1 = scene_.views[pairs.views[1]];
  const Matrix3 R[2] = {v0.R, v1.R};
  const Vector3 t[2] = {v0.t, v1.t};
  for (const tv_point& point : points_of(scene_.camera, pairs, R, t)) {
    if (point.status != TV_POINT_OK || point.angle_rad < kLeastAngle || point.error_px > kMostError)
      continue;
    Vector3 world = applied(v0.R, {point.position[0], point.position[1], point.position[2]});
    for (size_t k = 0; k < 3; ++k) world[k] += v0.t[k];
    points_.push_back(world);
  }
}

void PosedPoints::confirm(const Pairs& pairs) {
  const tv_pixel_pairs given = pixel_pairs(pairs.pixels);
  tv_two_view found;
  tv_two_view_init(&found);
  std::vector<uint8_t> is_inlier(pairs.size());
  check(tv_estimate_two_view(session_.get(), &scene_.camera, &scene_.camera, &given,
                             &options_.estimate, &found, nullptr, is_inlier.data()),
        "cannot estimate");
  if (found.verdict != TV_VERDICT_OK) return;
  Pairs inliers{{pairs.views[0], pairs.views[1]}, {}};
  for (size_t i = 0; i < pairs.size(); ++i)
    for (size_t v = 0; is_inlier[i] != 0 && v < 2; ++v)
      inliers.pixels[v].insert(inliers.pixels[v].end(),
                               {pairs.pixels[v][2 * i], pairs.pixels[v][2 * i + 1]});
  confirmed_.push_back(std::move(inliers));
}

std::optional<double> PosedPoints::share_that_fits(const std::vector<Matrix3>& R,
                                                   const std::vector<Vector3>& t) const {
  // Poses with errors move a match by a few pixels from where it should be. A match that moves less
  // than ten times that between the pictures cannot tell such poses from wrong ones.
  constexpr double kLeast = 1.5, kOfMotion = 0.1, kOfWidth = 0.01;
  size_t num_pairs = 0, count = 0, fitting = 0;
  for (const Pairs& pairs : confirmed_) {
    const Matrix3 rotations[2] = {R[pairs.views[0]], R[pairs.views[1]]};
    const Vector3 places[2] = {t[pairs.views[0]], t[pairs.views[1]]};
    const std::vector<tv_point> points = points_of(scene_.camera, pairs, rotations, places);
    num_pairs += !points.empty();
    count += points.size();
    double sum_sq = 0;
    for (size_t i = 0; i < pairs.pixels[0].size(); ++i) {
      const double motion = pairs.pixels[1][i] - pairs.pixels[0][i];
      sum_sq += motion * motion;
    }
    const double motion = std::sqrt(sum_sq / static_cast<double>(pairs.size()));
    const double most_error =
        std::max(kLeast, std::min(kOfMotion * motion, kOfWidth * scene_.camera.width));
    for (const tv_point& point : points)
      fitting += (point.status == TV_POINT_OK || point.status == TV_POINT_INFINITE) &&
                 point.error_px <= most_error;
  }
  if (num_pairs < kFewestPairs) return {};
  return static_cast<double>(fitting) / static_cast<double>(count);
}

std::optional<double> PosedPoints::median_error_px(const std::vector<Matrix3>& R,
                                                   const std::vector<Vector3>& t,
                                                   double focal) const {
  constexpr size_t kOfPair = 50;  // a median needs no more matches of two pictures
  tv_camera camera = scene_.camera;
  camera.fx *= focal;
  camera.fy *= focal;
  size_t num_pairs = 0;
  std::vector<double> errors;
  for (const Pairs& pairs : confirmed_) {
    Pairs some{{pairs.views[0], pairs.views[1]}, {}};
    for (size_t i = 0; i < pairs.size(); i += pairs.size() / kOfPair + 1)
      for (size_t v = 0; v < 2; ++v)
        some.pixels[v].insert(some.pixels[v].end(),
                              {pairs.pixels[v][2 * i], pairs.pixels[v][2 * i + 1]});
    const Matrix3 rotations[2] = {R[some.views[0]], R[some.views[1]]};
    const Vector3 places[2] = {t[some.views[0]], t[some.views[1]]};
    const std::vector<tv_point> points = points_of(camera, some, rotations, places);
    num_pairs += !points.empty();
    for (const tv_point& point : points) {
      const bool is_seen = point.status == TV_POINT_OK || point.status == TV_POINT_INFINITE;
      errors.push_back(is_seen ? double(point.error_px) : scene_.camera.width);
    }
  }
  if (num_pairs < kFewestPairs) return {};
  return median_of(std::move(errors));
}

}  // namespace cli
