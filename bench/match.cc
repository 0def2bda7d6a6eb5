// Matching of descriptors of real images: mutual nearest neighbours that pass the ratio test, ours
// and by OpenCV's BFMatcher. OpenCV has two rows: knnMatch in both directions, which gives the same
// matches, and one knnMatch, which is half of the work.
#include <opencv2/features2d.hpp>
#include <set>

#include "bench.h"
#include "images.h"
#include "opencv_peer.h"

namespace {

using bench::Counters;

constexpr float kRatio = 0.8f;

struct Side {
  std::vector<uint8_t> bytes;
  cv::Mat floats;  // the descriptors in `bytes` as float, for OpenCV
  int count = 0;
};

Side describe(const cv::Mat& pixels, int count) {
  const bench::Context context = bench::make_context(pixels.cols, pixels.rows, count);
  tv_feature_options options;
  tv_feature_options_init(&options);
  options.max_keypoints = count;
  const tv_image image = bench::view_of(pixels);
  std::vector<tv_keypoint> keypoints(static_cast<size_t>(count));
  Side side;
  side.bytes.resize(static_cast<size_t>(count) * TV_DESCRIPTOR_BYTES);
  bench::require(tv_extract(context.get(), &image, nullptr, &options, keypoints.data(),
                            side.bytes.data(), count, &side.count),
                 "tv_extract");
  cv::Mat(side.count, TV_DESCRIPTOR_BYTES, CV_8U, side.bytes.data()).convertTo(side.floats, CV_32F);
  return side;
}

struct Matcher {
  Side side[2];
  bench::Context context;
  std::vector<tv_correspondence> ours;
  int32_t num_ours = 0;
  bench::IndexPairs opencvs;
  std::vector<std::vector<cv::DMatch>> one_way;
};

double num_common(const Matcher& m) {
  const std::set<std::pair<int, int>> theirs(m.opencvs.begin(), m.opencvs.end());
  int common = 0;
  for (int k = 0; k < m.num_ours; ++k) {
    const tv_correspondence& c = m.ours[static_cast<size_t>(k)];
    common += static_cast<int>(theirs.count({c.idx0, c.idx1}));
  }
  return common;
}

void add_case(const bench::Pair& pair, int count) {
  const auto m = std::make_shared<Matcher>();
  for (int v = 0; v < 2; ++v) m->side[v] = describe(pair.image[v], count);
  m->context = bench::make_context(64, 64, count);
  m->ours.resize(static_cast<size_t>(count));
  const std::string name =
      "match/" + std::to_string(m->side[0].count) + "x" + std::to_string(m->side[1].count);
  const auto match = [=] {
    tv_match_options options;
    tv_match_options_init(&options);
    options.ratio = kRatio;
    tv_features features[2];
    for (int v = 0; v < 2; ++v) {
      tv_features_init(&features[v]);
      features[v].num = m->side[v].count;
      features[v].descriptors = m->side[v].bytes.data();
    }
    bench::require(tv_match(m->context.get(), &features[0], &features[1], &options, m->ours.data(),
                            count, &m->num_ours),
                   "tv_match");
  };
  bench::add({bench::ours(name), match, [=] { return Counters{{"matches", 1.0 * m->num_ours}}; }});
  bench::add(
      {name + "/OpenCV " CV_VERSION " both ways",
       [=] { m->opencvs = bench::opencv_match(m->side[0].floats, m->side[1].floats, kRatio); },
       [=] {
         match();
         return Counters{{"matches", 1.0 * m->opencvs.size()}, {"common", num_common(*m)}};
       }});
  bench::add(
      {name + "/OpenCV " CV_VERSION " one way, 2-NN only",
       [=] {
         m->one_way.clear();
         cv::BFMatcher(cv::NORM_L2).knnMatch(m->side[0].floats, m->side[1].floats, m->one_way, 2);
       },
       [=] {
         return Counters{{"nearest", 1.0 * m->one_way.size()}};
       }});
}

}  // namespace

int main(int argc, char** argv) {
  for (int count : {1000, 4000}) add_case(bench::pair_of(bench::Size::kHd), count);
  return bench::run(argc, argv);
}
