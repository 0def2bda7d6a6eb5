// Guided matching. Formulas: docs/algorithms/match.md; test: test/unit/test_guided.c.
#include "match/guided.h"

#include <algorithm>
#include <cmath>
#include <cstdint>

namespace tv {
namespace {

constexpr int32_t kFar = INT32_MAX;

// Factor on the bound of quick_test, larger than any rounding error of that test: it may let
// keypoints outside the band through, but never rejects one inside.
constexpr double kSlack = 1.0 + 1e-6;

// A view and what the band test needs of each of its keypoints.
struct Side {
  GuidedView view;
  double* lines;           // 3 per keypoint: its epipolar line in the other view, M ray0 or M' ray1
  double* coordinates[3];  // x, y, z of the rays, for quick_test; padded to kBlock
  double* line_norms;      // squared lengths of `lines`; padded to kBlock
  double* slope_norms;     // squared Frobenius norms of the view's slopes; padded to kBlock
};

// The number of keypoints that one call of quick_test tests.
constexpr int32_t kBlock = 64;

size_t padded(int32_t count) { return (static_cast<size_t>(count) + kBlock - 1) / kBlock * kBlock; }

size_t side_bytes(int32_t count) {
  return arena_bytes<double>(3 * static_cast<size_t>(count)) +
         5 * arena_bytes<double>(padded(count));
}

double dot3(const double* a, const double* b) { return (a[0] * b[0] + a[1] * b[1]) + a[2] * b[2]; }

// The squared gradient of the residual by the pixel: |slopes' line|^2.
double squared_gradient(const double* slopes, const double* line) {
  double sum = 0;
  for (int c = 0; c < 2; ++c) {
    const double g = (slopes[c] * line[0] + slopes[2 + c] * line[1]) + slopes[4 + c] * line[2];
    sum += g * g;
  }
  return sum;
}

Side make_side(const GuidedView& view, const double* M, bool transposed, Arena& arena) {
  const size_t n = static_cast<size_t>(view.num), room = padded(view.num);
  Side side{view,
            arena_alloc<double>(arena, 3 * n),
            {arena_alloc<double>(arena, room), arena_alloc<double>(arena, room),
             arena_alloc<double>(arena, room)},
            arena_alloc<double>(arena, room),
            arena_alloc<double>(arena, room)};
  for (size_t k = n; k < room; ++k) {
    for (double* coordinate : side.coordinates) coordinate[k] = 0;
    side.line_norms[k] = side.slope_norms[k] = 0;
  }
  for (size_t k = 0; k < n; ++k) {
    double* line = side.lines + 3 * k;
    const double *ray = view.rays + 3 * k, *slope = view.slopes + 6 * k;
    for (int r = 0; r < 3; ++r) {
      const double row[3] = {transposed ? M[r] : M[3 * r], transposed ? M[3 + r] : M[3 * r + 1],
                             transposed ? M[6 + r] : M[3 * r + 2]};
      line[r] = dot3(row, ray);
      side.coordinates[r][k] = ray[r];
    }
    side.line_norms[k] = dot3(line, line);
    double sum = 0;
    for (int i = 0; i < 6; ++i) sum += slope[i] * slope[i];
    side.slope_norms[k] = sum;
  }
  return side;
}

// True when Sampson's distance of keypoint i of one side and keypoint j of the other is within the
// band. Exchanging the sides gives the same bits, because each sum has two terms that change
// places. The comparison is strict so that a pair at the epipoles, where both sides of it are zero,
// is rejected.
bool in_band(const Side& a, int32_t i, const Side& b, int32_t j, double band_sq) {
  const double residual = 0.5 * (dot3(a.lines + 3 * i, b.view.rays + 3 * j) +
                                 dot3(b.lines + 3 * j, a.view.rays + 3 * i));
  const double gradient = squared_gradient(b.view.slopes + 6 * j, a.lines + 3 * i) +
                          squared_gradient(a.view.slopes + 6 * i, b.lines + 3 * j);
  return residual * residual < band_sq * gradient;
}

// Sets excess[j] <= 0 for each keypoint of the block that may be in the band, since |J' l| <= |J|
// |l|; in_band decides about these. Most keypoints are far outside the band and are rejected here.
void quick_test(const double* line, double of_line, double of_slope, const Side& b, int32_t first,
                double* excess) {
  const double *x = b.coordinates[0] + first, *y = b.coordinates[1] + first,
               *z = b.coordinates[2] + first;
  const double *slope_norms = b.slope_norms + first, *line_norms = b.line_norms + first;
  for (int32_t j = 0; j < kBlock; ++j) {
    const double residual = (line[0] * x[j] + line[1] * y[j]) + line[2] * z[j];
    excess[j] = residual * residual - (of_line * slope_norms[j] + of_slope * line_norms[j]);
  }
}

bool neighbours(const tv_keypoint& a, const tv_keypoint& b, double radius) {
  const double dx = static_cast<double>(a.x) - b.x, dy = static_cast<double>(a.y) - b.y;
  return dx * dx + dy * dy <= radius * radius;
}

struct Nearest {
  int32_t dist, idx;
};

// The keypoints of the other view that are in the band of one keypoint, in ascending order, and
// their descriptor distances.
struct Candidates {
  int32_t *indices, *dists;
  int32_t count;
};

void find_candidates(const tvk_match_table& kernels, const Side& a, int32_t i, const Side& b,
                     double band_sq, Candidates* candidates) {
  candidates->count = 0;
  if (a.view.valid[i] == 0) return;
  const double* line = a.lines + 3 * i;
  const double of_line = band_sq * a.line_norms[i] * kSlack;
  const double of_slope = band_sq * a.slope_norms[i] * kSlack;
  double excess[kBlock];
  for (int32_t first = 0; first < b.view.num; first += kBlock) {
    quick_test(line, of_line, of_slope, b, first, excess);
    const int32_t last = std::min(first + kBlock, b.view.num);
    for (int32_t j = first; j < last; ++j) {
      if (!(excess[j - first] <= 0) || b.view.valid[j] == 0) continue;
      if (in_band(a, i, b, j, band_sq)) candidates->indices[candidates->count++] = j;
    }
  }
  kernels.squared_distances(a.view.descriptors + static_cast<int64_t>(i) * TV_DESCRIPTOR_BYTES,
                            b.view.descriptors, candidates->indices, candidates->count,
                            candidates->dists);
}

// The smallest descriptor distance among the candidates that are not within `radius` pixels of
// keypoint `best`; kFar if there is none.
int32_t rival_distance(const Candidates& candidates, const tv_keypoint* keypoints, int32_t best,
                       double radius) {
  int32_t rival = kFar;
  for (int32_t k = 0; k < candidates.count; ++k) {
    const int32_t dist = candidates.dists[k];
    const tv_keypoint& candidate = keypoints[candidates.indices[k]];
    if (dist < rival && !neighbours(candidate, keypoints[best], radius)) rival = dist;
  }
  return rival;
}

struct Row {
  int32_t dist, idx, rival;
};

// Finds the nearest candidate and its rival for each row (keypoint of view 0), and the nearest row
// for each column (keypoint of view 1). Rows and candidates are visited in ascending order, so that
// the lower index wins a tie on both sides.
void find_nearest(const tvk_match_table& kernels, const Side& side0, const Side& side1,
                  double band_sq, double radius, Candidates* candidates, Row* rows,
                  Nearest* columns) {
  std::fill(columns, columns + side1.view.num, Nearest{kFar, -1});
  for (int32_t i = 0; i < side0.view.num; ++i) {
    find_candidates(kernels, side0, i, side1, band_sq, candidates);
    Row row{kFar, -1, kFar};
    for (int32_t k = 0; k < candidates->count; ++k) {
      const int32_t dist = candidates->dists[k], j = candidates->indices[k];
      if (dist < row.dist) row.dist = dist, row.idx = j;
      if (dist < columns[j].dist) columns[j] = Nearest{dist, i};
    }
    if (row.idx >= 0) {
      row.rival = rival_distance(*candidates, side1.view.keypoints, row.idx, radius);
    }
    rows[i] = row;
  }
}

// The ratio of two squared distances as a ratio of distances; 1 if the rival's distance is 0. It is
// above 1 if the nearest descriptor is farther than max_distance.
float distance_ratio(int32_t best, double rival) {
  return rival > 0 ? static_cast<float>(std::sqrt(best / rival)) : 1.0f;
}

}  // namespace

size_t guided_view_bytes(int32_t max_keypoints) {
  const size_t n = static_cast<size_t>(max_keypoints);
  return arena_bytes<double>(3 * n) + arena_bytes<double>(6 * n) + arena_bytes<uint8_t>(n);
}

size_t guided_bytes(int32_t max_keypoints) {
  const size_t n = static_cast<size_t>(max_keypoints);
  return 2 * side_bytes(max_keypoints) + 2 * arena_bytes<int32_t>(n) + arena_bytes<Nearest>(n) +
         arena_bytes<Row>(n);
}

int32_t match_guided(const tvk_set& set, const GuidedView& view0, const GuidedView& view1,
                     const double M[9], const tv_guided_options& options, Arena& arena,
                     tv_correspondence* correspondences) {
  if (view0.num == 0 || view1.num == 0) return 0;
  const tvk_match_table& kernels = *tvk_match_of(&set);
  ArenaScope scope(arena);
  const Side side0 = make_side(view0, M, false, arena);
  const Side side1 = make_side(view1, M, true, arena);
  Row* rows = arena_alloc<Row>(arena, static_cast<size_t>(view0.num));
  Nearest* columns = arena_alloc<Nearest>(arena, static_cast<size_t>(view1.num));
  const size_t most = static_cast<size_t>(std::max(view0.num, view1.num));
  Candidates candidates{arena_alloc<int32_t>(arena, most), arena_alloc<int32_t>(arena, most), 0};
  const double band_sq = static_cast<double>(options.max_error_px) * options.max_error_px;
  const double radius = options.neighbourhood_px;
  const double largest = static_cast<double>(options.max_distance) * options.max_distance;
  find_nearest(kernels, side0, side1, band_sq, radius, &candidates, rows, columns);
  int32_t count = 0;
  for (int32_t i = 0; i < view0.num; ++i) {
    const int32_t j = rows[i].idx, best = rows[i].dist;
    if (j < 0 || columns[j].idx != i) continue;
    double rival = std::min(static_cast<double>(rows[i].rival), largest);
    if (distance_ratio(best, rival) >= options.ratio) continue;
    find_candidates(kernels, side1, j, side0, band_sq, &candidates);
    const int32_t back = rival_distance(candidates, view0.keypoints, i, radius);
    rival = std::min(rival, static_cast<double>(back));
    const float ratio = distance_ratio(best, rival);
    if (ratio >= options.ratio) continue;
    correspondences[count++] = tv_correspondence{i, j, static_cast<uint32_t>(best), ratio};
  }
  return count;
}

}  // namespace tv
