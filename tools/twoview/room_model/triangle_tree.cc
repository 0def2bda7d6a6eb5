#include "room_model/triangle_tree.h"

#include <algorithm>
#include <numeric>

namespace cli {
namespace {

constexpr uint32_t kMostInLeaf = 4;

// a + s u + t v
Vector3 along(const Vector3& a, double s, const Vector3& u, double t, const Vector3& v) {
  return {a[0] + s * u[0] + t * v[0], a[1] + s * u[1] + t * v[1], a[2] + s * u[2] + t * v[2]};
}

// The point of a triangle that is nearest to p: C. Ericson, "Real-Time Collision Detection", 2005,
// section 5.1.5. Triangles without an area are taken as their edges.
Vector3 nearest_in(const Vector3& a, const Vector3& b, const Vector3& c, const Vector3& p) {
  const Vector3 ab = minus(b, a), ac = minus(c, a), ap = minus(p, a);
  const double d1 = dot(ab, ap), d2 = dot(ac, ap);
  if (d1 <= 0 && d2 <= 0) return a;
  const Vector3 bp = minus(p, b);
  const double d3 = dot(ab, bp), d4 = dot(ac, bp);
  if (d3 >= 0 && d4 <= d3) return b;
  const double vc = d1 * d4 - d3 * d2;
  if (vc <= 0 && d1 >= 0 && d3 <= 0) return along(a, d1 / (d1 - d3), ab, 0, ac);
  const Vector3 cp = minus(p, c);
  const double d5 = dot(ab, cp), d6 = dot(ac, cp);
  if (d6 >= 0 && d5 <= d6) return c;
  const double vb = d5 * d2 - d1 * d6;
  if (vb <= 0 && d2 >= 0 && d6 <= 0) return along(a, 0, ab, d2 / (d2 - d6), ac);
  const double va = d3 * d6 - d5 * d4;
  if (va <= 0 && d4 >= d3 && d5 >= d6) {
    const double w = (d4 - d3) / ((d4 - d3) + (d5 - d6));
    return along(b, w, minus(c, b), 0, ac);
  }
  const double sum = va + vb + vc;
  if (!(sum > 0)) return a;
  return along(a, vb / sum, ab, vc / sum, ac);
}

// Where the ray eye + s way meets the triangle, as s; infinite where it does not: T. Moeller, B.
// Trumbore, "Fast, minimum storage ray-triangle intersection", Journal of Graphics Tools 2(1),
// 1997.
double meeting(const Vector3& eye, const Vector3& way, const Vector3& a, const Vector3& b,
               const Vector3& c) {
  const Vector3 ab = minus(b, a), ac = minus(c, a), across = cross(way, ac);
  const double determinant = dot(ab, across);
  if (determinant == 0) return INFINITY;
  const Vector3 from = minus(eye, a);
  const double u = dot(from, across) / determinant;
  if (u < 0 || u > 1) return INFINITY;
  const Vector3 turned = cross(from, ab);
  const double v = dot(way, turned) / determinant;
  if (v < 0 || u + v > 1) return INFINITY;
  return dot(ac, turned) / determinant;
}

}  // namespace

TriangleTree::TriangleTree(const TriangleMesh& mesh) : mesh_(mesh), order_(mesh.triangles.size()) {
  std::iota(order_.begin(), order_.end(), 0u);
  std::vector<Box> boxes(order_.size());
  for (size_t t = 0; t < boxes.size(); ++t) {
    for (size_t k = 0; k < 3; ++k) {
      for (size_t axis = 0; axis < 3; ++axis) {
        boxes[t].low[axis] = std::min(boxes[t].low[axis], corner(t, k)[axis]);
        boxes[t].high[axis] = std::max(boxes[t].high[axis], corner(t, k)[axis]);
      }
    }
  }
  nodes_.reserve(order_.size());
  if (!order_.empty()) build(0, static_cast<uint32_t>(order_.size()), boxes);
}

void TriangleTree::build(uint32_t first, uint32_t count, const std::vector<Box>& boxes) {
  const size_t own = nodes_.size();
  nodes_.emplace_back();
  Box box, middles;
  const auto middle = [&boxes](uint32_t t, size_t axis) {
    return boxes[t].low[axis] + boxes[t].high[axis];
  };
  for (uint32_t i = first; i < first + count; ++i) {
    for (size_t axis = 0; axis < 3; ++axis) {
      const uint32_t t = order_[i];
      box.low[axis] = std::min(box.low[axis], boxes[t].low[axis]);
      box.high[axis] = std::max(box.high[axis], boxes[t].high[axis]);
      middles.low[axis] = std::min(middles.low[axis], middle(t, axis));
      middles.high[axis] = std::max(middles.high[axis], middle(t, axis));
    }
  }
  nodes_[own].box = box;
  if (count <= kMostInLeaf) {
    nodes_[own].first = first;
    nodes_[own].count = count;
    return;
  }
  size_t axis = 0;
  for (size_t k = 1; k < 3; ++k)
    if (middles.high[k] - middles.low[k] > middles.high[axis] - middles.low[axis]) axis = k;
  const auto begin = order_.begin() + first;
  std::nth_element(begin, begin + count / 2, begin + count, [&](uint32_t a, uint32_t b) {
    const double x = middle(a, axis), y = middle(b, axis);
    return x != y ? x < y : a < b;
  });
  build(first, count / 2, boxes);
  nodes_[own].first = static_cast<uint32_t>(nodes_.size());
  build(first + count / 2, count - count / 2, boxes);
}

TriangleTree::Nearest TriangleTree::nearest(const Vector3& point, double within) const {
  Nearest best;
  best.distance = within;
  if (nodes_.empty()) return {};
  double best_sq = within * within;
  bool found = false;
  const auto distance_sq = [&point](const Box& box) {
    double sum = 0;
    for (size_t axis = 0; axis < 3; ++axis) {
      const double beyond =
          std::max({box.low[axis] - point[axis], point[axis] - box.high[axis], 0.0});
      sum += beyond * beyond;
    }
    return sum;
  };
  struct Open {
    double distance_sq;
    uint32_t node;
  };
  Open open[64];  // the tree's depth is at most 32, and one node a level waits
  int count = 0;
  open[count++] = {distance_sq(nodes_[0].box), 0};
  while (count > 0) {
    const Open next = open[--count];
    if (!(next.distance_sq < best_sq)) continue;
    const Node& node = nodes_[next.node];
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const size_t t = order_[i];
      const Vector3 place = nearest_in(corner(t, 0), corner(t, 1), corner(t, 2), point);
      const Vector3 away = minus(place, point);
      const double away_sq = dot(away, away);
      if (!(away_sq < best_sq)) continue;
      best_sq = away_sq;
      best.place = place;
      best.triangle = t;
      found = true;
    }
    if (node.count > 0) continue;
    Open near = {distance_sq(nodes_[next.node + 1].box), next.node + 1};
    Open far = {distance_sq(nodes_[node.first].box), node.first};
    if (far.distance_sq < near.distance_sq) std::swap(near, far);
    open[count++] = far;
    open[count++] = near;
  }
  if (!found) return {};
  best.distance = std::sqrt(best_sq);
  return best;
}

