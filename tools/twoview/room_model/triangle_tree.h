// Triangles in a tree of boxes, which finds the triangle nearest to a point, and whether one lies
// between two points.
#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <vector>

#include "base/matrix.h"

namespace cli {

// A surface of triangles.
struct TriangleMesh {
  std::vector<Vector3> places;                    // of the vertices
  std::vector<std::array<int32_t, 3>> triangles;  // indices into places
};

class TriangleTree {
 public:
  // The mesh is read as long as the tree lives.
  explicit TriangleTree(const TriangleMesh& mesh);

  struct Nearest {
    double distance = INFINITY;
    Vector3 place{0, 0, 0};
    size_t triangle = 0;
  };
  bool is_empty() const { return nodes_.empty(); }
  // The place of the surface that is nearest to the point, if it is nearer than `within`.
  Nearest nearest(const Vector3& point, double within = INFINITY) const;

  // Whether a triangle crosses the way between the eye and the point, but for its last part of the
  // length `margin`.
  bool is_blocked(const Vector3& eye, const Vector3& point, double margin) const;

 private:
  struct Box {
    Vector3 low{INFINITY, INFINITY, INFINITY}, high{-INFINITY, -INFINITY, -INFINITY};
  };
  struct Node {
    Box box;
    uint32_t first = 0, count = 0;  // of order_; count 0: two nodes, the next one and `first`
  };
  void build(uint32_t first, uint32_t count, const std::vector<Box>& boxes);
  const Vector3& corner(size_t triangle, size_t k) const {
    return mesh_.places[static_cast<size_t>(mesh_.triangles[triangle][k])];
  }

  const TriangleMesh& mesh_;
  std::vector<uint32_t> order_;  // triangles
  std::vector<Node> nodes_;
};

// A point of a surface, and the triangle in which it lies.
struct SurfacePoint {
  Vector3 place;
  size_t triangle;
};

// Points that lie evenly on the triangles: one for each square of the side `spacing`, which is
// enlarged where that would be more than `most` points. The same ones each time.
std::vector<SurfacePoint> even_points(const TriangleMesh& mesh, double spacing, size_t most);

}  // namespace cli
