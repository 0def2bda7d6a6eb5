// A whole pair, from images in memory to pose and points: tv_reconstruct, and OpenCV's stages as a
// user of OpenCV would call them. To profile the library, run this program with
// --benchmark_filter=defaults/twoview. There are three cases:
//
//   same corners           FAST-9 at threshold 20, upright descriptors with the same window
//   SIFT's number and      OpenCV's SIFT; ours with the same number of keypoints and SIFT's
//   median window          median keypoint size
//   defaults               our default options; OpenCV's FAST at 20 with keypoint size 7, and SIFT
//
// OpenCV: BFMatcher both ways with ratio 0.8, USAC_MAGSAC at 1 px, recoverPose, triangulatePoints.
#include <ctime>

#include "bench.h"
#include "images.h"
#include "opencv_peer.h"
#include "problem.h"

namespace {

using bench::Counters;
using bench::Pair;

constexpr int kMaxKeypoints = 2048;
// The largest ratio of distances of a match: OpenCV's, and ours except in the case "defaults".
constexpr float kRatio = 0.8f;

struct Options {
  tv_feature_options feature;
  tv_match_options match;
  Options() {
    tv_feature_options_init(&feature);
    tv_match_options_init(&match);
  }
};

// The clock of all times in this file: the CPU time of the process in nanoseconds.
uint64_t now_ns(void*) {
  timespec time;
  clock_gettime(CLOCK_PROCESS_CPUTIME_ID, &time);
  return 1000000000u * static_cast<uint64_t>(time.tv_sec) + static_cast<uint64_t>(time.tv_nsec);
}

class Ours {
 public:
  Ours(const Pair& pair, const Options& options)
      : pair_(pair),
        options_(options),
        context_(bench::make_context(pair.image[0].cols, pair.image[0].rows, kMaxKeypoints)) {}

  void run() {
    tv_view views[2];
    for (int v = 0; v < 2; ++v) {
      tv_view_init(&views[v]);
      views[v].image = bench::view_of(pair_.image[v]);
      views[v].camera = &pair_.camera[v];
    }
    tv_reconstruct_options options;
    tv_reconstruct_options_init(&options);
    options.feature = &options_.feature;
    options.match = &options_.match;
    tv_two_view_init(&pose_);
    tv_reconstruction_init(&found_);
    bench::require(
        tv_reconstruct(context_.get(), &views[0], &views[1], &options, &pose_, nullptr, &found_),
        "tv_reconstruct");
  }

  // Reports counts and errors of the result, and runs once more to measure the time of each stage.
  Counters counters() {
    static const char* const stages[TV_NUM_STAGES] = {"pyramid_us",    "detect_us",   "describe_us",
                                                      "match_us",      "estimate_us", "refine_us",
                                                      "triangulate_us"};
    uint64_t stage_ns[TV_NUM_STAGES];
    bench::require(tv_context_set_clock(context_.get(), now_ns, nullptr), "tv_context_set_clock");
    run();
    bench::require(tv_context_take_times(context_.get(), stage_ns, TV_NUM_STAGES),
                   "tv_context_take_times");
    bench::require(tv_context_set_clock(context_.get(), nullptr, nullptr), "tv_context_set_clock");
    Counters counters = {{"keypoints", found_.num_keypoints[0]},
                         {"matches", found_.num_matches},
                         {"inliers", pose_.num_inliers},
                         {"points", found_.num_points}};
    for (int k = 0; k < TV_NUM_STAGES; ++k) counters[stages[k]] = 1e-3 * stage_ns[k];
    if (pose_.has_R && pose_.has_t) {
      counters["error_deg"] = bench::pose_error_deg(pose_.R, pose_.t, pair_.R, pair_.t);
    }
    return counters;
  }

