#include "pair/dense_cloud.h"

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "pair/session.h"

namespace cli {
namespace {

// The default options, or more cells where they would be too few for so many points.
tv_dense_options options_for(int32_t most) {
  constexpr int32_t cells_of_a_point = 4, most_steps = 512;
  tv_dense_options options;
  tv_dense_options_init(&options);
  const int32_t wanted = cells_of_a_point * most;
  if (wanted <= options.max_cells) return options;
  const double finer = std::sqrt(static_cast<double>(wanted) / options.max_cells);
  options.max_cells = wanted;
  options.max_steps = std::min(most_steps, static_cast<int32_t>(options.max_steps * finer));
  return options;
}

// Whether the masks use the pixels that show a point.
bool is_used(const Outcome& outcome, const tv_dense_point& point) {
  const float* const pixels[] = {point.pixel0, point.pixel1};
  for (int i = 0; i < 2; ++i) {
    const cv::Mat& mask = outcome.picture[i].mask;
    if (mask.empty()) continue;
    const int x = std::clamp(static_cast<int>(std::lround(pixels[i][0])), 0, mask.cols - 1);
    const int y = std::clamp(static_cast<int>(std::lround(pixels[i][1])), 0, mask.rows - 1);
    if (mask.at<uint8_t>(y, x) == 0) return false;
  }
  return true;
}

}  // namespace

uint64_t densify_pair(int32_t most, Outcome& outcome) {
  if (!has_full_pose(outcome.two_view)) return 0;
  const tv_reconstruction& r = outcome.reconstruction;
  tv_dense_options options = options_for(most);
  options.sparse = r.points;
  options.num_sparse = r.num_matches;
  const tv_camera_pair pair = corrected_pair(outcome);
  const tv_image images[2] = {outcome.picture[0].view(), outcome.picture[1].view()};
  size_t bytes = 0;
  check(tv_dense_size(&pair.camera0, &pair.camera1, &options, &bytes), "cannot make a dense cloud");
  std::vector<uint8_t> room(bytes + TV_CONTEXT_ALIGNMENT);
  const size_t over = reinterpret_cast<uintptr_t>(room.data()) % TV_CONTEXT_ALIGNMENT;
  uint8_t* const memory = room.data() + (over == 0 ? 0 : TV_CONTEXT_ALIGNMENT - over);
  std::vector<tv_dense_point> points(static_cast<size_t>(most));
  int32_t count = 0;
  const uint64_t start_ns = now_ns();
  check(tv_densify(memory, bytes, &pair, images, &options, points.data(), most, &count),
        "cannot make a dense cloud");
  const uint64_t time_ns = now_ns() - start_ns;
  points.resize(static_cast<size_t>(count));
  points.erase(std::remove_if(points.begin(), points.end(),
                              [&](const tv_dense_point& p) { return !is_used(outcome, p); }),
               points.end());
  outcome.dense = std::move(points);
  return time_ns;
}

}  // namespace cli
