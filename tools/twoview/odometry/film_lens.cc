#include "odometry/film_lens.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "files/camera_file.h"
#include "odometry/lens_adjustment.h"
#include "pair/measures.h"
#include "pair/session.h"

namespace cli {
namespace {

// Pairs of frames over the whole film, however long it is: whenever kConsidered frames were looked
// at, only every other one is from then on, and every other pair is forgotten.
class FilmPairs {
 public:
  explicit FilmPairs(const FlightOptions& options) : flight_(options) {
    options_.feature.max_keypoints = kKeypoints;
    options_.kernels = options.odometry.kernels;
  }

  bool wants(int index) const {
    if (index % flight_.every != 0) return false;
    const int number = index / flight_.every;
    return number % stride_ == 0 && (flight_.max_frames == 0 || number < flight_.max_frames);
  }

  void add(const SourceFrame& frame) {
    if (frame.luma.empty()) return;
    Picture picture;
    picture.luma = picture.colour = frame.luma;
    picture.path = frame.name;
    if (width_ == 0) {
      width_ = frame.luma.cols;
      height_ = frame.luma.rows;
    }
    if (frame.luma.cols != width_ || frame.luma.rows != height_) return;
    shrink(picture, flight_.resize);
    work_width_ = picture.luma.cols;
    work_height_ = picture.luma.rows;
    Features features = extract(session_.context(work_width_, work_height_), picture, options_);
    follow(std::move(features));
    if (++considered_ % kConsidered != 0) return;
    stride_ *= 2;
    std::vector<Pair> half;
    for (size_t k = 0; k < pairs_.size(); k += 2) half.push_back(std::move(pairs_[k]));
    pairs_.swap(half);
  }

  int width() const { return width_; }
  int height() const { return height_; }

  // The median of the pairs' focal lengths and the prior, each weighed by its information; in
  // pixels of the frames as the source gives them.
  double focal_px() {
    if (best_.flow > kLeastFlow) pairs_.push_back(std::move(best_));
    struct Vote {
      double log_focal, weight;
    };
    std::vector<Vote> votes;
    votes.push_back({std::log(kPriorFocal35mm), 1 / (kPriorLogFocal * kPriorLogFocal)});
    const tv_camera camera = film_camera(kPriorFocal35mm, work_width_, work_height_);
    for (const Pair& pair : pairs_) {
      tv_two_view found;
      estimate(camera, pair, &found);
      // A focal length that the estimate left as it was given, or of which two values fit, is no
      // evidence.
      const bool is_refined = found.has_covariance && found.focal_scale > 0 &&
                              found.focal_sigma > 0 && found.focal_sigma < kLeastKnown;
      if (!is_refined) continue;
      votes.push_back({std::log(kPriorFocal35mm * found.focal_scale),
                       1 / (found.focal_sigma * found.focal_sigma)});
    }
    std::sort(votes.begin(), votes.end(),
              [](const Vote& a, const Vote& b) { return a.log_focal < b.log_focal; });
    double all = 0, sum = 0;
    for (const Vote& vote : votes) all += vote.weight;
    for (const Vote& vote : votes) {
      sum += vote.weight;
      if (2 * sum >= all) return focal_px_of(std::exp(vote.log_focal), width_, height_);
    }
    return focal_px_of(kPriorFocal35mm, width_, height_);
  }

 private:
  static constexpr int kKeypoints = 800, kConsidered = 96;
  static constexpr size_t kFewMatches = 100, kLeastMatches = 50;
  // The median shift of a pair's matches, in diagonals of the picture: of a good pair, and of one
  // that is still of use.
  static constexpr double kFlow = 0.1, kLeastFlow = 0.03;
  static constexpr double kLeastKnown = 0.35;

  struct Pair {
    std::vector<double> pixels[2];
    std::vector<float> ratios;
    double flow = 0;
  };

  // Matches the frame with the first one of the pair to be, which ends where the camera has moved
  // far enough, or where the matches become few.
  void follow(Features features) {
    if (anchor_.keypoints.empty()) {
      anchor_ = std::move(features);
      return;
    }
    Pair pair = matched(anchor_, features);
    const size_t count = pair.ratios.size();
    if (count >= kFewMatches && pair.flow < kFlow) {
      best_ = std::move(pair);
      return;
    }
    if (count >= kLeastMatches && pair.flow > kLeastFlow)
      pairs_.push_back(std::move(pair));
    else if (best_.flow > kLeastFlow)
      pairs_.push_back(std::move(best_));
    best_ = {};
    anchor_ = std::move(features);
  }

  Pair matched(const Features& a, const Features& b) {
    tv_features views[2];
    const Features* const both[2] = {&a, &b};
    for (size_t v = 0; v < 2; ++v) {
      tv_features_init(&views[v]);
      views[v].keypoints = both[v]->keypoints.data();
      views[v].descriptors = both[v]->descriptors.data();
      views[v].num = static_cast<int32_t>(both[v]->keypoints.size());
    }
    std::vector<tv_correspondence> matches(kKeypoints);
    int32_t count = 0;
    check(tv_match(session_.get(), &views[0], &views[1], &options_.match, matches.data(),
                   kKeypoints, &count),
          "cannot match frames");
    Pair pair;
    std::vector<double> shifts;
    for (int32_t m = 0; m < count; ++m) {
      const tv_keypoint& p = a.keypoints[static_cast<size_t>(matches[static_cast<size_t>(m)].idx0)];
      const tv_keypoint& q = b.keypoints[static_cast<size_t>(matches[static_cast<size_t>(m)].idx1)];
      for (const double value : {static_cast<double>(p.x), static_cast<double>(p.y)})
        pair.pixels[0].push_back(value);
      for (const double value : {static_cast<double>(q.x), static_cast<double>(q.y)})
        pair.pixels[1].push_back(value);
      pair.ratios.push_back(matches[static_cast<size_t>(m)].ratio);
      shifts.push_back(std::hypot(static_cast<double>(p.x) - q.x, static_cast<double>(p.y) - q.y));
    }
    if (!shifts.empty())
      pair.flow = percentile(shifts, 0.5) / std::hypot(work_width_, work_height_);
    return pair;
  }

