#include "robust/evidence.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "base/order.h"
#include "geometry/sampson.h"
#include "geometry/transfer.h"
#include "robust/calibration.h"
#include "robust/lattice.h"
#include "robust/ldlt.h"
#include "robust/models.h"
#include "robust/second_model.h"

namespace tv {
namespace {

// A number that increases with the angle between a match's rays after the rotation was removed:
// from 0 to 2 for 0 to 180 degrees.
double pseudo_angle(const Fit& f, int i) {
  const RayPairs& pairs = f.matches.pairs;
  const double b[3] = {pairs.ray[1][0][i], pairs.ray[1][1][i], pairs.ray[1][2][i]};
  double a[3], across[3];
  turn_ray0(pairs, i, f.out->epipolar.pose.R, a);
  cross(a, b, across);
  const double sine = std::sqrt(dot(across, across)), cosine = dot(a, b);
  return cosine > 0 ? sine / (sine + cosine) : 1 - cosine / (sine - cosine);
}

double angle_of_pseudo(double p) { return p < 1 ? atan2(p, 1 - p) : atan2(2 - p, 1 - p); }

// The distance of the support's rays of one view from the plane nearest to them, root mean square,
// in pixels: small for the rays of points on a line.
double line_distance_px(const Fit& f, int view) {
  double xx = 0, xy = 0, xz = 0, yy = 0, yz = 0, zz = 0;
  for (int k = 0; k < f.num_support; ++k) {
    const int i = f.support[k];
    double* const* ray = f.matches.pairs.ray[view];
    const double x = ray[0][i], y = ray[1][i], z = ray[2][i];
    const double weight = 1 / ((x * x + y * y) + z * z);
    xx += weight * x * x;
    xy += weight * x * y;
    xz += weight * x * z;
    yy += weight * y * y;
    yz += weight * y * z;
    zz += weight * z * z;
  }
  Mat3 sum;
  sum << xx, xy, xz, xy, yy, yz, xz, yz, zz;
  return std::sqrt(svd3(sum).s[2] / f.num_support) / f.out->evidence->pixel_angle_rad;
}

struct Box {
  double low[2], high[2];
};

// The view's image or, uncalibrated, the box around its points.
Box image_box(const Fit& f, int view) {
  const TwoViewProblem& problem = f.problem;
  if (problem.calibrated) {
    const tv_camera& camera = problem.camera[view].model;
    return {{-0.5, -0.5}, {camera.width - 0.5, camera.height - 0.5}};
  }
  const double* pixels = problem.pixels[view];
  Box box = {};
  for (int k = 0; k < f.matches.num_all; ++k) {
    for (int d = 0; d < 2; ++d) {
      const double x = pixels[2 * f.matches.order[k] + d];
      if (k == 0 || x < box.low[d]) box.low[d] = x;
      if (k == 0 || x > box.high[d]) box.high[d] = x;
    }
  }
  return box;
}

// The cell of a grid on the box that holds match k: its column and row. A point outside the box
// counts in the nearest cell.
void find_cell(const Fit& f, int view, const Box& box, const int grid[2], int k, int cell[2]) {
  for (int d = 0; d < 2; ++d) {
    const double x = f.problem.pixels[view][2 * f.matches.order[k] + d];
    const double place = grid[d] * (x - box.low[d]) / (box.high[d] - box.low[d]);
    const int last = grid[d] - 1;
    cell[d] = place >= last ? last : (place > 0 ? static_cast<int>(place) : 0);
  }
}

// The number of cells of a grid on the box that hold an inlier. The grid has at most 64 columns and
// rows.
int filled_cells(const Fit& f, int view, const Box& box, const int grid[2]) {
  uint64_t filled[64] = {};
  int count = 0;
  for (int k = 0; k < f.matches.num_all; ++k) {
    if (f.out->inlier[k] == 0) continue;
    int cell[2];
    find_cell(f, view, box, grid, k, cell);
    const uint64_t bit = uint64_t{1} << cell[0];
    count += (filled[cell[1]] & bit) == 0;
    filled[cell[1]] |= bit;
  }
  return count;
}

// The share of an 8x8 grid that holds an inlier, and the number of places: of cells of 32 pixels,
// or of a 16th of the longer side where the image is small, a 64th where it is large.
void measure_spread(const Fit& f, int view, Evidence& evidence) {
  const Box box = image_box(f, view);
  const double sides[2] = {box.high[0] - box.low[0], box.high[1] - box.low[1]};
  const double longer = std::max(sides[0], sides[1]);
  const double cell = std::max(std::min(32.0, longer / 16), longer / 64);
  const int eighths[2] = {8, 8};
  int places[2];
  for (int d = 0; d < 2; ++d) {
    // One cell where the box is empty or not finite, whose ratio is not a number.
    const double cells = sides[d] / cell + 0.5;
    places[d] = cells >= 1 && cells < 65 ? static_cast<int>(cells) : 1;
  }
  evidence.coverage[view] = filled_cells(f, view, box, eighths) / 64.0;
  evidence.num_places[view] = filled_cells(f, view, box, places);
}

// The share of the different matches that are inliers, each weighted by (1 - ratio)^2: a match
// whose second nearest is as near says little about the pose, and one without a rival much. Without
// ratios, or where they give no weight, the plain share.
double agreement_of(const Fit& f) {
  double agree = 0, sum = 0, inliers = 0;
  const int n = f.matches.num_unique();
  for (int i = 0; i < n; ++i) {
    double certain = 1;
    if (f.problem.ratios != nullptr) {
      certain = 1 - static_cast<double>(f.problem.ratios[f.matches.order[i]]);
      certain = certain < 1 ? std::max(certain, 0.0) : 1;
    }
    const double weight = certain * certain;
    sum += weight;
    if (f.out->inlier[i] == 0) continue;
    agree += weight;
    ++inliers;
  }
  if (sum > 0) return agree / sum;
  return n > 0 ? inliers / n : 0;
}

// The normal equations of the pose over some of its inliers.
struct PoseEquations {
  static constexpr int kPacked = PoseModel::kParameters * (PoseModel::kParameters + 1) / 2;
  double upper[kPacked], gradient[PoseModel::kParameters];
};

// What the normal equations need of a pose that stays the same while they are made for one region
// after another.
struct FixedPose {
  Mat3 essential, columns[PoseModel::kParameters];
  RobustLoss loss;

