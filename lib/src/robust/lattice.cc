#include "robust/lattice.h"

#include <algorithm>
#include <cmath>

namespace tv {
namespace {

// The points are kept in the cells of a grid that has about as many cells as there are points. A
// search examines at most kMostSeen points, so that points in one heap cost no more than points
// that are spread.
constexpr int kMostSide = 64, kNeighbours = 6, kMostSeen = 64;
// The share of a list needs fewer points than the excess over chance among all points.
constexpr int kMostAsked = 512, kMostListed = 64;
constexpr double kOpposite = 0.14;  // the tolerated distance from the opposite place, as a part of
                                    // the neighbour's distance
constexpr double kNearestPx = 8;    // nearer neighbours (pixels) cannot be distinguished from noise
// The count that chance explains is taken at a place where no usual lattice has a point: the
// neighbour's place after a turn by 146 degrees instead of 180.
constexpr double kControlCosine = -0.829, kControlSine = 0.559;

struct Grid {
  const double* xy;
  double low[2], inverse[2];
  int side;
  int32_t* first;  // the first point of each of side^2 cells; -1: none
  int32_t* next;   // the next point of the same cell, num entries; -1: none

  int cell(double value, int axis) const {
    const double place = (value - low[axis]) * inverse[axis];
    return place > 0 ? (place < side - 1 ? static_cast<int>(place) : side - 1) : 0;
  }
};

int grid_side(int num) {
  int side = 1;
  while (side < kMostSide && side * side < num) ++side;
  return side;
}

Grid make_grid(const double* xy, int num, Arena& arena) {
  const int side = grid_side(num);
  Grid grid{xy,
            {0, 0},
            {0, 0},
            side,
            arena_alloc<int32_t>(arena, static_cast<size_t>(side * side)),
            arena_alloc<int32_t>(arena, static_cast<size_t>(num))};
  for (int axis = 0; axis < 2; ++axis) {
    double low = xy[axis], high = low;
    for (int i = 1; i < num; ++i) {
      low = std::min(low, xy[2 * i + axis]);
      high = std::max(high, xy[2 * i + axis]);
    }
    grid.low[axis] = low;
    grid.inverse[axis] = high > low ? side / (high - low) : 0;
  }
  for (int c = 0; c < side * side; ++c) grid.first[c] = -1;
  for (int i = num - 1; i >= 0; --i) {
    int32_t& head = grid.first[side * grid.cell(xy[2 * i + 1], 1) + grid.cell(xy[2 * i], 0)];
    grid.next[i] = head;
    head = i;
  }
  return grid;
}

struct Neighbour {
  double dist_sq;
  double dx, dy;
};

// The nearest points that are at least kNearestPx away, nearest first. Returns how many there are.
int nearest_points(const Grid& grid, int i, Neighbour* nearest) {
  const double x = grid.xy[2 * i], y = grid.xy[2 * i + 1];
  const int column = grid.cell(x, 0), row = grid.cell(y, 1);
  int found = 0, seen = 0;
  for (int ring = 0; ring < grid.side && seen < kMostSeen; ++ring) {
    if (ring > 1 && found == kNeighbours && seen >= 2 * kNeighbours) break;
    for (int r = std::max(0, row - ring); r <= std::min(grid.side - 1, row + ring); ++r) {
      const bool edge = r == row - ring || r == row + ring;
      for (int c = column - ring; c <= column + ring; c += edge || ring == 0 ? 1 : 2 * ring) {
        if (c < 0 || c >= grid.side) continue;
        for (int32_t j = grid.first[grid.side * r + c]; j >= 0 && seen < kMostSeen;
             j = grid.next[j]) {
          const double dx = grid.xy[2 * j] - x, dy = grid.xy[2 * j + 1] - y;
          const double dist_sq = dx * dx + dy * dy;
          if (dist_sq < kNearestPx * kNearestPx) continue;
          ++seen;
          if (found == kNeighbours && dist_sq >= nearest[found - 1].dist_sq) continue;
          int place = found < kNeighbours ? found++ : found - 1;
          for (; place > 0 && nearest[place - 1].dist_sq > dist_sq; --place) {
            nearest[place] = nearest[place - 1];
          }
          nearest[place] = Neighbour{dist_sq, dx, dy};
        }
      }
    }
  }
  return found;
}

bool point_near(const Grid& grid, double x, double y, double radius) {
  const int c0 = grid.cell(x - radius, 0), c1 = grid.cell(x + radius, 0);
  const int r0 = grid.cell(y - radius, 1), r1 = grid.cell(y + radius, 1);
  int seen = 0;
  for (int r = r0; r <= r1; ++r) {
    for (int c = c0; c <= c1; ++c) {
      for (int32_t j = grid.first[grid.side * r + c]; j >= 0; j = grid.next[j]) {
        const double dx = grid.xy[2 * j] - x, dy = grid.xy[2 * j + 1] - y;
        if (dx * dx + dy * dy <= radius * radius) return true;
        if (++seen == kMostSeen) return false;
      }
    }
  }
  return false;
}

// The number of neighbours that have a point where they lie after a turn about point i.
int count_partners(const Grid& grid, int i, const Neighbour* nearest, int count, double cosine,
                   double sine) {
  int partners = 0;
  for (int k = 0; k < count; ++k) {
    const Neighbour& n = nearest[k];
    partners += point_near(grid, grid.xy[2 * i] + (cosine * n.dx - sine * n.dy),
                           grid.xy[2 * i + 1] + (sine * n.dx + cosine * n.dy),
                           kOpposite * std::sqrt(n.dist_sq));
  }
  return partners;
}

}  // namespace

size_t lattice_bytes(int max_points) {
  const size_t side = static_cast<size_t>(grid_side(max_points));
  return arena_bytes<int32_t>(side * side) + arena_bytes<int32_t>(static_cast<size_t>(max_points));
}

Lattice find_lattice(const double* xy, int num, const int32_t* listed, int num_listed,
                     Arena& arena) {
  const int asked = listed != nullptr ? num_listed : num;
  if (asked == 0 || num < 3) return {0, 0};
  ArenaScope scope(arena);
  const Grid grid = make_grid(xy, num, arena);
  const int most = listed != nullptr ? kMostListed : kMostAsked;
  const int taken = asked < most ? asked : most;
  int opposite = 0, control = 0, num_neighbours = 0;
  for (int k = 0; k < taken; ++k) {
    const int place = static_cast<int>(static_cast<int64_t>(k) * asked / taken);
    const int i = listed != nullptr ? listed[place] : place;
    Neighbour nearest[kNeighbours];
    const int found = nearest_points(grid, i, nearest);
    opposite += count_partners(grid, i, nearest, found, -1, 0);
    control += count_partners(grid, i, nearest, found, kControlCosine, kControlSine);
    num_neighbours += found;
  }
  if (opposite <= control) return {0, 0};
  const double excess = opposite - control;
  return {excess / num_neighbours, excess / std::sqrt(1.0 + opposite + control)};
}

}  // namespace tv
