#include "dense/rectify.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "geometry/triangulation_frame.h"

namespace tv {
namespace {

constexpr int32_t kProbes = 33;      // rays across and down image 0 that tell the grid's extent
constexpr int32_t kSectors = 64;     // of the circle around the baseline
constexpr int32_t kBins = 4096;      // of the histogram of parallax
constexpr double kEpipoleSteps = 4;  // columns this near an epipole have no parallax to measure
constexpr double kMargin = 1.3;      // of the range of parallax

double angle_between_0_and_2pi(double angle) { return angle < 0 ? angle + 2 * kPi : angle; }

int32_t columns_of(double extent, double step) { return static_cast<int32_t>(extent / step) + 1; }

// The extent of image 0 in the grid's angles.
struct Extent {
  double first_plane, planes, least_angle, most_angle;
};

bool extent_of(const Camera& camera, const DenseGrid& grid, Arena& arena, Extent* extent) {
  const ArenaScope scope(arena);
  double* const planes = arena_alloc<double>(arena, kProbes * kProbes);
  int32_t num = 0;
  bool hit[kSectors] = {};
  extent->least_angle = kPi;
  extent->most_angle = 0;
  for (int32_t j = 0; j < kProbes; ++j) {
    for (int32_t i = 0; i < kProbes; ++i) {
      const Vec2 pixel(static_cast<double>(i * (camera.model.width - 1)) / (kProbes - 1),
                       static_cast<double>(j * (camera.model.height - 1)) / (kProbes - 1));
      Vec3 ray;
      if (!unproject(camera, pixel, &ray, nullptr)) continue;
      const double x = dot(ray, grid.side), y = dot(ray, grid.up);
      const double angle = atan2(std::sqrt(x * x + y * y), dot(ray, grid.baseline));
      const double plane = angle_between_0_and_2pi(atan2(y, x));
      planes[num++] = plane;
      hit[static_cast<int32_t>(plane * (kSectors / (2 * kPi))) % kSectors] = true;
      extent->least_angle = std::min(extent->least_angle, angle);
      extent->most_angle = std::max(extent->most_angle, angle);
    }
  }
  if (num == 0) return false;
  // Planes are counted from the middle of the largest gap between them.
  int32_t gap = 0, gap_end = 0;
  for (int32_t k = 0, run = 0; k < 2 * kSectors; ++k) {
    run = hit[k % kSectors] ? 0 : run + 1;
    if (run > gap && run < kSectors) gap = run, gap_end = k + 1;
  }
  const double start = (gap_end - 0.5 * gap) * (2 * kPi / kSectors);
  double least = 2 * kPi, most = 0;
  for (int32_t k = 0; k < num; ++k) {
    double plane = planes[k] - start;
    while (plane < 0) plane += 2 * kPi;
    least = std::min(least, plane);
    most = std::max(most, plane);
  }
  if (gap == 0) least = 0, most = 2 * kPi;
  extent->first_plane = start + least;
  extent->planes = most - least;
  return true;
}

// The angle in [low, high] that is nearest to a right one, where planes are farthest apart.
double widest_sine(double low, double high) {
  const double right = kPi / 2;
  double sine, cosine;
  sincos(high < right ? high : low > right ? low : right, &sine, &cosine);
  return sine;
}

}  // namespace

int32_t longest_side(int32_t max_cells) {
  return static_cast<int32_t>(4 * std::sqrt(static_cast<double>(max_cells)));
}

size_t make_grid_bytes() {
  return std::max(arena_bytes<double>(kProbes * kProbes), arena_bytes<int32_t>(kBins));
}

size_t halved_bytes(int32_t width, int32_t height) {
  return arena_bytes<uint8_t>(static_cast<size_t>(width / 2) * static_cast<size_t>(height / 2));
}

double pixel_angle_of(const Camera& camera0, const Camera& camera1) {
  double least = 0;
  for (const Camera* camera : {&camera0, &camera1}) {
    const double focal = std::sqrt(camera->model.fx * camera->model.fy);
    const double angle = std::min(std::max(1 / focal, 1e-6), 1.0);
    least = std::max(least, angle);
  }
  return least;
}

bool range_of_points(const tv_point* points, int32_t num_points, double pixel_angle, Arena& arena,
                     ParallaxRange* range) {
  const ArenaScope scope(arena);
  int32_t* const bins = arena_alloc<int32_t>(arena, kBins);
  for (int32_t k = 0; k < kBins; ++k) bins[k] = 0;
  const double width = std::max(pixel_angle, kPi / (kBins - 1));
  int32_t num = 0;
  for (int32_t i = 0; i < num_points; ++i) {
    const double angle = static_cast<double>(points[i].angle_rad);
    if (points[i].status != TV_POINT_OK || !(angle >= 0 && angle <= kPi)) continue;
    ++bins[static_cast<int32_t>(angle / width)];
    ++num;
  }
  if (num == 0) return false;
  const int32_t outermost = num / 100;
  int32_t low = 0, high = kBins - 1;
  for (int32_t sum = bins[low]; sum <= outermost; sum += bins[low]) ++low;
  for (int32_t sum = bins[high]; sum <= outermost; sum += bins[high]) --high;
  range->least = std::max(0.0, (low / kMargin - 1) * width);
  range->most = std::min(kPi, ((high + 1) * kMargin + 1) * width);
  return true;
}

bool make_grid(const Camera& camera0, const Mat3& R, const Vec3& t, const ParallaxRange& range,
               double pixel_angle, int32_t max_cells, int32_t max_steps, Arena& arena,
               DenseGrid* grid) {
  Mat3 back;
  for (int i = 0; i < 9; ++i) back(i / 3, i % 3) = R(i % 3, i / 3);
  // Squares of an extreme t leave the range of a double.
  const double largest = std::max(std::max(std::fabs(t[0]), std::fabs(t[1])), std::fabs(t[2]));
  const double unit = largest > 1e-100 && largest < 1e100 ? 1 : largest;
  const Vec3 scaled(t[0] / unit, t[1] / unit, t[2] / unit);
  const Vec3 other = rotate(back, scaled);
  const double length = std::sqrt(dot(scaled, scaled));
  grid->length = length * unit;
  grid->baseline = Vec3(-other[0] / length, -other[1] / length, -other[2] / length);
  const double norm = std::sqrt(dot(grid->baseline, grid->baseline));
  for (int i = 0; i < 3; ++i) grid->baseline[i] /= norm;
  complete_basis(grid->baseline, &grid->side, &grid->up);
  Extent extent;
  if (!extent_of(camera0, *grid, arena, &extent)) return false;
  // The step: a pixel, or as many as keep the steps of parallax within their number, and then the
  // cells and the columns.
  double step = std::max(pixel_angle, (range.most - range.least) / (max_steps - 2));
  double low = 0, high = 0, sine = 1;
  const double longest = longest_side(max_cells);
  for (int pass = 0; pass < 2; ++pass) {
    low = std::max(extent.least_angle, kEpipoleSteps * step);
    high = std::min(extent.most_angle, kPi - kEpipoleSteps * step);
    if (!(low < high)) return false;
    sine = widest_sine(low, high);
    const double across = (high - low) / step + 1, down = extent.planes * sine / step + 1;
    if (pass == 0) {
      step *= std::max(1.0, std::max(std::sqrt(across * down / max_cells),
                                     std::max(across, down) / (longest - 1)));
    }
  }
  grid->step = step;
  grid->first_angle = low;
  grid->width = std::min(columns_of(high - low, step), static_cast<int32_t>(longest));
  grid->plane_step = step / sine;
  grid->first_plane = extent.first_plane;
  grid->height =
      std::min(std::min(columns_of(extent.planes, grid->plane_step), static_cast<int32_t>(longest)),
               max_cells / grid->width);
  grid->first_step = static_cast<int32_t>(range.least / step);
  const int32_t last = static_cast<int32_t>(range.most / step) + 1;
  grid->num_steps = std::min((last - grid->first_step + 8) / 8 * 8, max_steps);
  return grid->height > 0;
}

void tabulate(const DenseGrid& grid, int32_t first, int32_t count, double* sines) {
  for (int32_t k = 0; k < count; ++k) {
    const double angle = grid.first_angle + (first + k) * grid.step;
    sincos(angle, sines + 2 * k, sines + 2 * k + 1);
    if (!(angle <= kPi)) sines[2 * k] = -1;
  }
}

void halve(const DenseGrid& grid, double pixel_angle, Arena& arena, DenseView* view) {
  view->halvings = 0;
  const tv_image from = view->image;
  double ratio = grid.step / pixel_angle;
  while (ratio >= 1.5 && from.width >> (view->halvings + 1) >= 8 &&
         from.height >> (view->halvings + 1) >= 8) {
    ratio *= 0.5;
    ++view->halvings;
  }
  if (view->halvings == 0) return;
  const int32_t side = 1 << view->halvings, shift = 2 * view->halvings;
  const int32_t width = from.width >> view->halvings, height = from.height >> view->halvings;
  uint8_t* const to =
      arena_alloc<uint8_t>(arena, static_cast<size_t>(width) * static_cast<size_t>(height));
  for (int32_t y = 0; y < height; ++y) {
    for (int32_t x = 0; x < width; ++x) {
      const uint8_t* p = from.data + static_cast<int64_t>(y) * side * from.stride_bytes + x * side;
      uint32_t sum = 1u << shift >> 1;
      for (int32_t v = 0; v < side; ++v, p += from.stride_bytes) {
        for (int32_t u = 0; u < side; ++u) sum += p[u];
      }
      to[static_cast<ptrdiff_t>(y) * width + x] = static_cast<uint8_t>(sum >> shift);
    }
  }
  view->image = tv_image{to, width, height, width};
}

Vec3 ray_at(const DenseGrid& grid, int32_t row, double angle) {
  double plane_sine, plane_cosine, sine, cosine;
  sincos(grid.first_plane + row * grid.plane_step, &plane_sine, &plane_cosine);
  sincos(angle, &sine, &cosine);
  return combine(cosine, grid.baseline, sine,
                 combine(plane_cosine, grid.side, plane_sine, grid.up));
}

bool pixel_at(const DenseView& view, const Vec3& ray, Vec2* pixel) {
  if (!project(view.camera, rotate(view.rotation, ray), pixel, nullptr)) return false;
  return (*pixel)[0] >= 0 && (*pixel)[1] >= 0 && (*pixel)[0] <= view.camera.model.width - 1 &&
         (*pixel)[1] <= view.camera.model.height - 1;
}

void resample(const DenseGrid& grid, const DenseView& view, const double* sines, int32_t columns,
              uint8_t* pixels) {
  const tv_image& image = view.image;
  const double scale = 1.0 / (1 << view.halvings);
  const Vec3 along = rotate(view.rotation, grid.baseline);
  for (int32_t y = 0; y < grid.height; ++y) {
    double plane_sine, plane_cosine;
    sincos(grid.first_plane + y * grid.plane_step, &plane_sine, &plane_cosine);
    const Vec3 across =
        rotate(view.rotation, combine(plane_cosine, grid.side, plane_sine, grid.up));
    uint8_t* const row = pixels + static_cast<ptrdiff_t>(y) * columns;
    for (int32_t x = 0; x < columns; ++x) {
      row[x] = 0;
      const double sine = sines[2 * x], cosine = sines[2 * x + 1];
      if (sine < 0) continue;
      Vec2 at;
      if (!project(view.camera, combine(cosine, along, sine, across), &at, nullptr)) continue;
      const double u = (at[0] + 0.5) * scale - 0.5, v = (at[1] + 0.5) * scale - 0.5;
      if (!(u >= 0 && v >= 0 && u <= image.width - 1 && v <= image.height - 1)) continue;
      const int32_t u16 = static_cast<int32_t>(u * 65536), v16 = static_cast<int32_t>(v * 65536);
      const uint8_t* p =
          image.data + static_cast<int64_t>(v16 >> 16) * image.stride_bytes + (u16 >> 16);
      const ptrdiff_t right = (u16 >> 16) + 1 < image.width ? 1 : 0;
      const uint8_t* q = (v16 >> 16) + 1 < image.height ? p + image.stride_bytes : p;
      const int32_t du = u16 >> 8 & 255, dv = v16 >> 8 & 255;
      const int32_t upper = 256 * p[0] + du * (p[right] - p[0]);
      const int32_t lower = 256 * q[0] + du * (q[right] - q[0]);
      const int32_t grey = (256 * upper + dv * (lower - upper) + 32768) >> 16;
      row[x] = static_cast<uint8_t>(std::max(grey, 1));
    }
  }
}

}  // namespace tv