 private:
  const Pair& pair_;
  Options options_;
  bench::Context context_;
  tv_two_view pose_;
  tv_reconstruction found_;
};

void add_ours(const std::string& name, const Pair& pair, const Options& options) {
  const auto ours = std::make_shared<Ours>(pair, options);
  bench::add({bench::ours(name), [=] { ours->run(); }, [=] { return ours->counters(); }});
}

// Adds a row that reconstructs the pair with OpenCV. extract(image) returns an image's features.
template <typename Extract>
void add_opencv(const std::string& name, const Pair& pair, Extract extract) {
  const auto found = std::make_shared<bench::OpencvPair>();
  const auto run = [=, &pair] {
    const bench::OpencvFeatures features[2] = {extract(pair.image[0]), extract(pair.image[1])};
    *found = bench::opencv_reconstruct(features, pair.camera, kRatio);
  };
  const auto counters = [=, &pair] {
    Counters c = {{"keypoints", 1.0 * found->num_keypoints[0]},
                  {"matches", 1.0 * found->num_matches},
                  {"inliers", 1.0 * found->num_inliers},
                  {"points", 1.0 * found->points.cols}};
    if (!found->pose.R.empty()) {
      c["error_deg"] = bench::pose_error_deg(found->pose.R.ptr<double>(),
                                             found->pose.t.ptr<double>(), pair.R, pair.t);
    }
    return c;
  };
  bench::add({name + "/OpenCV " CV_VERSION " " + extract.name, run, counters});
}

struct FastSift {
  int threshold, max_keypoints;
  float size;
  const char* name = "FAST + SIFT";
  bench::OpencvFeatures operator()(const cv::Mat& image) const {
    return bench::opencv_fast_sift(image, threshold, max_keypoints, size);
  }
};

struct Sift {
  int max_keypoints;
  const char* name = "SIFT";
  bench::OpencvFeatures operator()(const cv::Mat& image) const {
    return bench::opencv_sift(image, max_keypoints);
  }
};

void add_same_work_as_fast(const Pair& pair, float size) {
  const int threshold = 20;
  Options options;
  options.feature.arc = 9;
  options.feature.threshold = threshold;
  options.feature.min_threshold = 0;
  options.feature.levels = 1;
  options.feature.cell_px = 0;
  options.feature.orientation = TV_ORIENTATION_UPRIGHT;
  options.feature.descriptor = TV_NORMALISATION_SIFT;
  options.feature.keypoint_size = size;
  options.match.ratio = kRatio;
  options.match.neighbourhood_px = 0;
  const std::string name =
      "pair/" + pair.name + " same corners, size " + std::to_string(static_cast<int>(size));
  add_ours(name, pair, options);
  add_opencv(name, pair, FastSift{threshold, kMaxKeypoints, size});
}

void add_same_work_as_sift(const Pair& pair) {
  const std::vector<cv::KeyPoint> keypoints =
      bench::opencv_sift(pair.image[0], kMaxKeypoints).keypoints;
  std::vector<double> sizes;
  for (const cv::KeyPoint& keypoint : keypoints) sizes.push_back(keypoint.size);
  Options options;
  options.feature.max_keypoints = static_cast<int32_t>(keypoints.size());
  options.feature.descriptor = TV_NORMALISATION_SIFT;
  options.feature.keypoint_size = static_cast<float>(bench::median(sizes));
  options.match.ratio = kRatio;
  const std::string name = "pair/" + pair.name + " SIFT's number and median window";
  add_ours(name, pair, options);
  add_opencv(name, pair, Sift{kMaxKeypoints});
}

void add_defaults(const Pair& pair) {
  const std::string name = "pair/" + pair.name + " defaults";
  add_ours(name, pair, Options());
  add_opencv(name, pair, FastSift{20, kMaxKeypoints, 7});
  add_opencv(name, pair, Sift{kMaxKeypoints});
}

}  // namespace

int main(int argc, char** argv) {
  for (bench::Size size : {bench::Size::kVga, bench::Size::kHd}) {
    const Pair& pair = bench::pair_of(size);
    add_same_work_as_fast(pair, 7);
    add_same_work_as_fast(pair, 5);
    add_same_work_as_sift(pair);
    add_defaults(pair);
  }
  return bench::run(argc, argv);
}
