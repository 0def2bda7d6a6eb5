#include "pair/session.h"

#include <time.h>
#include <nlohmann/json.hpp>

#include <algorithm>

#include "base/error.h"
#include "twoview/alloc.h"

namespace cli {
namespace {

uint64_t clock_ns(void*) { return now_ns(); }

constexpr const char* kStages[TV_NUM_STAGES] = {"pyramid",  "detect", "describe",   "match",
                                                "estimate", "refine", "triangulate"};

}  // namespace

uint64_t now_ns() {
  timespec time{};
  clock_gettime(CLOCK_MONOTONIC, &time);
  return static_cast<uint64_t>(time.tv_sec) * 1000000000u + static_cast<uint64_t>(time.tv_nsec);
}

void Session::Free::operator()(tv_context* context) const { tv_context_free(context); }

tv_context* Session::context(int width, int height, size_t max_matches) {
  if (context_ && width <= width_ && height <= height_ && max_matches <= max_matches_)
    return context_.get();
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = std::max(width, width_);
  limits.max_height = std::max(height, height_);
  limits.max_keypoints = options_.feature.max_keypoints;
  max_matches_ = std::max(max_matches, max_matches_);
  limits.max_matches = static_cast<int32_t>(max_matches_);
  limits.kernels = options_.kernels;
  limits.max_effort = options_.highest_rung();
  context_.reset();
  check(tv_context_size(&limits, &context_bytes_), "cannot make a context");
  tv_context* context = nullptr;
  const tv_status status = tv_context_new(&context, &limits);
  if (status == TV_ERR_KERNELS)
    check(status,
          std::string("--kernels ") + tv_kernels_string(static_cast<tv_kernels>(limits.kernels)));
  if (status == TV_ERR_MEMORY)
    throw BadInput("not enough memory: a context for " + std::to_string(limits.max_width) + "x" +
                   std::to_string(limits.max_height) + " needs " +
                   std::to_string(context_bytes_ >> 20) + " MiB");
  check(status, "cannot make a context");
  context_.reset(context);
  width_ = limits.max_width;
  height_ = limits.max_height;
  check(tv_context_set_clock(context, clock_ns, nullptr), "cannot set the clock");
  return context;
}

std::string Session::kernels() const {
  return tv_kernels_string(tv_context_kernels(context_.get()));
}

nlohmann::ordered_json Session::take_times(uint64_t total_ns, bool all) {
  std::array<uint64_t, TV_NUM_STAGES> stages{};
  check(tv_context_take_times(context_.get(), stages.data(), TV_NUM_STAGES),
        "cannot read the times");
  nlohmann::ordered_json json;
  for (size_t i = 0; i < stages.size(); ++i)
    if (all || stages[i] != 0) json[kStages[i]] = static_cast<double>(stages[i]) * 1e-6;
  json["total"] = static_cast<double>(total_ns) * 1e-6;
  return json;
}

Features extract(tv_context* context, const Picture& picture, const Options& options) {
  Features features;
  const auto capacity = static_cast<size_t>(options.feature.max_keypoints);
  features.keypoints.resize(capacity);
  features.descriptors.resize(capacity * TV_DESCRIPTOR_BYTES);
  const tv_image image = picture.view(), mask = picture.mask_view();
  int32_t count = 0;
  check(tv_extract(context, &image, mask.data ? &mask : nullptr, &options.feature,
                   features.keypoints.data(), features.descriptors.data(),
                   static_cast<int32_t>(capacity), &count),
        picture.path);
  features.keypoints.resize(static_cast<size_t>(count));
  features.descriptors.resize(static_cast<size_t>(count) * TV_DESCRIPTOR_BYTES);
  return features;
}

namespace {

tv_features view_of(const Features& found) {
  tv_features features;
  tv_features_init(&features);
  features.num = static_cast<int32_t>(found.keypoints.size());
  features.keypoints = found.keypoints.data();
  features.descriptors = found.descriptors.data();
  return features;
}

}  // namespace

std::vector<tv_correspondence> match_features(tv_context* context, const Features& f0,
                                              const Features& f1, const tv_match_options& options) {
  std::vector<tv_correspondence> matches(std::min(f0.keypoints.size(), f1.keypoints.size()) + 1);
  int32_t count = 0;
  const tv_features features0 = view_of(f0), features1 = view_of(f1);
  check(tv_match(context, &features0, &features1, &options, matches.data(),
                 static_cast<int32_t>(matches.size()), &count),
        "cannot match");
  matches.resize(static_cast<size_t>(count));
  return matches;
}

}  // namespace cli