  void write_equations(const RayPairs& pairs, const int32_t* listed, int count,
                       PoseEquations* out) const {
    sampson_normal_equations(pairs, listed, count, essential, columns, PoseModel::kParameters, loss,
                             out->upper, out->gradient);
  }
};

// Writes the support to f.indices, region by region: those of region r are starts[r] to
// starts[r + 1] - 1.
void sort_by_region(Fit& f, int view, int side, int* starts) {
  const Box box = image_box(f, view);
  const int grid[2] = {side, side}, num_regions = side * side;
  for (int region = 0; region <= num_regions; ++region) starts[region] = 0;
  for (int k = 0; k < f.num_support; ++k) {
    int cell[2];
    find_cell(f, view, box, grid, f.support[k], cell);
    const int region = cell[1] * side + cell[0];
    f.values[k] = region;
    ++starts[region];
  }
  for (int region = 1; region <= num_regions; ++region) starts[region] += starts[region - 1];
  for (int k = f.num_support - 1; k >= 0; --k) {
    f.indices[--starts[static_cast<int>(f.values[k])]] = f.support[k];
  }
}

// The largest squared turn of the rotation when the inliers of one region are left out, by one
// Gauss-Newton step without them: a deletion diagnostic (D. Belsley, E. Kuh, R. Welsch, "Regression
// diagnostics", 1980). The regions are the cells of a 4x4 grid on the view's image. whole: the step
// with all of them. At most kPi^2, also where the others do not determine the pose.
double largest_turn_sq(Fit& f, int view, const FixedPose& pose, const PoseEquations& all,
                       const double* whole) {
  constexpr int kSide = 4, kRegions = kSide * kSide;
  int starts[kRegions + 1];
  sort_by_region(f, view, kSide, starts);
  double largest = 0;
  for (int region = 0; region < kRegions; ++region) {
    const int32_t* const listed = f.indices + starts[region];
    const int count = starts[region + 1] - starts[region];
    if (count == 0) continue;
    PoseEquations rest;
    double step[PoseModel::kParameters], turn_sq = 0;
    pose.write_equations(f.matches.pairs, listed, count, &rest);
    for (int k = 0; k < PoseEquations::kPacked; ++k) rest.upper[k] = all.upper[k] - rest.upper[k];
    for (int k = 0; k < PoseModel::kParameters; ++k) {
      rest.gradient[k] = all.gradient[k] - rest.gradient[k];
    }
    // The damping keeps rounding errors from determining what the rest does not.
    if (!solve_damped(PoseModel::kParameters, rest.upper, rest.gradient, 1e-6, step)) {
      return kPi * kPi;
    }
    for (int k = 0; k < 3; ++k) turn_sq += (step[k] - whole[k]) * (step[k] - whole[k]);
    if (!(turn_sq < kPi * kPi)) return kPi * kPi;
    largest = std::max(largest, turn_sq);
  }
  return largest;
}

// tv_two_view.region_shift_rad: the mean of both views' largest turns.
double region_shift_rad(Fit& f) {
  const double noise_px = std::max(f.out->evidence->noise_px, 0.1 * f.threshold);
  FixedPose pose;
  pose.essential = essential_from_pose(f.out->epipolar.pose);
  pose_columns(f.out->epipolar.pose, pose.columns);
  pose.loss = RobustLoss{Loss::kCauchy, 2 * noise_px};
  PoseEquations all;
  double whole[PoseModel::kParameters];
  pose.write_equations(f.matches.pairs, f.support, f.num_support, &all);
  if (!solve_damped(PoseModel::kParameters, all.upper, all.gradient, 0, whole)) return kPi;
  double sum = 0;
  for (int v = 0; v < 2; ++v) sum += std::sqrt(largest_turn_sq(f, v, pose, all, whole));
  return 0.5 * sum;
}

// Parallax, uncertainty, lines of points and stability, of a full pose.
void measure_pose(Fit& f) {
  Evidence& evidence = *f.out->evidence;
  double sum = 0, weights = 0;
  if (f.num_support == 0) return;
  for (int k = 0; k < f.num_support; ++k) {
    f.values[k] = pseudo_angle(f, f.support[k]);
    // Each angle counts by its information, so that matches of large sigmas are no evidence against
    // a pose that the others determine.
    const double weight = 1 / f.matches.sigma_sq(f.support[k]);
    sum += weight * f.matches.pairs.pixel_angle[f.support[k]];
    weights += weight;
  }
  evidence.median_parallax_rad =
      angle_of_pseudo(nth_smallest(f.values, f.num_support, (f.num_support - 1) / 2));
  evidence.pixel_angle_rad = sum / weights;
  for (int v = 0; v < 2; ++v) evidence.line_distance_px[v] = line_distance_px(f, v);
  evidence.region_shift_rad = region_shift_rad(f);
}

void measure_inliers(Fit& f) {
  TwoViewOutcome& out = *f.out;
  Evidence& evidence = *out.evidence;
  const bool by_transfer = evidence.kind == TV_KIND_PANORAMIC ||
                           evidence.kind == TV_KIND_NO_MOTION ||
                           evidence.kind == TV_KIND_PLANAR_OR_PANORAMIC;
  const Matches& matches = f.matches;
  double sum = 0;
  if (by_transfer) {
    transfer_squares(matches.pairs, 0, matches.num_all, out.H, f.values);
  } else {
    sampson_squares(matches.pairs, 0, matches.num_all, out.epipolar.M, f.values);
  }
  for (int i = 0; i < matches.num_all; ++i) {
    if (out.inlier[i] == 0) continue;
    ++evidence.num_inliers;
    evidence.num_different_inliers += i < matches.num_unique();
    sum += f.values[i];
  }
  if (evidence.num_inliers > 0) out.rms_error_px = std::sqrt(sum / evidence.num_inliers);
  evidence.num_matches = matches.num_all;
  evidence.num_different = matches.num_unique();
  evidence.threshold_px = f.threshold;
  evidence.num_trials = f.problem.options.num_trials;
  const double focal_sigma =
      std::max(calibration_of(f.problem, 0).focal_sigma, calibration_of(f.problem, 1).focal_sigma);
  evidence.is_camera_assumed = focal_sigma > kUncertainFocal;
  evidence.focal_sigma = f.problem.one_camera ? out.focal_sigma : focal_sigma;
  for (int v = 0; v < 2; ++v) measure_spread(f, v, evidence);
  evidence.agreement = agreement_of(f);
}

// Whether matches contradict the sign of the direction: they lie on their epipolar lines, but
// behind the cameras, and the opposite direction puts them in front, with a larger parallax than
// the inliers'. So it is where a structure repeats itself: of two places that look alike the nearer
// one is matched more often, and the step that it tells is the rest of the period, the other way.
// Both groups hold only matches whose depth has a sign by more than twice the threshold.
bool has_opposite_motion(Fit& f) {
  constexpr int kFewest = 4, kClearDepth = 2;
  constexpr double kLeastShare = 0.1, kParallaxRatio = 2;
  constexpr int kChunk = 64;
  const Pose& pose = f.out->epipolar.pose;
  Pose opposite = pose;
  for (int k = 0; k < 3; ++k) opposite.t[k] = -pose.t[k];
  const double limit_sq = f.threshold * f.threshold;
  const int n = f.matches.num_unique();
  double squares[kChunk], opposite_squares[kChunk];
  // The parallax of the matches in front is written from the beginning of f.values, that of those
  // behind from its end.
  int num_front = 0, first_behind = n;
  for (int first = 0; first < n; first += kChunk) {
    const int some = std::min(kChunk, n - first);
    pose_squares(f.matches.pairs, first, some, pose, kClearDepth * f.threshold, squares);
    pose_squares(f.matches.pairs, first, some, opposite, kClearDepth * f.threshold,
                 opposite_squares);
    for (int k = 0; k < some; ++k) {
      const bool front = squares[k] <= limit_sq, behind = opposite_squares[k] <= limit_sq;
      if (front == behind) continue;  // off the epipolar line, or at no clear depth
      f.values[front ? num_front++ : --first_behind] = pseudo_angle(f, first + k);
    }
  }
  const int num_behind = n - first_behind;
  if (num_behind < kFewest || num_behind < kLeastShare * num_front) return false;
  const double behind = nth_smallest(f.values + first_behind, num_behind, (num_behind - 1) / 2);
  const double front = num_front > 0 ? nth_smallest(f.values, num_front, (num_front - 1) / 2) : 0;
  return angle_of_pseudo(behind) > kParallaxRatio * angle_of_pseudo(front);
}

// A second model is searched only among the matches that are clearly off the first, so that it is
// no part of it.
bool has_second_model(Fit& f, Arena& arena) {
  ArenaScope scope(arena);
  const TwoViewOutcome& out = *f.out;
  const int n = f.matches.num_unique();
  uint8_t* explained = arena_alloc<uint8_t>(arena, static_cast<size_t>(n));
  const double limit = kClearlyOff * f.threshold;
  if (out.has_t) {
    sampson_squares(f.matches.pairs, 0, n, out.epipolar.M, f.values);
  } else {
    transfer_squares(f.matches.pairs, 0, n, out.H, f.values);
  }
  for (int i = 0; i < n; ++i) explained[i] = f.values[i] <= limit * limit;
  return find_second_model(f.matches, explained, out.evidence->num_different_inliers, f.threshold,
                           f.problem.options.seed, arena)
      .found;
}

// Examines the neighbours of all points where there is a second model, else those of the inliers.
// These count only where more than half of them, in the mean of both images, are as on a lattice
// (robust/verdict.cc). Where that cannot be, as for most pairs, both measures stay 0.
void measure_lattices(Fit& f, Arena& arena) {
  ArenaScope scope(arena);
  Evidence& evidence = *f.out->evidence;
  const int n = f.matches.num_unique();
  double* const xy[2] = {arena_alloc<double>(arena, 2 * static_cast<size_t>(n)),
                         arena_alloc<double>(arena, 2 * static_cast<size_t>(n))};
  int count = 0;
  for (int i = 0; i < n; ++i) {
    if (f.out->inlier[i] != 0) f.indices[count++] = i;
    for (int v = 0; v < 2; ++v) {
      for (int d = 0; d < 2; ++d) {
        xy[v][2 * i + d] = f.problem.pixels[v][2 * f.matches.order[i] + d];
      }
    }
  }
  if (!evidence.has_second_model) {
    const double first = opposite_share(xy[0], n, f.indices, count, 0, arena);
    if (opposite_share(xy[1], n, f.indices, count, 1 - first, arena) <= 1 - first) return;
  }
  for (int v = 0; v < 2; ++v) {
    const Lattice lattice =
        find_lattice(xy[v], n, evidence.has_second_model ? nullptr : f.indices, count, arena);
    evidence.lattice_share[v] = lattice.share;
    evidence.lattice_sigmas[v] = lattice.sigmas;
  }
}

}  // namespace

size_t evidence_bytes(int max_matches) {
  const size_t n = static_cast<size_t>(max_matches);
  const size_t second = arena_bytes<uint8_t>(n) + second_model_bytes(max_matches);
  const size_t lattice = 2 * arena_bytes<double>(2 * n) + lattice_bytes(max_matches);
  return std::max(second, lattice);
}

void measure_evidence(Fit& f, Arena& arena) {
  Evidence& evidence = *f.out->evidence;
  measure_inliers(f);
  if (f.out->has_t) measure_pose(f);
  if (!f.problem.calibrated || evidence.kind == TV_KIND_DEGENERATE) return;
  evidence.has_second_model = has_second_model(f, arena);
  evidence.has_opposite_motion = f.out->has_t && has_opposite_motion(f);
  measure_lattices(f, arena);
}

}  // namespace tv
