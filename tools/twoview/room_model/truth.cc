#include "room_model/truth.h"

#include <algorithm>
#include <array>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <numeric>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>
#include <unordered_set>
#include <utility>

#include "base/error.h"
#include "base/median.h"

namespace cli {
namespace {

constexpr double kWithin = 0.05;        // metres: what counts as right
constexpr double kSpacing = 0.02;       // metres between points of a surface
constexpr size_t kMostPoints = 400000;  // of a surface: 160 square metres
constexpr int kColumns = 160;           // of a picture of depths, at most, as triangles
constexpr double kMostStep = 0.05;      // of the depth between neighbours of one surface

Vector3 sum_of(const Vector3& a, const Vector3& b) {
  return {a[0] + b[0], a[1] + b[1], a[2] + b[2]};
}

std::optional<double> median_if_any(std::vector<double> values) {
  if (values.empty()) return {};
  return median_of(std::move(values));
}

// Calls visit(i, x, y) for each i in `todo` whose point places[i] the camera sees, at the pixel (x,
// y).
template <typename Visit>
void for_shown(const tv_camera& camera, const Matrix3& R, const Vector3& t,
               const std::vector<Vector3>& places, const std::vector<size_t>& todo,
               const Visit& visit) {
  const Matrix3 inverse = transposed(R);
  std::vector<double> points, pixels(2 * todo.size());
  std::vector<uint8_t> inside(todo.size());
  for (const size_t i : todo) {
    const Vector3 in_camera = applied(inverse, minus(places[i], t));
    points.insert(points.end(), in_camera.begin(), in_camera.end());
  }
  check(tv_camera_project_points(&camera, points.data(), static_cast<int32_t>(todo.size()),
                                 pixels.data(), inside.data()),
        "cannot look at the true surface");
  for (size_t k = 0; k < todo.size(); ++k) {
    const double x = pixels[2 * k], y = pixels[2 * k + 1];
    if (inside[k] != 0 && x >= 0 && y >= 0 && x < camera.width && y < camera.height)
      visit(todo[k], x, y);
  }
}

std::vector<size_t> all_of(size_t count) {
  std::vector<size_t> numbers(count);
  std::iota(numbers.begin(), numbers.end(), size_t{0});
  return numbers;
}

// Whether a picture says what is at each place: its depth at the place's pixel is known. Without
// pictures: everywhere.
std::vector<bool> are_judged(const std::vector<TrueDepth>& pictures,
                             const std::vector<Vector3>& places) {
  std::vector<bool> judged(places.size(), pictures.empty());
  std::vector<size_t> todo = all_of(places.size());
  for (const TrueDepth& picture : pictures) {
    const cv::Mat& depth = picture.depth;
    for_shown(picture.camera, picture.R, picture.t, places, todo,
              [&](size_t i, double x, double y) {
                const int column = std::min(depth.cols - 1, static_cast<int>(std::lround(x)));
                const int row = std::min(depth.rows - 1, static_cast<int>(std::lround(y)));
                judged[i] = depth.at<float>(row, column) > 0;
              });
    todo.erase(std::remove_if(todo.begin(), todo.end(), [&](size_t i) { return judged[i]; }),
               todo.end());
  }
  return judged;
}

// One of the points in each cube of the side `spacing`: pictures that overlap show a place often.
std::vector<SurfacePoint> thinned(const std::vector<SurfacePoint>& points, double spacing) {
  std::unordered_set<uint64_t> taken;
  std::vector<SurfacePoint> kept;
  for (const SurfacePoint& point : points) {
    uint64_t key = 0;
    for (const double x : point.place)
      key = key << 21 | (static_cast<uint64_t>(std::floor(x / spacing)) & 0x1fffff);
    if (taken.insert(key).second) kept.push_back(point);
  }
  return kept;
}

// The true points that at least two keyframes could see: within their pictures, and with nothing in
// front.
std::vector<Vector3> seen_twice(const std::vector<SurfacePoint>& points, const TriangleTree& tree,
                                const RoomScene& scene, const Placement& truth_from_world) {
  std::vector<Vector3> places;
  for (const SurfacePoint& point : points) places.push_back(point.place);
  std::vector<int> count(places.size());
  std::vector<size_t> todo = all_of(places.size());
  for (const RoomView& view : scene.views) {
    if (!view.is_keyframe) continue;
    const Vector3 eye = truth_from_world.of(view.t);
    for_shown(
        scene.camera, product(truth_from_world.R, view.R), eye, places, todo,
        [&](size_t i, double, double) { count[i] += !tree.is_blocked(eye, places[i], kWithin); });
    todo.erase(std::remove_if(todo.begin(), todo.end(), [&](size_t i) { return count[i] == 2; }),
               todo.end());
  }
  std::vector<Vector3> seen;
  for (size_t i = 0; i < places.size(); ++i)
    if (count[i] == 2) seen.push_back(places[i]);
  return seen;
}

struct JudgedPoint {
  Vector3 place;
  bool inferred;
};

double share_within(const std::vector<double>& distances) {
  const auto count =
      std::count_if(distances.begin(), distances.end(), [](double d) { return d <= kWithin; });
  return static_cast<double>(count) / static_cast<double>(distances.size());
}

std::optional<double> share_or_none(const std::vector<double>& distances) {
  if (distances.empty()) return {};
  return share_within(distances);
}

// points: of the room, placed; room: the same surface; seen: of the truth.
TruthScores scores_of(const std::vector<JudgedPoint>& points, const TriangleTree& truth,
                      const std::vector<Vector3>& seen, const TriangleTree& room) {
  std::vector<double> all, measured, inferred, missing;
  for (const JudgedPoint& point : points) {
    all.push_back(truth.nearest(point.place).distance);
    (point.inferred ? inferred : measured).push_back(all.back());
  }
  for (const Vector3& place : seen) missing.push_back(room.nearest(place).distance);
  TruthScores scores;
  scores.precision = share_or_none(all);
  scores.precision_measured = share_or_none(measured);
  scores.precision_inferred = share_or_none(inferred);
  scores.recall = share_or_none(missing).value_or(0);
  const double precision = scores.precision.value_or(0), sum = precision + scores.recall;
  if (sum > 0) scores.f = 2 * precision * scores.recall / sum;
  scores.accuracy_median = median_if_any(all);
  if (!room.is_empty()) scores.completeness_median = median_if_any(missing);
  return scores;
}

// The similarity that brings the points to the surface: the sum of the squared distances from the
// planes of the nearest triangles is made least, by Gauss and Newton (Y. Chen, G. Medioni, "Object
// modelling by registration of multiple range images", 1992, with the scale beside it).
Placement registered(const std::vector<JudgedPoint>& points, const TriangleMesh& mesh,
                     const TriangleTree& truth) {
  constexpr size_t kMost = 20000;
  constexpr int kIterations = 30;
  constexpr double kFirstReach = 0.3, kLastReach = 0.1;  // metres: farther pairs do not count
  constexpr double kRidge = 1e-6;  // keeps what the surface does not determine as it is
  Placement placement;
  Vector3 middle{0, 0, 0};
  for (const JudgedPoint& point : points)
    for (size_t k = 0; k < 3; ++k) middle[k] += point.place[k] / static_cast<double>(points.size());
  const size_t step = points.size() / kMost + 1;
  for (int iteration = 0; iteration < kIterations; ++iteration) {
    const double reach = iteration < kIterations / 3 ? kFirstReach : kLastReach;
    cv::Matx<double, 7, 7> normal = cv::Matx<double, 7, 7>::zeros();
    cv::Matx<double, 7, 1> right = cv::Matx<double, 7, 1>::zeros();
    const Vector3 centre = placement.of(middle);
    for (size_t i = 0; i < points.size(); i += step) {
      const Vector3 p = placement.of(points[i].place);
      const TriangleTree::Nearest near = truth.nearest(p, reach);
      if (!(near.distance < reach)) continue;
      const auto& corners = mesh.triangles[near.triangle];
      const auto corner = [&](size_t k) { return mesh.places[static_cast<size_t>(corners[k])]; };
      Vector3 n = cross(minus(corner(1), corner(0)), minus(corner(2), corner(0)));
      const double length = norm(n);
      if (!(length > 0)) continue;
      for (double& value : n) value /= length;
      const Vector3 arm = minus(p, centre), turn = cross(arm, n);
      const cv::Matx<double, 7, 1> row(turn[0], turn[1], turn[2], n[0], n[1], n[2], dot(n, arm));
      normal += row * row.t();
      right -= row * dot(n, minus(p, near.place));
    }
    for (int k = 0; k < 7; ++k) normal(k, k) += kRidge * (normal(k, k) + 1);
    cv::Matx<double, 7, 1> by;
    if (!cv::solve(normal, right, by, cv::DECOMP_CHOLESKY)) break;
    cv::Matx33d turn;
    cv::Rodrigues(cv::Vec3d(by(0), by(1), by(2)), turn);
    Matrix3 R;
    std::copy_n(turn.val, 9, R.begin());
    const double scale = std::exp(by(6));
    // About the centre: y = scale R (p - centre) + centre + shift.
    Placement moved;
    moved.scale = scale;
    moved.R = R;
    const Vector3 turned = applied(R, centre);
    for (size_t k = 0; k < 3; ++k)
      moved.t[k] = centre[k] + by(static_cast<int>(3 + k)) - scale * turned[k];
    placement.t = moved.of(placement.t);
    placement.R = product(moved.R, placement.R);
    placement.scale *= moved.scale;
    if (cv::norm(by) < 1e-7) break;
  }
  return placement;
}

}  // namespace

Vector3 Placement::of(const Vector3& x) const {
  Vector3 y = applied(R, x);
  for (size_t k = 0; k < 3; ++k) y[k] = scale * y[k] + t[k];
  return y;
}

TriangleMesh mesh_of(const std::vector<TrueDepth>& pictures) {
  TriangleMesh mesh;
  for (const TrueDepth& picture : pictures) {
    const int step = (picture.depth.cols + kColumns - 1) / kColumns;
    const int columns = (picture.depth.cols - 1) / step + 1;
    const int rows = (picture.depth.rows - 1) / step + 1;
    const auto depth = [&](int column, int row) {
      return static_cast<double>(picture.depth.at<float>(row * step, column * step));
    };
    std::vector<int32_t> index(static_cast<size_t>(columns) * static_cast<size_t>(rows), -1);
    const auto at = [&](int column, int row) -> int32_t& {
      return index[static_cast<size_t>(row) * static_cast<size_t>(columns) +
                   static_cast<size_t>(column)];
    };
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        const double pixel[2] = {static_cast<double>(column * step),
                                 static_cast<double>(row * step)};
        const double z = depth(column, row);
        Vector3 ray{};
        if (!(z > 0) || tv_camera_unproject(&picture.camera, pixel, ray.data(), nullptr) != TV_OK ||
            !(ray[2] > 0))
          continue;
        for (double& value : ray) value *= z / ray[2];
        ray[2] = z;
        at(column, row) = static_cast<int32_t>(mesh.places.size());
        mesh.places.push_back(sum_of(applied(picture.R, ray), picture.t));
      }
    }
    const auto add = [&](const std::array<cv::Point, 3>& corners) {
      double low = INFINITY, high = 0;
      std::array<int32_t, 3> triangle{};
      for (size_t k = 0; k < 3; ++k) {
        triangle[k] = at(corners[k].x, corners[k].y);
        if (triangle[k] < 0) return;
        low = std::min(low, depth(corners[k].x, corners[k].y));
        high = std::max(high, depth(corners[k].x, corners[k].y));
      }
      if (high - low <= kMostStep * low) mesh.triangles.push_back(triangle);
    };
    for (int row = 0; row + 1 < rows; ++row) {
      for (int column = 0; column + 1 < columns; ++column) {
        const cv::Point a(column, row), b(column + 1, row), c(column, row + 1);
        add({a, c, b});
        add({b, c, b + c - a});
      }
    }
  }
  return mesh;
}