  void estimate(const tv_camera& camera, const Pair& pair, tv_two_view* found) {
    tv_pixel_pairs pixels;
    tv_pixel_pairs_init(&pixels);
    pixels.num = static_cast<int32_t>(pair.ratios.size());
    pixels.pixels0 = pair.pixels[0].data();
    pixels.pixels1 = pair.pixels[1].data();
    pixels.ratios = pair.ratios.data();
    tv_estimate_options options;
    tv_estimate_options_init(&options);
    options.calibration0 = {kPriorLogFocal, 0, TV_REFINE_FOCAL_LENGTH, 0};
    options.calibration1 = options.calibration0;
    options.max_iterations = 1000;
    tv_two_view_init(found);
    check(tv_estimate_two_view(session_.get(), &camera, &camera, &pixels, &options, found, nullptr,
                               nullptr),
          "cannot estimate the focal length");
  }

  FlightOptions flight_;
  Options options_;
  Session session_{options_};
  int stride_ = 3, considered_ = 0;
  int width_ = 0, height_ = 0, work_width_ = 0, work_height_ = 0;
  Features anchor_;
  Pair best_;
  std::vector<Pair> pairs_;
};

}  // namespace

nlohmann::ordered_json FilmLens::json() const {
  using Json = nlohmann::ordered_json;
  return {{"focal_35mm", focal_35mm()},
          {"pixels", lens.focal_px},
          {"sigma_percent", 100 * sigma},
          {"uncertain", is_uncertain},
          {"k1", lens.k1 != 0 ? Json(lens.k1) : Json(nullptr)},
          {"k2", lens.k2 != 0 ? Json(lens.k2) : Json(nullptr)},
          {"k3", lens.k3 != 0 ? Json(lens.k3) : Json(nullptr)},
          {"source", "estimated"}};
}

std::string FilmLens::words() const {
  char text[160], of_lens[64] = "";
  if (lens.k1 != 0)
    std::snprintf(of_lens, sizeof of_lens, ", k1 %.3f, k2 %.3f, k3 %.3f", lens.k1, lens.k2,
                  lens.k3);
  std::snprintf(text, sizeof text, "focal length %.3g mm (35 mm equivalent) +- %.1f %%%s",
                focal_35mm(), 100 * sigma, of_lens);
  return text;
}

FilmLens estimate_film_lens(FrameSource& source, const FlightOptions& options,
                            const std::atomic<bool>& stop,
                            const std::function<void(const std::string&)>& progress) {
  // A map that was made with a wrong lens is bent to fit that lens: an adjustment of the lens with
  // the finished map misses about this share of the change.
  constexpr double kRemembered = 0.2;
  // A change below this one needs no other map.
  constexpr double kSettled = 0.02;
  constexpr int kRounds = 2;
  constexpr int kMostFrames = 1000;  // of a map that serves the lens alone

  FilmLens result;
  FilmPairs pairs(options);
  const std::string what = "focal length: ";
  progress(what + "pairs of frames");
  source.run([&](int index) { return pairs.wants(index); },
             [&](const SourceFrame& frame) {
               pairs.add(frame);
               return true;
             },
             stop);
  result.width = pairs.width();
  result.height = pairs.height();
  if (result.width == 0) throw BadInput("no frame of " + source.kind() + " can be read");
  result.lens.focal_px = pairs.focal_px();
  result.sigma = kPriorLogFocal;
  for (int round = 0; round < kRounds && !stop; ++round) {
    FlightOptions scouting = options;
    scouting.camera = result.camera();
    scouting.odometry.refine = TV_REFINE_NOTHING;
    scouting.max_frames =
        options.max_frames == 0 ? kMostFrames : std::min(options.max_frames, kMostFrames);
    scouting.keeps_pictures = false;
    Flight flight(source, scouting);
    flight.track(stop, [&](const SourceFrame&) {
      progress(what + "map " + std::to_string(round + 1) + ", " +
               std::to_string(flight.frames().size()) + " frames");
    });
    if (stop || flight.frames().empty()) break;
    check(tv_odometry_finish(flight.odometry()), "the map");
    const tv_camera& camera = flight.camera();
    const double scale = static_cast<double>(camera.width) / result.width;
    const std::vector<FlightKeyframe> keyframes = flight.keyframes();
    const SimpleLens start = result.lens.scaled(scale);
    const LensEstimate estimate = adjust_lens(in_motion(keyframes, flight), flight.points(),
                                              camera.width, camera.height, start);
    if (!estimate.is_known) break;
    const double change = std::log(estimate.lens.focal_px / start.focal_px);
    result.lens = estimate.lens.scaled(1 / scale);
    result.sigma = std::min(std::hypot(std::sqrt(estimate.focal_variance), kRemembered * change),
                            kPriorLogFocal);
    if (std::fabs(change) < kSettled) break;
  }
  result.is_uncertain = !(result.sigma <= kMostFocalSigma);
  return result;
}

}  // namespace cli
