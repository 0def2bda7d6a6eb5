#include "robust/matches.h"

#include <algorithm>
#include <cmath>
#include <cstring>
#include <utility>

#include "base/math.h"

namespace tv {
namespace {

// The absolute values of a match's four coordinates must add up to less than this, in pixels;
// images have at most 16384 pixels a side.
constexpr double kMaxCoordinates = 1e6;

uint64_t mix(uint64_t h) {  // the finaliser of splitmix64 (G. Steele et al., 2014)
  h = (h ^ (h >> 30)) * 0xbf58476d1ce4e5b9ULL;
  h = (h ^ (h >> 27)) * 0x94d049bb133111ebULL;
  return h ^ (h >> 31);
}

uint64_t bits_of(double x) {
  const double positive_zero = x + 0.0;
  uint64_t bits;
  std::memcpy(&bits, &positive_zero, sizeof bits);
  return bits;
}

struct Coordinates {
  double v[4];  // x0 y0 x1 y1
};

Coordinates coordinates(const TwoViewProblem& p, int32_t i) {
  return {{p.pixels[0][2 * i], p.pixels[0][2 * i + 1], p.pixels[1][2 * i], p.pixels[1][2 * i + 1]}};
}

bool same_place(const TwoViewProblem& p, int32_t i, int32_t j) {
  const Coordinates a = coordinates(p, i), b = coordinates(p, j);
  return a.v[0] == b.v[0] && a.v[1] == b.v[1] && a.v[2] == b.v[2] && a.v[3] == b.v[3];
}

// Whether match i has the lower sigmas: by their sum, then by that of view 0.
bool more_precise(const TwoViewProblem& p, int32_t i, int32_t j) {
  const double a = p.sigma(0, i) + p.sigma(1, i), b = p.sigma(0, j) + p.sigma(1, j);
  return a != b ? a < b : p.sigma(0, i) < p.sigma(0, j);
}

struct SortKey {
  float ratio;
  int32_t index;
  double x0;  // the first coordinate, which settles nearly every tie of ratios
};

// A ratio that is not a number counts as the worst.
float sort_ratio(const TwoViewProblem& p, int32_t i) {
  if (p.ratios == nullptr) return 0;
  const float ratio = p.ratios[i];
  return ratio < 3e38f ? ratio : 3e38f;
}

bool sorts_before(const TwoViewProblem& p, const SortKey& a, const SortKey& b) {
  if (a.ratio != b.ratio) return a.ratio < b.ratio;
  if (a.x0 != b.x0) return a.x0 < b.x0;
  const Coordinates ca = coordinates(p, a.index), cb = coordinates(p, b.index);
  for (int k = 0; k < 4; ++k) {
    if (ca.v[k] != cb.v[k]) return ca.v[k] < cb.v[k];
  }
  if (more_precise(p, a.index, b.index)) return true;
  if (more_precise(p, b.index, a.index)) return false;
  return a.index < b.index;  // the matches are equal, so that their order makes no difference
}

// Keeps the most precise of equal matches in order[0 ..), where the first of them would be, the
// others behind them. Returns how many differ.
int move_repeats_last(const TwoViewProblem& p, const SortKey* sorted, int count, int32_t* table,
                      uint32_t table_size, int32_t* order) {
  for (uint32_t s = 0; s < table_size; ++s) table[s] = -1;
  int num_unique = 0, num_repeats = 0;
  for (int k = 0; k < count; ++k) {
    int32_t i = sorted[k].index;
    const Coordinates c = coordinates(p, i);
    uint64_t hash = 0;
    for (int d = 0; d < 4; ++d) hash = mix(hash + 0x9e3779b97f4a7c15ULL + bits_of(c.v[d]));
    uint32_t slot = static_cast<uint32_t>(hash) & (table_size - 1);
    while (table[slot] >= 0 && !same_place(p, order[table[slot]], i)) {
      slot = (slot + 1) & (table_size - 1);
    }
    if (table[slot] < 0) {
      table[slot] = num_unique;
      order[num_unique++] = i;
    } else {
      int32_t& kept = order[table[slot]];
      if (more_precise(p, i, kept)) std::swap(i, kept);
      order[count - 1 - num_repeats++] = i;
    }
  }
  return num_unique;
}

uint32_t table_size_for(int max_matches) {
  uint32_t size = 16;
  while (size < 2 * static_cast<uint32_t>(max_matches)) size *= 2;
  return size;
}

struct PixelRay {
  double ray[3], jacobian[6];  // d ray / d pixel, row-major 3x2
};

// The ray of a pixel, on the plane z = 1 or of unit length.
bool ray_of_pixel(const Camera& camera, const double* pixel, bool on_plane, PixelRay* out) {
  const tv_camera& model = camera.model;
  double *ray = out->ray, *jacobian = out->jacobian;
  if (model.model == TV_CAMERA_PINHOLE && on_plane) {
    ray[0] = (pixel[0] - model.cx) / model.fx;
    ray[1] = (pixel[1] - model.cy) / model.fy;
    ray[2] = 1;
    jacobian[0] = 1 / model.fx;
    jacobian[3] = 1 / model.fy;
    jacobian[1] = jacobian[2] = jacobian[4] = jacobian[5] = 0;
    return true;
  }
  Vec3 unit;
  Mat32 slope;
  if (!unproject(camera, Vec2(pixel[0], pixel[1]), &unit, &slope)) return false;
  if (!on_plane) {
    for (int r = 0; r < 3; ++r) {
      ray[r] = unit[r];
      for (int c = 0; c < 2; ++c) jacobian[2 * r + c] = slope(r, c);
    }
    return true;
  }
  if (!(unit[2] > 1e-3)) return false;  // Brown-Conrady's valid angle ends before 90 degrees
  for (int r = 0; r < 2; ++r) {
    ray[r] = unit[r] / unit[2];
    for (int c = 0; c < 2; ++c) {
      jacobian[2 * r + c] = (slope(r, c) - ray[r] * slope(2, c)) / unit[2];
    }
  }
  ray[2] = 1;
  jacobian[4] = jacobian[5] = 0;
  return true;
}

bool sane(const PixelRay& p) {
  double sum = 0;
  for (double x : p.ray) sum += x * x;
  for (double x : p.jacobian) sum += x * x;
  return is_finite(sum) && sum < 1e200;
}

// Whether every pixel of which prepare_matches does not drop the match has a sane ray.
bool has_all_rays(const Camera& camera, bool on_plane) {
  const tv_camera& model = camera.model;
  return on_plane && model.model == TV_CAMERA_PINHOLE && std::min(model.fx, model.fy) > 1e-6 &&
         std::max(std::fabs(model.cx), std::fabs(model.cy)) < kMaxCoordinates;
}

// Without cameras: a pinhole that puts the centroid on the axis and the mean squared distance of
// the points from it at 2 (Hartley 1997).
Camera normalising_camera(const double* pixels, const int32_t* order, int count) {
  double mean[2] = {0, 0}, spread = 0;
  for (int k = 0; k < count; ++k) {
    for (int d = 0; d < 2; ++d) mean[d] += pixels[2 * order[k] + d];
  }
  for (int d = 0; d < 2; ++d) mean[d] = count > 0 ? mean[d] / count : 0;
  for (int k = 0; k < count; ++k) {
    const double x = pixels[2 * order[k]] - mean[0], y = pixels[2 * order[k] + 1] - mean[1];
    spread += x * x + y * y;
  }
  Camera camera{};
  camera.model.model = TV_CAMERA_PINHOLE;
  const double focal = count > 0 ? std::sqrt(0.5 * spread / count) : 1;
  camera.model.fx = camera.model.fy = focal > 0 && is_finite(focal) ? focal : 1;
  camera.model.cx = mean[0];
  camera.model.cy = mean[1];
  return camera;
}

void set_rays(const TwoViewProblem& problem, int view, const Camera& camera, Matches* matches) {
  const bool has_all = has_all_rays(camera, matches->pairs.on_plane);
  for (int k = 0; k < matches->num_all; ++k) {
    PixelRay p;
    const double* pixel = problem.pixels[view] + 2 * matches->order[k];
    if (ray_of_pixel(camera, pixel, matches->pairs.on_plane, &p) && (has_all || sane(p))) {
      for (double& slope : p.jacobian) slope *= matches->sigma(view, k);
      set_ray(matches->pairs, view, k, p.ray, p.jacobian);
    }
  }
  matches->intrinsics[view] = intrinsics_of(camera.model);
}

double box_area(const double* pixels, const int32_t* order, int count) {
  double low[2] = {0, 0}, high[2] = {0, 0};
  for (int k = 0; k < count; ++k) {
    for (int d = 0; d < 2; ++d) {
      const double x = pixels[2 * order[k] + d];
      if (k == 0 || x < low[d]) low[d] = x;
      if (k == 0 || x > high[d]) high[d] = x;
    }
  }
  return (high[0] - low[0] + 1) * (high[1] - low[1] + 1);
}

}  // namespace

size_t matches_bytes(int max_matches) {
  const size_t n = static_cast<size_t>(max_matches);
  return ray_pairs_bytes(max_matches) + arena_bytes<int32_t>(n) + arena_bytes<SortKey>(n) +
         arena_bytes<int32_t>(table_size_for(max_matches));
}

void prepare_matches(const TwoViewProblem& problem, Arena& arena, Matches* matches) {
  const size_t n = static_cast<size_t>(problem.num);
  matches->order = arena_alloc<int32_t>(arena, n);
  for (int v = 0; v < 2; ++v) matches->sigmas[v] = problem.sigmas[v];
  const bool on_plane = !problem.calibrated ||
                        (has_image_plane(problem.camera[0]) && has_image_plane(problem.camera[1]));
  matches->pairs = alloc_ray_pairs(arena, problem.num, on_plane);
  if (problem.kernels != nullptr) matches->pairs.kernels = problem.kernels;
  ArenaScope scope(arena);
  SortKey* keys = arena_alloc<SortKey>(arena, n);
  const uint32_t table_size = table_size_for(problem.num);
  int32_t* table = arena_alloc<int32_t>(arena, table_size);
  bool is_seen[2];  // whether no ray of the view needs to be examined
  for (int v = 0; v < 2; ++v) {
    is_seen[v] = !problem.calibrated || has_all_rays(problem.camera[v], on_plane);
  }
  int count = 0;
  for (int32_t i = 0; i < problem.num; ++i) {
    if (problem.is_still != nullptr && problem.is_still[i] != 0) continue;
    const Coordinates c = coordinates(problem, i);
    const double sum =
        (std::fabs(c.v[0]) + std::fabs(c.v[1])) + (std::fabs(c.v[2]) + std::fabs(c.v[3]));
    if (!(sum < kMaxCoordinates)) continue;  // drops NaN, infinities, huge values
    PixelRay ray;
    bool usable = true;
    for (int v = 0; v < 2 && usable; ++v) {
      usable =
          is_seen[v] || (ray_of_pixel(problem.camera[v], &c.v[2 * v], on_plane, &ray) && sane(ray));
    }
    if (usable) keys[count++] = SortKey{sort_ratio(problem, i), i, c.v[0]};
  }
  std::sort(keys, keys + count,
            [&problem](const SortKey& a, const SortKey& b) { return sorts_before(problem, a, b); });
  matches->num_all = count;
  matches->pairs.num = move_repeats_last(problem, keys, count, table, table_size, matches->order);
  for (int v = 0; v < 2; ++v) {
    set_rays(problem, v,
             problem.calibrated
                 ? problem.camera[v]
                 : normalising_camera(problem.pixels[v], matches->order, matches->num_unique()),
             matches);
  }
  const tv_camera& second = problem.camera[1].model;
  matches->area_px = problem.calibrated
                         ? static_cast<double>(second.width) * second.height
                         : box_area(problem.pixels[1], matches->order, matches->num_unique());
  finish_rays(matches->pairs, matches->num_all);
}

bool ray_curvature(const TwoViewProblem& problem, const Matches& matches, const Camera& camera,
                   int view, int k, double curvature[9]) {
  if (camera.model.model == TV_CAMERA_PINHOLE && matches.pairs.on_plane) return false;
  const double* pixel = problem.pixels[view] + 2 * matches.order[k];
  for (int along = 0; along < 2; ++along) {  // the difference of the Jacobian over one pixel
    const double beside[2] = {pixel[0] + (along == 0), pixel[1] + (along == 1)};
    PixelRay p;
    const bool known = ray_of_pixel(camera, beside, matches.pairs.on_plane, &p) && sane(p);
    for (int r = 0; r < 3; ++r) {
      for (int c = along; c < 2; ++c) {
        const int at = 2 * r + c;
        curvature[3 * r + along + c] =
            known ? matches.sigma(view, k) * p.jacobian[at] - matches.pairs.jacobian[view][at][k]
                  : 0;
      }
    }
  }
  return true;
}

double Matches::sigma_sq(int k) const {
  const double s0 = sigma(0, k), s1 = sigma(1, k);
  return 0.5 * (s0 * s0 + s1 * s1);
}

SigmaMeans sigma_means(const Matches& matches) {
  const int n = matches.num_unique();
  SigmaMeans sums{0, 0};
  for (int k = 0; k < n; ++k) {
    const double s_sq = matches.sigma_sq(k);
    sums.s += std::sqrt(s_sq);
    sums.s_sq += s_sq;
  }
  return n > 0 ? SigmaMeans{sums.s / n, sums.s_sq / n} : SigmaMeans{1, 1};
}

Camera moved_camera(const TwoViewProblem& problem, int view, const double shift_px[2]) {
  Camera camera = problem.camera[view];
  camera.model.cx += shift_px[0];
  camera.model.cy += shift_px[1];
  return camera;
}

void move_principal_points(const TwoViewProblem& problem, const double shift_px[2],
                           Matches* matches) {
  for (int v = 0; v < 2; ++v) set_rays(problem, v, moved_camera(problem, v, shift_px), matches);
  finish_rays(matches->pairs, matches->num_all);
}

}  // namespace tv
