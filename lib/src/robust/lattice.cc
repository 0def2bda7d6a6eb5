#include "robust/lattice.h"

#include <algorithm>
#include <cmath>

namespace tv {
namespace {

// The points are sorted by the cells of a grid that has about as many cells as there are points, so
// that those of neighbouring cells of a row follow one another. A search examines at most kMostSeen
// points, so that points in one heap cost no more than points that are spread.
constexpr int kMostSide = 64, kNeighbours = 6, kMostSeen = 64;
// The share of a list needs fewer points than the excess over chance among all points.
constexpr int kMostAsked = 512, kMostListed = 64;
constexpr double kOpposite = 0.14;  // the tolerated distance from the opposite place, as a part of
                                    // the neighbour's distance
constexpr double kNearestPx = 8;    // nearer neighbours (pixels) cannot be distinguished from noise
// The count that chance explains is taken at a place where no usual lattice has a point: the
// neighbour's place after a turn by 146 degrees instead of 180.
constexpr double kControlCosine = -0.829, kControlSine = 0.559;

struct Place {
  double x, y;
};

struct Grid {
  double low[2], inverse[2];
  int side;
  int32_t* first;  // side^2 + 1 entries: the points of cell c are first[c] to first[c + 1] - 1
  Place* points;

  int cell(double value, int axis) const {
    const double place = (value - low[axis]) * inverse[axis];
    return place > 0 ? (place < side - 1 ? static_cast<int>(place) : side - 1) : 0;
  }
  int cell(double x, double y) const { return side * cell(y, 1) + cell(x, 0); }
};

int grid_side(int num) {
  int side = 1;
  while (side < kMostSide && side * side < num) ++side;
  return side;
}

Grid make_grid(const double* xy, int num, Arena& arena) {
  const int side = grid_side(num), num_cells = side * side;
  Grid grid{{0, 0},
            {0, 0},
            side,
            arena_alloc<int32_t>(arena, static_cast<size_t>(num_cells) + 1),
            arena_alloc<Place>(arena, static_cast<size_t>(num))};
  for (int axis = 0; axis < 2; ++axis) {
    double low = xy[axis], high = low;
    for (int i = 1; i < num; ++i) {
      low = std::min(low, xy[2 * i + axis]);
      high = std::max(high, xy[2 * i + axis]);
    }
    grid.low[axis] = low;
    grid.inverse[axis] = high > low ? side / (high - low) : 0;
  }
  // A counting sort: first[c] is the end of cell c at first, and is lowered with each point of the
  // cell that is stored, so that it becomes the index of the cell's first point.
  for (int c = 0; c <= num_cells; ++c) grid.first[c] = 0;
  for (int i = 0; i < num; ++i) ++grid.first[grid.cell(xy[2 * i], xy[2 * i + 1])];
  for (int c = 1; c <= num_cells; ++c) grid.first[c] += grid.first[c - 1];
  for (int i = num - 1; i >= 0; --i) {
    const Place point{xy[2 * i], xy[2 * i + 1]};
    grid.points[--grid.first[grid.cell(point.x, point.y)]] = point;
  }
  return grid;
}

struct Neighbour {
  double dist_sq;
  double dx, dy;
};

// The points nearest to one that are at least kNearestPx away, nearest first.
struct Nearest {
  Neighbour found[kNeighbours];
  int num = 0, seen = 0;