RoomTruth compared(const RoomScene& scene, const RoomModel& model, const TrueSurface& truth) {
  RoomTruth result;
  result.placed_by = truth.placed_by;
  TriangleMesh room;
  for (const tv_room_vertex& vertex : model.vertices)
    room.places.push_back(truth.truth_from_world.of({static_cast<double>(vertex.position[0]),
                                                     static_cast<double>(vertex.position[1]),
                                                     static_cast<double>(vertex.position[2])}));
  for (const tv_room_triangle& triangle : model.triangles)
    room.triangles.push_back(
        {triangle.idx_vertex[0], triangle.idx_vertex[1], triangle.idx_vertex[2]});
  const TriangleTree truth_tree(truth.mesh);
  std::vector<SurfacePoint> true_points = even_points(truth.mesh, kSpacing, kMostPoints);
  if (!truth.pictures.empty()) true_points = thinned(true_points, kSpacing);
  const std::vector<Vector3> seen =
      seen_twice(true_points, truth_tree, scene, truth.truth_from_world);
  if (seen.empty())
    throw BadInput(
        "the true surface is not where the keyframes look: no point of it could be seen by two of "
        "them");
  result.share_of_truth =
      static_cast<double>(seen.size()) / static_cast<double>(true_points.size());
  std::vector<JudgedPoint> points;
  const std::vector<SurfacePoint> all = even_points(room, kSpacing, kMostPoints);
  std::vector<Vector3> places;
  for (const SurfacePoint& point : all) places.push_back(point.place);
  const std::vector<bool> judged = are_judged(truth.pictures, places);
  for (size_t i = 0; i < all.size(); ++i) {
    if (!judged[i]) continue;
    const SurfacePoint& point = all[i];
    const auto& corners = model.triangles[point.triangle].idx_vertex;
    const bool inferred = std::any_of(corners, corners + 3, [&model](int32_t idx) {
      return model.vertices[static_cast<size_t>(idx)].inferred != 0;
    });
    points.push_back({point.place, inferred});
  }
  if (!all.empty())
    result.share_judged = static_cast<double>(points.size()) / static_cast<double>(all.size());
  result.placed = scores_of(points, truth_tree, seen, TriangleTree(room));
  result.registration = registered(points, truth.mesh, truth_tree);
  for (JudgedPoint& point : points) point.place = result.registration.of(point.place);
  for (Vector3& place : room.places) place = result.registration.of(place);
  result.registered = scores_of(points, truth_tree, seen, TriangleTree(room));
  return result;
}

