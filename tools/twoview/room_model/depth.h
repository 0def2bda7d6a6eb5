// The depth map of one keyframe, as it is kept until the room is finished.
#pragma once

#include <array>
#include <opencv2/core/mat.hpp>
#include <vector>

#include "room_model/scene.h"
#include "twoview/context.h"
#include "twoview/depth_map.h"

namespace cli {

// A view's picture.
struct RoomPicture {
  cv::Mat luma;    // 8-bit; empty: could not be read
  cv::Mat colour;  // BGR of the size of luma; empty: grey
  cv::Mat mask;    // of the size of luma, 0 where it shows no scene; empty: all of it does
};

// What is known of each pixel of a map, row by row.
struct MapPixels {
  std::vector<float> distance, sigma;  // 0 where unknown
  // Red, green, blue: also of pixels without a distance, because planes are carried across them.
  std::vector<uint8_t> rgb;
  std::vector<uint8_t> shown;  // 0 where the picture shows nothing of the scene
};

// A depth map that stores, for pixels without a distance, their colours only.
class KnownPixels {
 public:
  explicit KnownPixels(const MapPixels& pixels);
  void unpack(MapPixels& pixels) const;
  size_t num_known() const { return distance_.size(); }

 private:
  std::vector<bool> is_known_, is_shown_;
  std::vector<float> distance_, sigma_;
  std::vector<uint8_t> rgb_;
};

// What became of a map's pixels, in tiles of it: row by row.
constexpr int kTileColumns = 8, kTileRows = 6;
using TileCounts = std::array<PixelCounts, static_cast<size_t>(kTileColumns* kTileRows)>;

// Sweeps the depth of views; its memory is made once.
class DepthSweep {
 public:
  // With the library's own options. Throws BadInput where no depth map can be made of pictures of
  // this camera.
  explicit DepthSweep(const tv_camera& camera);
  // The range of depth in the options is not read.
  DepthSweep(const tv_camera& camera, const tv_depth_options& options);
  // What the map's pixels lie on: a pinhole.
  const tv_camera& map_camera() const { return map_camera_; }

  // The depth of the first view; `counts` gets what became of its pixels. All pictures have their
  // luma, and there are two at least.
  KnownPixels run(const std::vector<const RoomView*>& views,
                  const std::vector<const RoomPicture*>& pictures, double near_depth,
                  double far_depth, TileCounts& counts);
  // The pixels of the map without texture, for a view that has no map.
  void count_unmapped(const RoomPicture& picture, TileCounts& counts);
  // The direction in which a tile's middle looks, in the frame of the camera.
  Vector3 ray_of_tile(int column, int row) const;

 private:
  size_t tile_of(size_t pixel) const;
  // For each pixel of the map whether the picture shows it: 0 where the lens leaves the map's edge
  // outside the picture, or where the mask is 0.
  cv::Mat shown_by(const RoomPicture& picture) const;
  void bring_to_map(const cv::Mat& picture, cv::Mat& out, int interpolation) const;

  tv_camera camera_, map_camera_;
  tv_depth_options options_;
  std::vector<uint8_t> memory_;
  size_t memory_bytes_ = 0;
  cv::Mat map_x_, map_y_;  // where the reduced picture shows each pixel of the map
  cv::Size reduced_;       // size to which a picture is reduced before it is sampled
  MapPixels pixels_;
  std::vector<uint8_t> witnesses_, grey_;
};

// The first address of `memory` that the library's contexts may start at; `memory` has
// TV_CONTEXT_ALIGNMENT bytes more than are needed.
uint8_t* aligned(std::vector<uint8_t>& memory);

}  // namespace cli
