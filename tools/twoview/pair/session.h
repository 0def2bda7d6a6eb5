// A context of the library, which grows to the largest image so far, and the times of its stages.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json.hpp>
#include <vector>

#include "files/image_file.h"
#include "pair/options.h"
#include "twoview/twoview.h"

namespace cli {

// Nanoseconds of CLOCK_MONOTONIC.
uint64_t now_ns();

class Session {
 public:
  explicit Session(const Options& options) : options_(options) {}

  // A context for images up to this size. When it has to grow, the one that an earlier call
  // returned is freed.
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

// Keypoints with descriptors of one image, found as reconstruct_pair finds them.
struct Features {
  std::vector<tv_keypoint> keypoints;
  std::vector<uint8_t> descriptors;
};
Features extract(tv_context* context, const Picture& picture, const Options& options);

}  // namespace cli