namespace {

using Json = nlohmann::ordered_json;

Json number_or_null(const std::optional<double>& value) { return value ? Json(*value) : Json(); }

Json scores_json(const TruthScores& scores) {
  Json json;
  json["precision_5cm"] = number_or_null(scores.precision);
  json["recall_5cm"] = scores.recall;
  json["f_5cm"] = scores.f;
  json["accuracy_median"] = number_or_null(scores.accuracy_median);
  json["completeness_median"] = number_or_null(scores.completeness_median);
  json["measured_precision_5cm"] = number_or_null(scores.precision_measured);
  json["inferred_precision_5cm"] = number_or_null(scores.precision_inferred);
  return json;
}

std::string scores_words(const TruthScores& scores) {
  char text[200];
  std::snprintf(text, sizeof text, "F %.3f (precision %.3f, recall %.3f)", scores.f,
                scores.precision.value_or(0), scores.recall);
  return text;
}

}  // namespace

nlohmann::ordered_json truth_json(const RoomTruth& truth) {
  Json json = scores_json(truth.placed);
  json["registered"] = scores_json(truth.registered);
  json["registered"]["scale"] = truth.registration.scale;
  json["registered"]["rotation"] = truth.registration.R;
  json["registered"]["translation"] = truth.registration.t;
  json["placed_by"] = truth.placed_by;
  json["share_judged"] = truth.share_judged;
  json["share_of_truth_seen"] = truth.share_of_truth;
  return json;
}

std::string truth_words(const RoomTruth& truth) {
  std::string text = scores_words(truth.placed) + " at 5 cm";
  char more[120];
  if (truth.placed.precision_measured && truth.placed.precision_inferred) {
    std::snprintf(more, sizeof more,
                  "; precision of what was measured %.3f, of what was inferred %.3f",
                  *truth.placed.precision_measured, *truth.placed.precision_inferred);
    text += more;
  }
  if (truth.placed.accuracy_median && truth.placed.completeness_median) {
    std::snprintf(more, sizeof more, "; median distance %.1f cm to the truth, %.1f cm from it",
                  100 * *truth.placed.accuracy_median, 100 * *truth.placed.completeness_median);
    text += more;
  }
  return text + "; registered " + scores_words(truth.registered) + "; placed by " + truth.placed_by;
}

}  // namespace cli
