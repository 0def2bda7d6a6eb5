// SIFT descriptors at our corners, and detection with description, compared with OpenCV's SIFT.
//
// At given points both libraries describe the same keypoints and angles, with the same window: a
// spatial bin is 1.5 keypoint sizes wide in both. Rows with many and with few keypoints differ only
// in the time of the descriptors; from them scripts/bench computes the time without the pyramid.
// The agreement is the median cosine of the two descriptors: ours is smoothed slightly less than
// OpenCV's.
#include <algorithm>
#include <cmath>
#include <opencv2/features2d.hpp>

#include "bench.h"
#include "images.h"
#include "opencv_peer.h"

namespace {

using bench::Counters;

constexpr int kMaxKeypoints = 2048;

tv_feature_options options_of(float size) {
  tv_feature_options options;
  tv_feature_options_init(&options);
  options.keypoint_size = size;
  options.descriptor = TV_NORMALISATION_SIFT;
  return options;
}

// `count` keypoints with their angles: every n-th of the best corners whose distance from the
// border is more than 6 keypoint sizes, so that OpenCV's window lies inside the image.
std::vector<tv_keypoint> keypoints_of(const cv::Mat& pixels, float size, int count) {
  const bench::Context context = bench::make_context(pixels.cols, pixels.rows, kMaxKeypoints);
  const tv_feature_options options = options_of(size);
  const tv_image image = bench::view_of(pixels);
  std::vector<tv_keypoint> all(kMaxKeypoints), inside, chosen;
  std::vector<uint8_t> descriptors(kMaxKeypoints * TV_DESCRIPTOR_BYTES);
  int32_t found = 0;
  bench::require(tv_extract(context.get(), &image, nullptr, &options, all.data(),
                            descriptors.data(), kMaxKeypoints, &found),
                 "tv_extract");
  const float rim = 6 * size;
  for (int k = 0; k < found; ++k) {
    const tv_keypoint& p = all[static_cast<size_t>(k)];
    if (p.x > rim && p.y > rim && p.x < static_cast<float>(pixels.cols) - rim &&
        p.y < static_cast<float>(pixels.rows) - rim) {
      inside.push_back(p);
    }
  }
  const size_t wanted = std::min(inside.size(), static_cast<size_t>(count));
  for (size_t k = 0; k < wanted; ++k) chosen.push_back(inside[k * inside.size() / wanted]);
  return chosen;
}

struct Descriptors {
  std::vector<tv_keypoint> keypoints;
  std::vector<uint8_t> ours;
  cv::Mat opencvs;
};

double median_cosine(const Descriptors& d) {
  std::vector<double> cosines;
  for (int k = 0; k < d.opencvs.rows; ++k) {
    const uint8_t* a = d.ours.data() + k * TV_DESCRIPTOR_BYTES;
    const float* b = d.opencvs.ptr<float>(k);
    double ab = 0, aa = 0, bb = 0;
    for (int i = 0; i < TV_DESCRIPTOR_BYTES; ++i) {
      ab += a[i] * b[i], aa += a[i] * a[i], bb += b[i] * b[i];
    }
    cosines.push_back(ab / std::sqrt(aa * bb));
  }
  std::sort(cosines.begin(), cosines.end());
  return cosines.empty() ? 0 : cosines[cosines.size() / 2];
}

void add_describe(const bench::Pair& pair, float size, int count) {
  const cv::Mat pixels = pair.image[0];
  const auto d = std::make_shared<Descriptors>();
  d->keypoints = keypoints_of(pixels, size, count);
  const int num = static_cast<int>(d->keypoints.size());
  d->ours.resize(static_cast<size_t>(num) * TV_DESCRIPTOR_BYTES);
  const std::string name = "describe/" + pair.name + " size " +
                           std::to_string(static_cast<int>(size)) + " at " + std::to_string(count);
  const std::shared_ptr<tv_context> context =
      bench::make_context(pixels.cols, pixels.rows, kMaxKeypoints);
  const tv_feature_options options = options_of(size);
  bench::add({bench::ours(name),
              [=] {
                const tv_image image = bench::view_of(pixels);
                bench::require(tv_describe(context.get(), &image, d->keypoints.data(), num,
                                           &options, d->ours.data()),
                               "tv_describe");
              },
              [=] {
                return Counters{{"keypoints", 1.0 * num}};
              },
              1.0 * num});
  std::vector<cv::KeyPoint> points = bench::opencv_keypoints(d->keypoints.data(), num);
  const cv::Ptr<cv::SIFT> sift = cv::SIFT::create();
  bench::add(
      {name + "/OpenCV " CV_VERSION, [=]() mutable { sift->compute(pixels, points, d->opencvs); },
       [=] {
         return Counters{{"keypoints", 1.0 * d->opencvs.rows}, {"cosine", median_cosine(*d)}};
       },
       1.0 * num});
}

// Detection and description: OpenCV's SIFT, and our tv_extract with OpenCV's number of keypoints
// and with our default options.
void add_extract(const bench::Pair& pair) {
  const cv::Mat pixels = pair.image[0];
  const auto opencvs = std::make_shared<bench::OpencvFeatures>();
  *opencvs = bench::opencv_sift(pixels, kMaxKeypoints);
  const int opencvs_count = static_cast<int>(opencvs->keypoints.size());
  for (int count : {opencvs_count, kMaxKeypoints}) {
    if (count != opencvs_count) *opencvs = {};
    const std::string name =
        "extract/" + pair.name + (count == kMaxKeypoints ? " defaults" : " at SIFT's count");
    const std::shared_ptr<tv_context> context =
        bench::make_context(pixels.cols, pixels.rows, count);
    const auto keypoints = std::make_shared<std::vector<tv_keypoint>>(count);
    const auto bytes = std::make_shared<std::vector<uint8_t>>(count * TV_DESCRIPTOR_BYTES);
    const auto found = std::make_shared<int32_t>(0);
    bench::add({bench::ours(name),
                [=] {
                  tv_feature_options options;
                  tv_feature_options_init(&options);
                  options.max_keypoints = count;
                  const tv_image image = bench::view_of(pixels);
                  bench::require(tv_extract(context.get(), &image, nullptr, &options,
                                            keypoints->data(), bytes->data(), count, found.get()),
                                 "tv_extract");
                },
                [=] {
                  return Counters{{"keypoints", 1.0 * *found}};
                }});
    bench::add({name + "/OpenCV " CV_VERSION " SIFT",
                [=] { *opencvs = bench::opencv_sift(pixels, kMaxKeypoints); },
                [=] {
                  return Counters{{"keypoints", 1.0 * opencvs->descriptors.rows}};
                }});
    if (opencvs_count == kMaxKeypoints) break;
  }
}

}  // namespace

int main(int argc, char** argv) {
  for (bench::Size size : {bench::Size::kVga, bench::Size::kHd}) {
    for (float keypoint_size : {5.0f, 7.0f}) {
      for (int count : {200, 1000}) add_describe(bench::pair_of(size), keypoint_size, count);
    }
    add_extract(bench::pair_of(size));
  }
  return bench::run(argc, argv);
}
