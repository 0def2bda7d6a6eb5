#include "dense/rectify.h"

#include <algorithm>
#include <cmath>

#include "base/math.h"
#include "triangulation/frame.h"

namespace tv {
namespace {

constexpr int32_t kProbes = 33;      // rays across and down image 0 that tell the grid's extent
constexpr int32_t kSectors = 64;     // of the circle around the baseline
constexpr int32_t kBins = 4096;      // of the histogram of parallax
constexpr double kEpipoleSteps = 4;  // columns this near an epipole have no parallax to measure
constexpr double kMargin = 1.3;      // of the range of parallax
// A flat grid is chosen where no ray of image 0 is farther than this from its middle, as a tangent,
// and no parallax larger, as an angle: cells at the rim then still resolve the image, and are not
// many more than pixels.
constexpr double kFlatReach = 1.25, kFlatParallax = 0.7;
constexpr int32_t kSpan = TVK_DENSE_NODES;

double angle_between_0_and_2pi(double angle) { return angle < 0 ? angle + 2 * kPi : angle; }

int32_t columns_of(double extent, double step) { return static_cast<int32_t>(extent / step) + 1; }

// Calls f with the ray of each probe of the image.
template <typename F>
void for_each_probe(const Camera& camera, const F& f) {
  for (int32_t j = 0; j < kProbes; ++j) {
    for (int32_t i = 0; i < kProbes; ++i) {
      const Vec2 pixel(static_cast<double>(i * (camera.model.width - 1)) / (kProbes - 1),
                       static_cast<double>(j * (camera.model.height - 1)) / (kProbes - 1));
      Vec3 ray;
      if (unproject(camera, pixel, &ray, nullptr)) f(ray);
    }
  }
}

// The extent of image 0 in rows and columns of the grid.
struct Extent {
  double first_row, rows, low, high;
};

bool angular_extent(const Camera& camera, const DenseGrid& grid, Arena& arena, Extent* extent) {
  const ArenaScope scope(arena);
  double* const planes = arena_alloc<double>(arena, kProbes * kProbes);
  int32_t num = 0;
  bool hit[kSectors] = {};
  extent->low = kPi;
  extent->high = 0;
  for_each_probe(camera, [&](const Vec3& ray) {
    const double x = dot(ray, grid.side), y = dot(ray, grid.up);
    const double angle = atan2(std::sqrt(x * x + y * y), dot(ray, grid.baseline));
    const double plane = angle_between_0_and_2pi(atan2(y, x));
    planes[num++] = plane;
    hit[static_cast<int32_t>(plane * (kSectors / (2 * kPi))) % kSectors] = true;
    extent->low = std::min(extent->low, angle);
    extent->high = std::max(extent->high, angle);
  });
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
  extent->first_row = start + least;
  extent->rows = most - least;
  return true;
}

// Turns the grid's axes so that `side` is as near as can be to where both cameras look. Returns
// false if image 0 is too wide for a flat grid.
bool flat_extent(const Camera& camera, const Mat3& R, DenseGrid* grid, Extent* extent) {
  const Vec3 axes(R(2, 0), R(2, 1), R(2, 2) + 1);
  const double x = dot(axes, grid->side), y = dot(axes, grid->up);
  const double size = std::sqrt(x * x + y * y);
  if (!(size > 0.1)) return false;
  DenseGrid turned = *grid;
  turned.side = combine(x / size, grid->side, y / size, grid->up);
  turned.up = combine(-y / size, grid->side, x / size, grid->up);
  double last_row = -kFlatReach;
  *extent = {kFlatReach, 0, kFlatReach, -kFlatReach};
  bool is_flat = true, any = false;
  for_each_probe(camera, [&](const Vec3& ray) {
    const double ahead = dot(ray, turned.side);
    const double c = -dot(ray, turned.baseline), v = dot(ray, turned.up), most = kFlatReach * ahead;
    if (!(std::fabs(c) <= most && std::fabs(v) <= most)) {
      is_flat = false;
      return;
    }
    any = true;
    extent->first_row = std::min(extent->first_row, v / ahead);
    last_row = std::max(last_row, v / ahead);
    extent->low = std::min(extent->low, c / ahead);
    extent->high = std::max(extent->high, c / ahead);
  });
  extent->rows = last_row - extent->first_row;
  if (is_flat && any) *grid = turned;
  return is_flat && any;
}

// The parallax of a flat grid that belongs to an angle between the rays, for a ray of image 0; and
// the angle itself for a grid of angles.
double parallax_of(const DenseGrid& grid, const Vec3& ray, double angle) {
  if (!grid.is_flat) return angle;
  const double along = dot(ray, grid.baseline), ahead = dot(ray, grid.side);
  const double across = dot(ray, grid.up);
  const double size_sq = along * along + ahead * ahead + across * across;
  double sine, cosine;
  sincos(angle, &sine, &cosine);
  // The ray of camera 1 is that of camera 0, turned by the angle away from the baseline.
  const double turned = std::sqrt(ahead * ahead + across * across) * cosine + along * sine;
  // A point without a position is taken for one in the middle.
  if (!(size_sq > 0)) return cosine > 0 ? sine / cosine : -1;
  return turned > 0 && ahead > 0 ? sine * size_sq / (turned * ahead) : -1;
}

struct ParallaxRange {
  double least, most;
};

// The range of parallax of points of status TV_POINT_OK, in the unit of the grid's columns.
bool range_of_points(const ParallaxHint& hint, const DenseGrid& grid, double pixel_angle,
                     Arena& arena, ParallaxRange* range) {
  const ArenaScope scope(arena);
  int32_t* const bins = arena_alloc<int32_t>(arena, kBins);
  for (int32_t k = 0; k < kBins; ++k) bins[k] = 0;
  const double width = std::max(pixel_angle, kPi / (kBins - 1));
  int32_t num = 0;
  for (int32_t i = 0; i < hint.num_points; ++i) {
    const tv_point& point = hint.points[i];
    const double angle = static_cast<double>(point.angle_rad);
    if (point.status != TV_POINT_OK || !(angle >= 0 && angle <= kPi)) continue;
    const Vec3 ray(point.position[0], point.position[1], point.position[2]);
    const double parallax = parallax_of(grid, ray, angle);
    if (!(parallax >= 0 && parallax <= kPi)) continue;
    ++bins[static_cast<int32_t>(parallax / width)];
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

// The range in the unit of the grid's columns. Returns false if a flat grid does not hold it.
bool range_of(const ParallaxHint& hint, const Camera& camera0, const DenseGrid& grid,
              double pixel_angle, int32_t max_steps, Arena& arena, ParallaxRange* range) {
  *range = {0, (max_steps - 2) * pixel_angle};
  bool is_held = true;
  if (hint.most > 0) {
    *range = {hint.least, hint.most};
    if (grid.is_flat) {
      is_held = hint.most <= kFlatParallax;
      // On a flat grid the same angle is the least parallax at the middle, and the most at the rim.
      double sine, cosine;
      sincos(std::min(hint.least, 1.0), &sine, &cosine);
      *range = {sine, 0};
      for_each_probe(camera0, [&](const Vec3& ray) {
        const double parallax = parallax_of(grid, ray, hint.most);
        is_held = is_held && parallax > 0;
        range->most = std::max(range->most, parallax);
      });
    }
  } else {
    range_of_points(hint, grid, pixel_angle, arena, range);
  }
  return is_held && (!grid.is_flat || range->most <= kFlatReach);
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

bool make_grid(const Camera& camera0, const Mat3& R, const Vec3& t, const ParallaxHint& hint,
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
  ParallaxRange range;
  grid->is_flat = true;
  if (!flat_extent(camera0, R, grid, &extent) ||
      !range_of(hint, camera0, *grid, pixel_angle, max_steps, arena, &range)) {
    grid->is_flat = false;
    if (!angular_extent(camera0, *grid, arena, &extent)) return false;
    range_of(hint, camera0, *grid, pixel_angle, max_steps, arena, &range);
  }
  // The step: a pixel, or as many as keep the steps of parallax within their number, and then the
  // cells and the columns.
  double step = std::max(pixel_angle, (range.most - range.least) / (max_steps - 2));
  double low = extent.low, high = extent.high, sine = 1;
  const double longest = longest_side(max_cells);
  for (int pass = 0; pass < 2; ++pass) {
    if (!grid->is_flat) {
      low = std::max(extent.low, kEpipoleSteps * step);
      high = std::min(extent.high, kPi - kEpipoleSteps * step);
      if (!(low < high)) return false;
      sine = widest_sine(low, high);
    }
    const double across = (high - low) / step + 1, down = extent.rows * sine / step + 1;
    if (pass == 0) {
      step *= std::max(1.0, std::max(std::sqrt(across * down / max_cells),
                                     std::max(across, down) / (longest - 1)));
    }
  }
  grid->step = step;
  grid->first_column = low;
  // A hundredth of a cell is for rounding: the grid of rectified images is that of their pixels.
  grid->width = std::min(columns_of(high - low + 0.01 * step, step), static_cast<int32_t>(longest));
  grid->row_step = step / sine;
  grid->first_row = extent.first_row;
  grid->height = std::min(std::min(columns_of(extent.rows + 0.01 * step, grid->row_step),
                                   static_cast<int32_t>(longest)),
                          max_cells / grid->width);
  grid->first_step = static_cast<int32_t>(range.least / step);
  const int32_t last = static_cast<int32_t>(range.most / step) + 1;
  constexpr int32_t kBlock = TVK_DENSE_BLOCK;
  const int32_t blocks = std::min(last - grid->first_step + kBlock, max_steps + kBlock - 1);
  grid->num_steps = blocks / kBlock * kBlock;
  grid->range_steps = std::min(last - grid->first_step + 2, grid->num_steps);
  return grid->height > 0;
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

// ---- Track: the pixel along a row is smooth, so the lens model is evaluated at every kSpan-th
// column, and a cubic through four of these nodes serves the columns between the middle two.

namespace {

int32_t spans_of(int32_t columns) { return (columns + kSpan - 1) / kSpan; }

}  // namespace

size_t track_bytes(int32_t columns) {
  const size_t spans = static_cast<size_t>(spans_of(columns));
  return arena_bytes<double>(2 * (spans + 3)) + arena_bytes<tvk_dense_span>(spans) +
         2 * arena_bytes<int32_t>(spans * kSpan);
}

Track::Track(const DenseGrid& grid, const DenseView& view, double first, int32_t columns,
             Arena& arena)
    : grid_(grid),
      view_(view),
      first_(first),
      last_u_(view.camera.model.width - 1),
      last_v_(view.camera.model.height - 1),
      columns_(columns),
      num_spans_(spans_of(columns)) {
  along_ = rotate(view.rotation, grid.baseline);
  side_ = rotate(view.rotation, grid.side);
  up_ = rotate(view.rotation, grid.up);
  nodes_ = arena_alloc<double>(arena, 2 * (static_cast<size_t>(num_spans_) + 3));
  spans_ = arena_alloc<tvk_dense_span>(arena, static_cast<size_t>(num_spans_));
  u_ = arena_alloc<int32_t>(arena, static_cast<size_t>(num_spans_ * kSpan));
  v_ = arena_alloc<int32_t>(arena, static_cast<size_t>(num_spans_ * kSpan));
  if (grid.is_flat) return;
  for (int32_t n = 0; n < num_spans_ + 3; ++n) {
    const double angle = grid.column(first + (n - 1) * kSpan);
    sincos(angle, nodes_ + 2 * n, nodes_ + 2 * n + 1);
    if (!(angle >= 0 && angle <= kPi)) nodes_[2 * n] = -1;
  }
}

bool Track::exact_at(double column, Vec2* pixel) const {
  if (grid_.is_flat) {
    return project(view_.camera, combine(-grid_.column(first_ + column), along_, 1, across_), pixel,
                   nullptr);
  }
  const double angle = grid_.column(first_ + column);
  if (!(angle >= 0 && angle <= kPi)) return false;
  double sine, cosine;
  sincos(angle, &sine, &cosine);
  return project(view_.camera, combine(cosine, along_, sine, across_), pixel, nullptr);
}

Place Track::exact_place_at(double column) const {
  Vec2 exact;
  if (!exact_at(column, &exact)) return {0, 0, false};
  return moved_inside(exact[0], exact[1]);
}

Place Track::moved_inside(double u, double v) const {
  const Place place{std::min(std::max(u, 0.0), last_u_), std::min(std::max(v, 0.0), last_v_), true};
  const bool is_near = std::fabs(u - place.u) <= 0.5 && std::fabs(v - place.v) <= 0.5;
  return {place.u, place.v, is_near};
}

void Track::go_to_row(int32_t y) {
  const double v = grid_.row(y);
  if (grid_.is_flat) {
    across_ = combine(1, side_, v, up_);
  } else {
    double sine, cosine;
    sincos(v, &sine, &cosine);
    across_ = combine(cosine, side_, sine, up_);
  }
  Vec2 at[4];
  bool has[4] = {};
  const double widest = 20000;  // the cubic is then an int32_t of 1/65536, too
  for (int32_t n = -3; n < num_spans_; ++n) {
    for (int i = 0; i < 3; ++i) at[i] = at[i + 1], has[i] = has[i + 1];
    const int32_t node = n + 3;
    if (grid_.is_flat) {
      const double c = grid_.column(first_ + (node - 1) * kSpan);
      has[3] = project(view_.camera, combine(-c, along_, 1, across_), &at[3], nullptr);
    } else {
      const double sine = nodes_[2 * node], cosine = nodes_[2 * node + 1];
      has[3] = sine >= 0 &&
               project(view_.camera, combine(cosine, along_, sine, across_), &at[3], nullptr);
    }
    has[3] = has[3] && std::fabs(at[3][0]) < widest && std::fabs(at[3][1]) < widest;
    if (n < 0) continue;
    tvk_dense_span& span = spans_[n];
    span = tvk_dense_span{};
    span.is_smooth = has[0] && has[1] && has[2] && has[3];
    if (!span.is_smooth) continue;
    for (int i = 0; i < 2; ++i) {
      const double a = at[0][i], b = at[1][i], c = at[2][i], d = at[3][i];
      span.at[0][i] = b;
      span.at[1][i] = (c - a / 3 - b / 2 - d / 6) / kSpan;
      span.at[2][i] = ((a + c) / 2 - b) / (kSpan * kSpan);
      span.at[3][i] = ((d - a) / 6 + (b - c) / 2) / (kSpan * kSpan * kSpan);
    }
  }
}

void Track::sample(const tvk_dense_table& kernels, uint8_t* pixels) const {
  const tv_image& image = view_.image;
  const double scale = 1.0 / (1 << view_.halvings);
  kernels.place_row(spans_, num_spans_, scale, image.width, image.height, u_, v_);
  for (int32_t n = 0; n < num_spans_; ++n) {
    for (int32_t x = n * kSpan; x < (n + 1) * kSpan && !spans_[n].is_smooth; ++x) {
      Vec2 at;
      if (!exact_at(x, &at)) continue;
      const double column = (at[0] + 0.5) * scale - 0.5, row = (at[1] + 0.5) * scale - 0.5;
      if (!(column >= 0 && row >= 0 && column <= image.width - 1 && row <= image.height - 1))
        continue;
      u_[x] = static_cast<int32_t>(column * 65536);
      v_[x] = static_cast<int32_t>(row * 65536);
    }
  }
  kernels.sample_row(image.data, image.width, image.height, image.stride_bytes, u_, v_, columns_,
                     pixels);
}

}  // namespace tv
