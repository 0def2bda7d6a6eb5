#include "dense/parallel_view.h"

#include <algorithm>
#include <cmath>

#include "dense/sweep.h"
#include "triangulation/frame.h"

namespace tv {
namespace {

// The lens model is evaluated at every kCell-th sample, and pixels between are interpolated. Over 8
// samples a lens bends by hundredths of a pixel.
constexpr int32_t kCell = 8;
constexpr double kFixed = 65536;

int32_t nodes_of(int32_t samples) { return (samples + kCell - 1) / kCell + 1; }

// Where the image shows a node of the lattice, in units of 1 / kFixed pixel; valid false where it
// does not.
struct Node {
  int32_t u, v;
  bool valid;
};

// How many pixels across are averaged before the image is sampled.
int32_t reduction_of(const tv_camera& camera, const MapGrid& grid) {
  const double ratio = std::min(camera.fx, camera.fy) / (2 * grid.focal);
  const int32_t least_side = std::min(camera.width, camera.height);
  return std::max(1, std::min(static_cast<int32_t>(std::min(ratio, 64.0)), least_side));
}

// The means of times x times pixels.
tv_image reduce(const tv_image& image, int32_t times, Arena& arena) {
  if (times == 1) return image;
  const int32_t width = image.width / times, height = image.height / times;
  uint8_t* const out =
      arena_alloc<uint8_t>(arena, static_cast<size_t>(width) * static_cast<size_t>(height));
  const int32_t area = times * times;
  for (int32_t y = 0; y < height; ++y) {
    for (int32_t x = 0; x < width; ++x) {
      int32_t sum = area / 2;
      for (int32_t v = 0; v < times; ++v) {
        const uint8_t* p =
            image.data + static_cast<int64_t>(y * times + v) * image.stride_bytes + x * times;
        for (int32_t u = 0; u < times; ++u) sum += p[u];
      }
      out[static_cast<ptrdiff_t>(y) * width + x] = static_cast<uint8_t>(sum / area);
    }
  }
  return {out, width, height, width};
}

// The grey level at a place in units of 1 / kFixed pixel that lies inside the image, [1, 255].
uint8_t sample(const tv_image& image, int32_t u, int32_t v) {
  const uint8_t* p = image.data + static_cast<int64_t>(v >> 16) * image.stride_bytes + (u >> 16);
  const uint8_t* q = p + image.stride_bytes;
  const int32_t du = u >> 8 & 255, dv = v >> 8 & 255;
  const int32_t upper = 256 * p[0] + du * (p[1] - p[0]);
  const int32_t lower = 256 * q[0] + du * (q[1] - q[0]);
  return static_cast<uint8_t>(std::max((256 * upper + dv * (lower - upper) + 32768) >> 16, 1));
}

bool is_inside(const tv_image& image, int32_t u, int32_t v) {
  return u >= 0 && v >= 0 && u >> 16 < image.width - 1 && v >> 16 < image.height - 1;
}

// A line of nodes: the lens model at the samples (kCell * column, sample_y).
void project_nodes(const ParallelView& view, const Camera& camera, const Mat3& cam_from_map,
                   const MapGrid& grid, int32_t times, int32_t sample_y, int32_t num_nodes,
                   Node* nodes) {
  // Sample s lies at s / 2 - 1 / 4 - margin pixels of the map: two of them are centred on a pixel.
  const double y = (sample_y * 0.5 - 0.25 - view.margin_y - (grid.height - 1) * 0.5) / grid.focal;
  for (int32_t k = 0; k < num_nodes; ++k) {
    const double x = (k * kCell * 0.5 - 0.25 - view.margin_x - (grid.width - 1) * 0.5) / grid.focal;
    Vec2 at;
    nodes[k].valid = project(camera, rotate(cam_from_map, Vec3(x, y, 1)), &at, nullptr);
    if (!nodes[k].valid) continue;
    const double u = (at[0] + 0.5) / times - 0.5, v = (at[1] + 0.5) / times - 0.5;
    nodes[k].valid = std::fabs(u) < 16384 && std::fabs(v) < 16384;
    if (!nodes[k].valid) continue;
    nodes[k].u = static_cast<int32_t>(u * kFixed);
    nodes[k].v = static_cast<int32_t>(v * kFixed);
  }
}

// A line of samples between two lines of nodes; row: 0 .. kCell - 1 below the upper one. 0 outside.
void sample_line(const tv_image& image, const Node* upper, const Node* lower, int32_t row,
                 int32_t num_samples, uint8_t* samples) {
  static_assert(kCell * kCell == 64, "the shifts below divide by it");
  for (int32_t x = 0; x < num_samples; x += kCell) {
    const Node *a = upper + x / kCell, *b = lower + x / kCell;
    const int32_t last = std::min(kCell, num_samples - x);
    if (!(a[0].valid && a[1].valid && b[0].valid && b[1].valid)) {
      for (int32_t i = 0; i < last; ++i) samples[x + i] = 0;
      continue;
    }
    // 64 times the coordinates, which need 64 bits, of the cell's ends in this line.
    const int64_t u0 = 8 * (int64_t{a[0].u} * (kCell - row) + int64_t{b[0].u} * row);
    const int64_t u1 = 8 * (int64_t{a[1].u} * (kCell - row) + int64_t{b[1].u} * row);
    const int64_t v0 = 8 * (int64_t{a[0].v} * (kCell - row) + int64_t{b[0].v} * row);
    const int64_t v1 = 8 * (int64_t{a[1].v} * (kCell - row) + int64_t{b[1].v} * row);
    const int64_t du = (u1 - u0) >> 3, dv = (v1 - v0) >> 3;
    // What lies between two places inside the image is inside it.
    const bool is_whole =
        is_inside(image, static_cast<int32_t>(u0 >> 6), static_cast<int32_t>(v0 >> 6)) &&
        is_inside(image, static_cast<int32_t>(u1 >> 6), static_cast<int32_t>(v1 >> 6));
    for (int32_t i = 0; i < last; ++i) {
      const int32_t u = static_cast<int32_t>((u0 + du * i) >> 6);
      const int32_t v = static_cast<int32_t>((v0 + dv * i) >> 6);
      samples[x + i] = is_whole || is_inside(image, u, v) ? sample(image, u, v) : uint8_t{0};
    }
  }
}

// The census of each element: its window has every second element, as the map has pixels.
void census_of(const ParallelView& view, const tvk_dense_table& kernels) {
  constexpr int32_t kDown = TVK_SWEEP_DOWN;
  for (int32_t y = 0; y < view.height; ++y) {
    uint32_t* const census = view.census + static_cast<ptrdiff_t>(y) * view.width;
    if (y < 2 * kDown || y >= view.height - 2 * kDown) {
      for (int32_t x = 0; x < view.width; ++x) census[x] = kNoCensus;
      continue;
    }
    const uint8_t* rows[2 * kDown + 1];
    for (int32_t v = -kDown; v <= kDown; ++v) {
      rows[v + kDown] = view.grey + static_cast<ptrdiff_t>(y + 2 * v) * view.width;
    }
    kernels.census_words(rows, view.width, census);
  }
}

}  // namespace

MapGrid map_grid_of(const tv_camera& camera, int32_t max_pixels) {
  const double pixels = static_cast<double>(camera.width) * camera.height;
  const double scale = std::min(1.0, std::sqrt(max_pixels / pixels));
  const double focal = 0.5 * (camera.fx + camera.fy);
  return {std::max(1, static_cast<int32_t>(camera.width * scale)),
          std::max(1, static_cast<int32_t>(camera.height * scale)), focal * scale};
}

void size_parallel_view(const MapGrid& grid, bool with_margin, ParallelView* view) {
  view->margin_x = with_margin ? grid.width / 4 : 0;
  view->margin_y = with_margin ? grid.height / 4 : 0;
  view->width = 2 * (grid.width + 2 * view->margin_x);
  view->height = 2 * (grid.height + 2 * view->margin_y);
}

size_t parallel_view_bytes(const ParallelView& view) {
  const size_t count = static_cast<size_t>(view.width) * static_cast<size_t>(view.height);
  return pixels_bytes(count) + arena_bytes<uint32_t>(count + TVK_DENSE_BLOCK);
}

size_t parallel_view_scratch_bytes(const ParallelView& view, const tv_camera& camera,
                                   const MapGrid& grid) {
  const size_t times = static_cast<size_t>(reduction_of(camera, grid));
  const size_t reduced =
      static_cast<size_t>(camera.width) / times * (static_cast<size_t>(camera.height) / times);
  const size_t samples = static_cast<size_t>(view.width) + 1;
  return (times == 1 ? 0 : arena_bytes<uint8_t>(reduced)) +
         2 * arena_bytes<Node>(static_cast<size_t>(nodes_of(view.width + 1)) + 1) +
         2 * arena_bytes<uint8_t>(samples);
}

void make_parallel_view(const tv_image& image, const Camera& camera, const Mat3& cam_from_map,
                        const MapGrid& grid, const tvk_dense_table& kernels, Arena& arena,
                        ParallelView* view) {
  const size_t count = static_cast<size_t>(view->width) * static_cast<size_t>(view->height);
  view->grey = pixels_alloc(count, arena);
  view->census = arena_alloc<uint32_t>(arena, count + TVK_DENSE_BLOCK);
  const ArenaScope scope(arena);
  const int32_t times = reduction_of(camera.model, grid);
  const tv_image reduced = reduce(image, times, arena);
  const int32_t num_samples = view->width + 1, num_nodes = nodes_of(num_samples) + 1;
  Node* upper = arena_alloc<Node>(arena, static_cast<size_t>(num_nodes));
  Node* lower = arena_alloc<Node>(arena, static_cast<size_t>(num_nodes));
  uint8_t* line = arena_alloc<uint8_t>(arena, static_cast<size_t>(num_samples));
  uint8_t* next = arena_alloc<uint8_t>(arena, static_cast<size_t>(num_samples));
  for (int32_t y = 0; y <= view->height; ++y) {
    if (y % kCell == 0) {
      if (y > 0) std::swap(upper, lower);
      if (y == 0) project_nodes(*view, camera, cam_from_map, grid, times, 0, num_nodes, upper);
      project_nodes(*view, camera, cam_from_map, grid, times, y + kCell, num_nodes, lower);
    }
    std::swap(line, next);
    sample_line(reduced, upper, lower, y % kCell, num_samples, next);
    if (y == 0) continue;
    uint8_t* const grey = view->grey + static_cast<ptrdiff_t>(y - 1) * view->width;
    for (int32_t x = 0; x < view->width; ++x) {
      const bool whole = line[x] != 0 && line[x + 1] != 0 && next[x] != 0 && next[x + 1] != 0;
      const int32_t mean = (line[x] + line[x + 1] + next[x] + next[x + 1] + 2) >> 2;
      grey[x] = static_cast<uint8_t>(whole ? mean : 0);
    }
  }
  census_of(*view, kernels);
}

}  // namespace tv