  // Takes the points of the cells from one to another of a row.
  void add(const Grid& grid, Place from, int first_cell, int last_cell) {
    const int end = grid.first[last_cell + 1];
    for (int j = grid.first[first_cell]; j < end && seen < kMostSeen; ++j) {
      const double dx = grid.points[j].x - from.x, dy = grid.points[j].y - from.y;
      const double dist_sq = dx * dx + dy * dy;
      if (dist_sq < kNearestPx * kNearestPx) continue;
      ++seen;
      if (num == kNeighbours && dist_sq >= found[num - 1].dist_sq) continue;
      int place = num < kNeighbours ? num++ : num - 1;
      for (; place > 0 && found[place - 1].dist_sq > dist_sq; --place) {
        found[place] = found[place - 1];
      }
      found[place] = Neighbour{dist_sq, dx, dy};
    }
  }
};

// Searches ring by ring around the cell of `from`.
Nearest nearest_points(const Grid& grid, Place from) {
  Nearest nearest;
  const int column = grid.cell(from.x, 0), row = grid.cell(from.y, 1), last = grid.side - 1;
  for (int ring = 0; ring < grid.side && nearest.seen < kMostSeen; ++ring) {
    if (ring > 1 && nearest.num == kNeighbours && nearest.seen >= 2 * kNeighbours) break;
    const int left = column - ring, right = column + ring;
    for (int r = std::max(0, row - ring); r <= std::min(last, row + ring); ++r) {
      const int start = grid.side * r;
      if (r == row - ring || r == row + ring) {
        nearest.add(grid, from, start + std::max(0, left), start + std::min(last, right));
      } else {
        if (left >= 0) nearest.add(grid, from, start + left, start + left);
        if (right <= last) nearest.add(grid, from, start + right, start + right);
      }
    }
  }
  return nearest;
}

bool point_near(const Grid& grid, Place p, double radius) {
  const int c0 = grid.cell(p.x - radius, 0), c1 = grid.cell(p.x + radius, 0);
  const int r0 = grid.cell(p.y - radius, 1), r1 = grid.cell(p.y + radius, 1);
  int seen = 0;
  for (int r = r0; r <= r1; ++r) {
    const int end = grid.first[grid.side * r + c1 + 1];
    for (int j = grid.first[grid.side * r + c0]; j < end; ++j) {
      const double dx = grid.points[j].x - p.x, dy = grid.points[j].y - p.y;
      if (dx * dx + dy * dy <= radius * radius) return true;
      if (++seen == kMostSeen) return false;
    }
  }
  return false;
}

// The number of neighbours that have a point where they lie after a turn about `from`.
int count_partners(const Grid& grid, Place from, const Nearest& nearest, double cosine,
                   double sine) {
  int partners = 0;
  for (int k = 0; k < nearest.num; ++k) {
    const Neighbour& n = nearest.found[k];
    const Place turned{from.x + (cosine * n.dx - sine * n.dy),
                       from.y + (sine * n.dx + cosine * n.dy)};
    partners += point_near(grid, turned, kOpposite * std::sqrt(n.dist_sq));
  }
  return partners;
}

struct Counts {
  int neighbours = 0, opposite = 0, control = 0;
};

// Counts the partners of the neighbours: of the listed points, or of all if listed is null. Without
// `bound`, also those of the control; with it, ends with zeros as soon as at most `bound` of the
// neighbours can have an opposite partner.
Counts count_all(const double* xy, int num, const int32_t* listed, int num_listed,
                 const double* bound, Arena& arena) {
  Counts counts;
  const int asked = listed != nullptr ? num_listed : num;
  if (asked == 0 || num < 3) return counts;
  ArenaScope scope(arena);
  const Grid grid = make_grid(xy, num, arena);
  const int taken = std::min(asked, listed != nullptr ? kMostListed : kMostAsked);
  for (int k = 0; k < taken; ++k) {
    const int left = kNeighbours * (taken - k);
    if (bound != nullptr && counts.opposite + left <= *bound * (counts.neighbours + left)) {
      return {};
    }
    const int place = static_cast<int>(static_cast<int64_t>(k) * asked / taken);
    const int i = listed != nullptr ? listed[place] : place;
    const Place from{xy[2 * i], xy[2 * i + 1]};
    const Nearest nearest = nearest_points(grid, from);
    counts.neighbours += nearest.num;
    counts.opposite += count_partners(grid, from, nearest, -1, 0);
    if (bound == nullptr) {
      counts.control += count_partners(grid, from, nearest, kControlCosine, kControlSine);
    }
  }
  return counts;
}

}  // namespace

size_t lattice_bytes(int max_points) {
  const size_t side = static_cast<size_t>(grid_side(max_points));
  return arena_bytes<int32_t>(side * side + 1) +
         arena_bytes<Place>(static_cast<size_t>(max_points));
}

double opposite_share(const double* xy, int num, const int32_t* listed, int num_listed,
                      double least, Arena& arena) {
  const Counts counts = count_all(xy, num, listed, num_listed, &least, arena);
  return counts.opposite > 0 ? static_cast<double>(counts.opposite) / counts.neighbours : 0;
}

Lattice find_lattice(const double* xy, int num, const int32_t* listed, int num_listed,
                     Arena& arena) {
  const Counts counts = count_all(xy, num, listed, num_listed, nullptr, arena);
  if (counts.opposite <= counts.control) return {0, 0};
  const double excess = counts.opposite - counts.control;
  return {excess / counts.neighbours, excess / std::sqrt(1.0 + counts.opposite + counts.control)};
}

}  // namespace tv
