#include "room_model/depth.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "files/camera_file.h"

namespace cli {
namespace {

// A distance that fewer other pictures confirm is left out: one alone may be a chance likeness.
constexpr int kFewestWitnesses = 2;
// The largest difference of neighbours in a smoothed picture, in grey levels, that counts as no
// texture, as in tv_room_infer_options; and the side of the window that is looked at, in pixels.
constexpr int kPlainStep = 3, kPlainWindow = 9;

tv_image view_of(const cv::Mat& luma) {
  return {luma.data, luma.cols, luma.rows, static_cast<int64_t>(luma.step)};
}

// 255 where the surroundings of a pixel have texture.
cv::Mat texture_of(const cv::Mat& grey) {
  cv::Mat smooth, low, high, step;
  cv::blur(grey, smooth, {3, 3});
  const cv::Mat near = cv::Mat::ones(3, 3, CV_8U);
  cv::dilate(smooth, high, near);
  cv::erode(smooth, low, near);
  cv::subtract(high, low, step);
  cv::Mat textured = step > kPlainStep;
  cv::dilate(textured, textured, cv::Mat::ones(kPlainWindow, kPlainWindow, CV_8U));
  return textured;
}

tv_depth_options usual_options() {
  tv_depth_options options;
  tv_depth_options_init(&options);
  return options;
}

}  // namespace

uint8_t* aligned(std::vector<uint8_t>& memory) {
  const size_t over = reinterpret_cast<uintptr_t>(memory.data()) % TV_CONTEXT_ALIGNMENT;
  return memory.data() + (over == 0 ? 0 : TV_CONTEXT_ALIGNMENT - over);
}

KnownPixels::KnownPixels(const MapPixels& pixels)
    : is_known_(pixels.distance.size()), is_shown_(pixels.distance.size()), rgb_(pixels.rgb) {
  for (size_t i = 0; i < is_known_.size(); ++i) {
    is_shown_[i] = pixels.shown[i] != 0;
    if (!(pixels.distance[i] > 0)) continue;
    is_known_[i] = true;
    distance_.push_back(pixels.distance[i]);
    sigma_.push_back(pixels.sigma[i]);
  }
  distance_.shrink_to_fit();
  sigma_.shrink_to_fit();
}

void KnownPixels::unpack(MapPixels& pixels) const {
  pixels.distance.assign(is_known_.size(), 0);
  pixels.sigma.assign(is_known_.size(), 0);
  pixels.shown.resize(is_known_.size());
  pixels.rgb = rgb_;
  size_t next = 0;
  for (size_t i = 0; i < is_known_.size(); ++i) {
    pixels.shown[i] = is_shown_[i] ? 255 : 0;
    if (!is_known_[i]) continue;
    pixels.distance[i] = distance_[next];
    pixels.sigma[i] = sigma_[next];
    ++next;
  }
}

DepthSweep::DepthSweep(const tv_camera& camera) : DepthSweep(camera, usual_options()) {}

DepthSweep::DepthSweep(const tv_camera& camera, const tv_depth_options& options)
    : camera_(camera), options_(options) {
  check(tv_depth_map_camera(&camera_, &options_, &map_camera_), "cannot make depth maps");
  check(tv_depth_size(&camera_, &options_, &memory_bytes_), "cannot make depth maps");
  memory_.resize(memory_bytes_ + TV_CONTEXT_ALIGNMENT);
  const int width = map_camera_.width, height = map_camera_.height;
  const size_t count = static_cast<size_t>(width) * static_cast<size_t>(height);
  pixels_.distance.resize(count);
  pixels_.sigma.resize(count);
  witnesses_.resize(count);
  grey_.resize(count);
  pixels_.rgb.resize(3 * count);
  // A picture is reduced by area averaging before it is sampled: single pixels of a large one would
  // be noise.
  const double scale = std::min(1.0, map_camera_.fx / camera_.fx);
  reduced_ = {std::max(1, static_cast<int>(std::lround(scale * camera_.width))),
              std::max(1, static_cast<int>(std::lround(scale * camera_.height)))};
  const tv_camera small = resized(camera_, reduced_.width, reduced_.height);
  map_x_.create(height, width, CV_32F);
  map_y_.create(height, width, CV_32F);
  std::vector<double> rays, places(2 * count);
  std::vector<uint8_t> inside(count);
  for (int y = 0; y < height; ++y)
    for (int x = 0; x < width; ++x)
      rays.insert(rays.end(), {(x - map_camera_.cx) / map_camera_.fx,
                               (y - map_camera_.cy) / map_camera_.fy, 1});
  check(tv_camera_project_points(&small, rays.data(), static_cast<int32_t>(count), places.data(),
                                 inside.data()),
        "cannot make depth maps");
  constexpr float kNowhere = -1e6f;
  for (size_t i = 0; i < count; ++i) {
    map_x_.ptr<float>()[i] = inside[i] != 0 ? static_cast<float>(places[2 * i]) : kNowhere;
    map_y_.ptr<float>()[i] = inside[i] != 0 ? static_cast<float>(places[2 * i + 1]) : kNowhere;
  }
}

void DepthSweep::bring_to_map(const cv::Mat& picture, cv::Mat& out, int interpolation) const {
  cv::Mat small = picture;
  if (picture.size() != reduced_) cv::resize(picture, small, reduced_, 0, 0, cv::INTER_AREA);
  // A mask is 0 beyond the picture. Levels go on there, so that its edge does not darken pixels.
  cv::remap(small, out, map_x_, map_y_, interpolation,
            interpolation == cv::INTER_NEAREST ? cv::BORDER_CONSTANT : cv::BORDER_REPLICATE);
}

cv::Mat DepthSweep::shown_by(const RoomPicture& picture) const {
  cv::Mat shown;
  bring_to_map(picture.mask.empty() ? cv::Mat(picture.luma.size(), CV_8U, 255) : picture.mask,
               shown, cv::INTER_NEAREST);
  return shown;
}

KnownPixels DepthSweep::run(const std::vector<const RoomView*>& views,
                            const std::vector<const RoomPicture*>& pictures, double near_depth,
                            double far_depth, TileCounts& tiles) {
  std::vector<tv_depth_view> swept(views.size());
  for (size_t k = 0; k < views.size(); ++k) {
    swept[k].image = view_of(pictures[k]->luma);
    swept[k].camera = &camera_;
    std::copy(views[k]->R.begin(), views[k]->R.end(), swept[k].world_from_cam_R);
    std::copy(views[k]->t.begin(), views[k]->t.end(), swept[k].world_from_cam_t);
  }
  options_.near_depth = near_depth;
  options_.far_depth = far_depth;
  const tv_depth_arrays arrays{pixels_.distance.data(), pixels_.sigma.data(), witnesses_.data(),
                               grey_.data()};
  check(tv_sweep_depth(aligned(memory_), memory_bytes_, swept.data(),
                       static_cast<int32_t>(swept.size()), &options_, &arrays),
        "the depth of " + views[0]->name);
  const RoomPicture& picture = *pictures[0];
  const cv::Size size(map_camera_.width, map_camera_.height);
  cv::Mat bgr, rgb(size, CV_8UC3, pixels_.rgb.data());
  bring_to_map(picture.colour.empty() ? picture.luma : picture.colour, bgr, cv::INTER_LINEAR);
  cv::cvtColor(bgr, rgb, bgr.channels() == 1 ? cv::COLOR_GRAY2RGB : cv::COLOR_BGR2RGB);
  const cv::Mat shown = shown_by(picture);
  pixels_.shown.assign(shown.data, shown.data + shown.total());
  const cv::Mat textured = texture_of(cv::Mat(size, CV_8U, grey_.data()));
  for (size_t i = 0; i < pixels_.distance.size(); ++i) {
    PixelCounts& counts = tiles[tile_of(i)];
    float& distance = pixels_.distance[i];
    if (shown.data[i] == 0) {
      distance = 0;
    } else if (witnesses_[i] >= kFewestWitnesses && distance > 0) {
      ++counts.measured;
    } else {
      ++(textured.data[i] == 0 ? counts.no_texture
         : distance > 0        ? counts.unconfirmed
                               : counts.ambiguous);
      distance = 0;
    }
  }
  return KnownPixels(pixels_);
}

void DepthSweep::count_unmapped(const RoomPicture& picture, TileCounts& tiles) {
  cv::Mat grey;
  bring_to_map(picture.luma, grey, cv::INTER_LINEAR);
  const cv::Mat textured = texture_of(grey), shown = shown_by(picture);
  for (size_t i = 0; i < grey.total(); ++i) {
    if (shown.data[i] == 0) continue;
    PixelCounts& counts = tiles[tile_of(i)];
    ++(textured.data[i] == 0 ? counts.no_texture : counts.one_place);
  }
}

size_t DepthSweep::tile_of(size_t pixel) const {
  const size_t width = static_cast<size_t>(map_camera_.width);
  const size_t height = static_cast<size_t>(map_camera_.height);
  const size_t column = pixel % width * kTileColumns / width;
  return pixel / width * kTileRows / height * kTileColumns + column;
}

Vector3 DepthSweep::ray_of_tile(int column, int row) const {
  const double x = (column + 0.5) * map_camera_.width / kTileColumns - 0.5;
  const double y = (row + 0.5) * map_camera_.height / kTileRows - 0.5;
  return {(x - map_camera_.cx) / map_camera_.fx, (y - map_camera_.cy) / map_camera_.fy, 1};
}

}  // namespace cli
