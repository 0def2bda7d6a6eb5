#include "odometry/still_cells.h"

#include <algorithm>
#include <cstring>

#include "robust/still.h"

namespace tv {
namespace {

// For so many frames a cell is still after a pair has said so, and twice as many each time that it
// is said again: then its keypoints are taken again, and what stands still no longer is used. If
// it does, the next pair says so.
constexpr int32_t kStillFrames = 300;
constexpr int kMostDoublings = 6;

// Half the side of what is left out around a keypoint, in its sizes: one cell of its descriptor.
constexpr float kReachOfSize = 1.5f;

int32_t cell_of(float x, int32_t cells) {
  return std::clamp(static_cast<int32_t>(x) / kStillCellPx, 0, cells - 1);
}

bool is_still(const StillCell& cell, int32_t frame) { return cell.until > frame; }

// Marks the cells that the core of the keypoint's descriptor covers: next to text, half of what a
// descriptor sees is text.
void mark_cells(Odometry* odometry, const tv_keypoint& keypoint) {
  const int32_t now = odometry->num_frames;
  const int32_t columns = odometry->still_columns, rows = odometry->still_rows;
  const float reach = kReachOfSize * keypoint.size;
  const int32_t x0 = cell_of(keypoint.x - reach, columns),
                x1 = cell_of(keypoint.x + reach, columns);
  const int32_t y0 = cell_of(keypoint.y - reach, rows), y1 = cell_of(keypoint.y + reach, rows);
  for (int32_t y = y0; y <= y1; ++y) {
    for (int32_t x = x0; x <= x1; ++x) {
      StillCell& cell = odometry->still_cells[y * columns + x];
      if (is_still(cell, now)) continue;
      cell.until = now + (kStillFrames << cell.num_times);
      cell.num_times = std::min(cell.num_times + 1, kMostDoublings);
      odometry->still_until = std::max(odometry->still_until, cell.until);
    }
  }
}

}  // namespace

void mark_still(Odometry* odometry, const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                const tv_correspondence* matches, int32_t num) {
  for (int32_t k = 0; k < num; ++k) {
    const tv_keypoint& a = keypoints0[matches[k].idx0];
    const tv_keypoint& b = keypoints1[matches[k].idx1];
    const double dx = static_cast<double>(b.x) - static_cast<double>(a.x);
    const double dy = static_cast<double>(b.y) - static_cast<double>(a.y);
    const double reach = kStillThresholds *
                         std::max(1.0, static_cast<double>(std::max(a.size, b.size) / kFinestSize));
    if (!(dx * dx + dy * dy < reach * reach)) continue;
    mark_cells(odometry, a);
    mark_cells(odometry, b);
  }
}

double still_share(const Odometry& odometry) {
  if (odometry.still_until <= odometry.num_frames) return 0;
  const int32_t cells = odometry.still_columns * odometry.still_rows;
  int32_t num = 0;
  for (int32_t c = 0; c < cells; ++c) num += is_still(odometry.still_cells[c], odometry.num_frames);
  return static_cast<double>(num) / cells;
}

void write_mask(const Odometry& odometry, const tv_image* given, uint8_t* mask) {
  const int32_t width = odometry.given_camera.width, height = odometry.given_camera.height;
  const size_t row_bytes = static_cast<size_t>(width);
  for (int32_t y = 0; y < height; ++y) {
    uint8_t* row = mask + row_bytes * static_cast<size_t>(y);
    if (given != nullptr)
      std::memcpy(row, given->data + y * given->stride_bytes, row_bytes);
    else
      std::memset(row, 255, row_bytes);
    const StillCell* cells = odometry.still_cells + y / kStillCellPx * odometry.still_columns;
    for (int32_t c = 0; c < odometry.still_columns; ++c) {
      if (!is_still(cells[c], odometry.num_frames)) continue;
      const int32_t begin = c * kStillCellPx, end = std::min(begin + kStillCellPx, width);
      std::memset(row + begin, 0, static_cast<size_t>(end - begin));
    }
  }
}

}  // namespace tv