bool TriangleTree::is_blocked(const Vector3& eye, const Vector3& point, double margin) const {
  const Vector3 way = minus(point, eye);
  const double length = norm(way), end = length > 0 ? 1 - margin / length : 0;
  if (!(end > 0) || nodes_.empty()) return false;
  const auto crosses = [&](const Box& box) {
    double enter = 0, leave = end;
    for (size_t axis = 0; axis < 3; ++axis) {
      if (way[axis] == 0) {
        if (eye[axis] < box.low[axis] || eye[axis] > box.high[axis]) return false;
        continue;
      }
      const double a = (box.low[axis] - eye[axis]) / way[axis];
      const double b = (box.high[axis] - eye[axis]) / way[axis];
      enter = std::max(enter, std::min(a, b));
      leave = std::min(leave, std::max(a, b));
    }
    return enter <= leave;
  };
  uint32_t open[64];
  int count = 0;
  open[count++] = 0;
  while (count > 0) {
    const uint32_t number = open[--count];
    const Node& node = nodes_[number];
    if (!crosses(node.box)) continue;
    for (uint32_t i = node.first; i < node.first + node.count; ++i) {
      const size_t t = order_[i];
      const double at = meeting(eye, way, corner(t, 0), corner(t, 1), corner(t, 2));
      if (at > 0 && at < end) return true;
    }
    if (node.count > 0) continue;
    open[count++] = node.first;
    open[count++] = number + 1;
  }
  return false;
}

std::vector<SurfacePoint> even_points(const TriangleMesh& mesh, double spacing, size_t most) {
  const auto corner = [&mesh](size_t t, size_t k) {
    return mesh.places[static_cast<size_t>(mesh.triangles[t][k])];
  };
  std::vector<double> areas;
  double area = 0;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3 a = corner(t, 0);
    areas.push_back(0.5 * norm(cross(minus(corner(t, 1), a), minus(corner(t, 2), a))));
    area += areas.back();
  }
  const double square = std::max(spacing * spacing, area / static_cast<double>(most));
  std::vector<SurfacePoint> points;
  double due = 0.5;  // points; what a triangle has too little for one goes on to the next
  double u = 0.5, v = 0.5;
  for (size_t t = 0; t < mesh.triangles.size(); ++t) {
    const Vector3 a = corner(t, 0), ab = minus(corner(t, 1), a), ac = minus(corner(t, 2), a);
    for (due += areas[t] / square; due >= 1; --due) {
      // M. Roberts, "The unreasonable effectiveness of quasirandom sequences", 2018: R2.
      u = std::fmod(u + 0.7548776662466927, 1);
      v = std::fmod(v + 0.5698402909980532, 1);
      const bool beyond = u + v > 1;
      points.push_back({along(a, beyond ? 1 - u : u, ab, beyond ? 1 - v : v, ac), t});
    }
  }
  return points;
}

}  // namespace cli
