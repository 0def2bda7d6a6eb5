// A context of the library that grows with the largest image so far, and the times of its stages.
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <vector>

#include "files/image_file.h"
#include "pair/options.h"
#include "twoview/twoview.h"

namespace cli {

// The time of CLOCK_MONOTONIC in nanoseconds.
uint64_t now_ns();

class Session {
 public:
  explicit Session(const Options& options) : options_(options) {}

  // Returns a context for images up to this size, and for this many matches where they are given
  // (0: as many as keypoints). If it must grow, the context that an earlier call returned is freed,
  // so do not keep that pointer.
  tv_context* context(int width, int height, size_t max_matches = 0);
  tv_context* get() const { return context_.get(); }
  size_t context_bytes() const { return context_bytes_; }
  std::string kernels() const;

  // The times since the last call in milliseconds, as {pyramid, detect, ..., total}; total is
  // total_ns. A stage that did not run is omitted unless `all` is true.
  nlohmann::ordered_json take_times(uint64_t total_ns, bool all);

 private:
  struct Free {
    void operator()(tv_context* context) const;
  };
  const Options& options_;
  std::unique_ptr<tv_context, Free> context_;
  int width_ = 0, height_ = 0;
  size_t max_matches_ = 0;
  size_t context_bytes_ = 0;
};

// The keypoints and descriptors of one image, extracted as reconstruct_pair does.
struct Features {
  std::vector<tv_keypoint> keypoints;
  std::vector<uint8_t> descriptors;
};
Features extract(tv_context* context, const Picture& picture, const Options& options);
std::vector<tv_correspondence> match_features(tv_context* context, const Features& f0,
                                              const Features& f1, const tv_match_options& options);

}  // namespace cli
