// FAST corners with non-maximum suppression, at the thresholds that give about 1000 and 4000
// corners: ours, OpenCV's FAST-9 and libcvd's FAST-12. No system limits the number of corners or
// computes sub-pixel positions; only ours sorts the corners by score.
#include <opencv2/features2d.hpp>

#ifdef BENCH_HAS_CVD
#include <cvd/fast_corner.h>
#endif

#include <vector>

#include "bench.h"
#include "images.h"

namespace {

using bench::Counters;

constexpr int kMaxCorners = 20000;

tv_feature_options options_of(int arc, int threshold) {
  tv_feature_options options;
  tv_feature_options_init(&options);
  options.max_keypoints = kMaxCorners;
  options.arc = arc;
  options.threshold = threshold;
  options.min_threshold = 0;
  options.levels = 1;
  options.cell_px = 0;
  options.subpixel = 0;
  return options;
}

// A context and the memory for its corners, which the rows that use them keep alive.
struct Detector {
  bench::Context context;
  tv_image image;
  std::vector<tv_keypoint> keypoints = std::vector<tv_keypoint>(kMaxCorners);
  int32_t count = 0;

  explicit Detector(const cv::Mat& pixels)
      : context(bench::make_context(pixels.cols, pixels.rows, kMaxCorners)),
        image(bench::view_of(pixels)) {}
  void detect(const tv_feature_options& options) {
    bench::require(
        tv_detect(context.get(), &image, nullptr, &options, keypoints.data(), kMaxCorners, &count),
        "tv_detect");
  }
};

// The highest threshold that gives at least `corners` corners; a higher threshold gives fewer.
int threshold_for(Detector* detector, int arc, int corners) {
  int enough = 1, too_few = 128;
  while (too_few - enough > 1) {
    const int middle = (enough + too_few) / 2;
    detector->detect(options_of(arc, middle));
    (detector->count >= corners ? enough : too_few) = middle;
  }
  return enough;
}

void add_opencv(const std::string& name, const cv::Mat& image, int threshold) {
  const auto found = std::make_shared<std::vector<cv::KeyPoint>>();
  bench::add({name + "/OpenCV " CV_VERSION, [=] { cv::FAST(image, *found, threshold, true); },
              [=] {
                return Counters{{"corners", static_cast<double>(found->size())}};
              }});
}

void add_libcvd(const std::string& name, const cv::Mat& image, int threshold) {
#ifdef BENCH_HAS_CVD
  const auto found = std::make_shared<std::vector<CVD::ImageRef>>();
  const auto detect = [=] {
    const CVD::BasicImage<CVD::byte> view(image.data, CVD::ImageRef(image.cols, image.rows));
    std::vector<CVD::ImageRef> corners;
    CVD::fast_corner_detect_12(view, corners, threshold);
    found->clear();
    CVD::fast_nonmax(view, corners, threshold, *found);
  };
  bench::add({name + "/" BENCH_CVD_NAME, detect, [=] {
                return Counters{{"corners", static_cast<double>(found->size())}};
              }});
#else
  bench::add_missing(name + "/libcvd");
#endif
}

void add_case(const bench::Pair& pair, int arc, int corners) {
  const cv::Mat image = pair.image[0];
  const auto detector = std::make_shared<Detector>(image);
  const int threshold = threshold_for(detector.get(), arc, corners);
  const std::string name =
      "fast/FAST-" + std::to_string(arc) + " " + pair.name + " about " + std::to_string(corners);
  bench::add({bench::ours(name), [=] { detector->detect(options_of(arc, threshold)); },
              [=] {
                return Counters{{"corners", static_cast<double>(detector->count)},
                                {"threshold", static_cast<double>(threshold)}};
              }});
  if (arc == 9) add_opencv(name, image, threshold);
  if (arc == 12) add_libcvd(name, image, threshold);
}

}  // namespace

int main(int argc, char** argv) {
  for (bench::Size size : {bench::Size::kVga, bench::Size::kHd}) {
    for (int arc : {9, 12}) {
      for (int corners : {1000, 4000}) add_case(bench::pair_of(size), arc, corners);
    }
  }
  return bench::run(argc, argv);
}
