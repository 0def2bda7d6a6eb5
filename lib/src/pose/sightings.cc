#include "pose/sightings.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "base/math.h"
#include "base/order.h"
#include "geometry/ray_pairs.h"
#include "geometry/vector3.h"

namespace tv {
namespace {

constexpr double kMaxPixel = 1e6;  // of |x| + |y|; images have at most 16384 pixels a side
constexpr double kMaxPoint = 1e100;
constexpr double kFarthest = 1e9;

// Whether match i is before match j by pixel, point and sigma: -1, 0 for equal ones, or 1.
int compare(const SightingInput& in, int32_t i, int32_t j) {
  for (int k = 0; k < 5; ++k) {
    const double a = k < 2 ? in.pixels[2 * i + k] : in.points[3 * i + k - 2];
    const double b = k < 2 ? in.pixels[2 * j + k] : in.points[3 * j + k - 2];
    if (a != b) return a < b ? -1 : 1;
  }
  return 0;
}

// Of two different matches with the same key.
bool is_before(const SightingInput& in, int32_t i, int32_t j) {
  const int order = compare(in, i, j);
  if (order != 0) return order < 0;
  const double s = in.sigma(i), t = in.sigma(j);
  return s != t ? s < t : i < j;
}

inline bool is_before(const SightingInput& in, const SightingKey& a, const SightingKey& b) {
  return a.key != b.key ? a.key < b.key : is_before(in, a.index, b.index);
}

void sort(const SightingInput& in, SightingKey* keys, int count) {
  std::sort(keys, keys + count,
            [&in](const SightingKey& a, const SightingKey& b) { return is_before(in, a, b); });
}

// The matches in order[0 .. count), the most precise of equal ones first; the others last. Returns
// how many differ.
int sort_matches(const SightingInput& in, SightingKey* keys, int count, int32_t* order) {
  sort(in, keys, count);
  int num = 0, repeats = 0;
  for (int k = 0; k < count; ++k) {
    const int32_t i = keys[k].index;
    if (num > 0 && compare(in, keys[num - 1].index, i) == 0) {
      order[count - 1 - repeats++] = i;
    } else {
      keys[num++].index = i;
    }
  }
  if (in.ratios != nullptr) {  // a ratio that is not a number counts as the worst
    for (int k = 0; k < num; ++k) {
      const float ratio = in.ratios[keys[k].index];
      keys[k].key = ratio < 3e38f ? ratio : 3e38f;
    }
    sort(in, keys, num);
  }
  for (int k = 0; k < num; ++k) order[k] = keys[k].index;
  return num;
}

// A power of two near 1 / x, for x > 0.
double inverse_power_of_two(double x) {
  uint64_t bits;
  std::memcpy(&bits, &x, sizeof bits);
  bits = (2046 - (bits >> 52)) << 52;
  std::memcpy(&x, &bits, sizeof x);
  return x;
}

// The middle and the scale of the points, by medians, which a few points far away do not move.
void normalise(const SightingInput& in, double* values, Sightings* s) {
  if (s->num == 0) return;
  for (int d = 0; d < 3; ++d) {
    for (int k = 0; k < s->num; ++k) values[k] = in.points[3 * s->order[k] + d];
    s->centre[d] = median(values, s->num);
  }
  double largest = 0;
  for (int k = 0; k < s->num; ++k) {
    values[k] = 0;
    for (int d = 0; d < 3; ++d) {
      values[k] += std::fabs(in.points[3 * s->order[k] + d] - s->centre[d]);
    }
    largest = std::max(largest, values[k]);
  }
  const double middle = median(values, s->num);
  const double size = middle > 0 ? middle : largest;
  if (size > 1e-280) s->scale = inverse_power_of_two(size);
}

// The pixel's part of a sighting, rows and axis; false where the lens cannot see the pixel.
bool set_pixel(const Camera& camera, const double* pixel, double sigma, Sighting* out) {
  Vec3 ray;
  Vec2 again;
  Mat23 slope;
  if (!unproject(camera, Vec2(pixel[0], pixel[1]), &ray, nullptr)) return false;
  Vec3 axis = ray;
  if (has_image_plane(camera)) {
    if (!(ray[2] > 1e-3)) return false;
    ray /= double(ray[2]);
    axis = Vec3(0, 0, 1);
  }
  if (!project(camera, ray, &again, &slope)) return false;
  double sum = 0;
  for (int c = 0; c < 3; ++c) {
    out->axis[c] = axis[c];
    for (int r = 0; r < 2; ++r) {
      out->rows[r][c] = slope(r, c) / sigma;
      sum += out->rows[r][c] * out->rows[r][c];
    }
  }
  return is_finite(sum) && sum < 1e20;
}

void set_fast(Sightings* s) {
  const int padded = (s->num + kSightingBlock - 1) / kSightingBlock * kSightingBlock;
  const int step = s->num > 0 ? even_step(s->num) : 0;
  for (int slot = 0, i = 0; slot < padded; ++slot) {
    double numbers[12] = {};
    if (slot < s->num) std::memcpy(numbers, &s->all[i], sizeof numbers);
    for (int k = 0; k < 12; ++k) s->fast[k][slot] = static_cast<float>(numbers[k]);
    i = i < s->num - step ? i + step : i - (s->num - step);
  }
}

}  // namespace

void unit_ray(const Sighting& s, double ray[3]) {
  cross(s.rows[0], s.rows[1], ray);
  const double length = length_of(ray), scale = 1 / (dot(ray, s.axis) < 0 ? -length : length);
  scale_by(scale, ray);
}

void write_pose(const Sightings& s, const Pose& pose, double R[9], double t[3]) {
  double turned[3];
  rotate(pose.R, s.centre, turned);
  write_matrix(pose.R, R);
  for (int k = 0; k < 3; ++k) t[k] = pose.t[k] / s.scale - turned[k];
}

Pose read_pose(const Sightings& s, const double R[9], const double t[3]) {
  Pose pose;
  pose.R = matrix_of(R);
  double turned[3];
  rotate(pose.R, s.centre, turned);
  for (int k = 0; k < 3; ++k) pose.t[k] = (t[k] + turned[k]) * s.scale;
  return pose;
}

void prepare_sightings(const SightingInput& in, Arena& arena, Sightings* s) {
  const size_t n = static_cast<size_t>(in.num);
  s->kernels = tvk_odometry_of(in.kernels);
  s->all = arena_alloc<Sighting>(arena, n);
  s->order = arena_alloc<int32_t>(arena, n);
  const size_t padded = (n + kSightingBlock - 1) / kSightingBlock * kSightingBlock;
  for (float*& numbers : s->fast) numbers = arena_alloc<float>(arena, padded);
  ArenaScope scope(arena);
  SightingKey* keys = arena_alloc<SightingKey>(arena, n);
  double* values = arena_alloc<double>(arena, n);
  int count = 0;
  for (int i = 0; i < in.num; ++i) {
    const double *pixel = in.pixels + 2 * i, *point = in.points + 3 * i;
    if (std::fabs(pixel[0]) + std::fabs(pixel[1]) < kMaxPixel &&
        std::fabs(point[0]) + std::fabs(point[1]) + std::fabs(point[2]) < kMaxPoint) {
      keys[count++] = SightingKey{pixel[0], i};
    }
  }
  s->num_all = count;
  s->num = sort_matches(in, keys, count, s->order);
  normalise(in, values, s);
  int kept[2] = {0, 0};  // of the different matches, and of all
  for (int k = 0; k < count; ++k) {
    const int32_t i = s->order[k];
    Sighting& sighting = s->all[kept[1]];
    double size = 0;
    for (int d = 0; d < 3; ++d) {
      sighting.point[d] = (in.points[3 * i + d] - s->centre[d]) * s->scale;
      size += std::fabs(sighting.point[d]);
    }
    if (!(size < kFarthest)) continue;
    if (!set_pixel(in.camera, in.pixels + 2 * i, in.sigma(i), &sighting)) continue;
    s->order[kept[1]++] = i;
    kept[0] += k < s->num;
  }
  s->num = kept[0];
  s->num_all = kept[1];
  set_fast(s);
}

}  // namespace tv
