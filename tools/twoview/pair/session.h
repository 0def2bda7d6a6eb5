// A context of the library that grows with the images it meets, and its stage times.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "image_file.h"
#include "options.h"
#include "twoview/twoview.h"

namespace cli {

// Nanoseconds of CLOCK_MONOTONIC.
uint64_t now_ns();

class Session {
 public:
  explicit Session(const Options& options) : options_(options) {}

  // A context for images up to this size; what an earlier call gave is gone if it had to grow.
  tv_context* context(int width, int height);
  tv_context* get() const { return context_.get(); }
  size_t context_bytes() const { return context_bytes_; }
  std::string kernels() const;

  // {pyramid, detect, ..., total} in milliseconds since the last call. Stages that a verb does not
  // run are left out unless `all`.
  nlohmann::ordered_json take_times(uint64_t total_ns, bool all);

 private:
  struct Free {
    void operator()(tv_context* context) const;
  };
  const Options& options_;
  std::unique_ptr<tv_context, Free> context_;
  int width_ = 0, height_ = 0;
  size_t context_bytes_ = 0;
};

// Keypoints with descriptors of one image, as the main job finds them.
struct Features {
  std::vector<tv_keypoint> keypoints;
  std::vector<uint8_t> descriptors;
};
Features extract(tv_context* context, const Picture& picture, const Options& options);

}  // namespace cli
