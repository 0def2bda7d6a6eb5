#include "odometry/lens_adjustment.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <map>
#include <opencv2/core.hpp>

#include "odometry/lens_window.h"

namespace cli {
namespace {

// A window spans a turn, and is short enough that its bending is nearly linear in a step: with 40
// keyframes the steps of a turning car had to be ten times as small.
constexpr size_t kWindow = 16, kLeastViews = 3;
constexpr size_t kLeastKeyframes = 8;  // three views and one turn fit any lens
constexpr int kMostRounds = 50;        // of Levenberg and Marquardt
// The covariance is that of the noise times this: what else bends a lens, and errors that the views
// of a point share, do not average out. Chosen, with less of the lens free, on seq_tsukuba,
// seq_corridor, seq_tum_fr1_rpy and three rendered flights (docs/algorithms/focal_length.md).
constexpr double kSharedErrors = 20;

// The picture that the keyframes' observations are of: as it is, or as a camera without distortion
// and with square pixels would have taken it.
class Picture {
 public:
  Picture(int width, int height) : width_(width), height_(height) {}
  explicit Picture(const tv_camera& camera)
      : width_(camera.width), height_(camera.height), camera_(&camera) {}

  int width() const { return width_; }
  int height() const { return height_; }
  double focal_px() const { return std::sqrt(camera_->fx * camera_->fy); }

  // False where the camera without distortion would not see it, or far from the middle.
  bool sees(const tv_map_observation& o, int view, LensWindow::Seen* seen) const {
    constexpr double kLeastForward = 0.5;  // 60 degrees
    const double at[2] = {static_cast<double>(o.x), static_cast<double>(o.y)};
    const double row = at[1] - (height_ - 1) / 2.0;
    const double sigma = std::max(static_cast<double>(o.sigma), 0.01);
    *seen = {view, {at[0] - (width_ - 1) / 2.0, row}, row / height_, 1 / sigma};
    if (camera_ == nullptr) return true;
    double ray[3], by_pixel[6];
    if (tv_camera_unproject(camera_, at, ray, by_pixel) != TV_OK || ray[2] < kLeastForward)
      return false;
    const double f = focal_px();
    seen->pixel = {f * ray[0] / ray[2], f * ray[1] / ray[2]};
    cv::Matx22d grown;
    for (int r = 0; r < 2; ++r)
      for (int c = 0; c < 2; ++c)
        grown(r, c) = (f * by_pixel[2 * r + c] - seen->pixel(r) * by_pixel[4 + c]) / ray[2];
    seen->precision /= std::sqrt(std::fabs(cv::determinant(grown)));
    return true;
  }

 private:
  int width_, height_;
  const tv_camera* camera_ = nullptr;
};

// How much of a map is adjusted: windows, and of each the points that most views see.
struct Extent {
  size_t windows = 15, points = std::numeric_limits<size_t>::max();
};

LensWindow window_of(const std::vector<const LensKeyframe*>& keyframes,
                     const std::vector<tv_map_point>& points, const Picture& picture,
                     size_t most_points) {
  LensWindow window;
  std::map<int32_t, LensWindow::Point> by_index;
  for (const LensKeyframe* given : keyframes) {
    const FlightKeyframe* const key = given->key;
    const auto view = static_cast<int>(window.views.size());
    const cv::Matx33d R = cv::Matx33d(key->keyframe.world_from_cam_R).t();
    window.views.push_back({R, -1 * (R * cv::Matx31d(key->keyframe.world_from_cam_t)),
                            cv::Matx31d(given->turn.data()), cv::Matx31d(given->move.data())});
    for (const tv_map_observation& o : key->observations) {
      LensWindow::Seen seen;
      if (!picture.sees(o, view, &seen)) continue;
      LensWindow::Point& point = by_index[o.idx_point];
      point.position = cv::Matx31d(points[static_cast<size_t>(o.idx_point)].position);
      point.seen.push_back(seen);
    }
  }
  for (auto& [index, point] : by_index)
    if (point.seen.size() >= 2) window.points.push_back(point);
  if (window.points.size() > most_points) {
    std::stable_sort(window.points.begin(), window.points.end(),
                     [](const LensWindow::Point& a, const LensWindow::Point& b) {
                       return a.seen.size() > b.seen.size();
                     });
    window.points.resize(most_points);
  }
  return window;
}

// Windows of nearly equal length, spread over the map.
std::vector<LensWindow> windows_of(const std::vector<LensKeyframe>& keyframes,
                                   const std::vector<tv_map_point>& points, const Picture& picture,
                                   const Extent& extent) {
  std::map<int32_t, std::vector<const LensKeyframe*>> segments;
  for (const LensKeyframe& key : keyframes) segments[key.key->keyframe.segment].push_back(&key);
  std::vector<std::vector<const LensKeyframe*>> parts;
  for (const auto& [segment, keys] : segments) {
    const size_t count = (keys.size() + kWindow - 1) / kWindow;
    for (size_t k = 0; k < count; ++k) {
      const auto first = keys.begin() + static_cast<std::ptrdiff_t>(k * keys.size() / count);
      const auto last = keys.begin() + static_cast<std::ptrdiff_t>((k + 1) * keys.size() / count);
      if (static_cast<size_t>(last - first) >= kLeastViews) parts.emplace_back(first, last);
    }
  }
  std::vector<LensWindow> windows;
  const size_t count = std::min(parts.size(), extent.windows);
  for (size_t k = 0; k < count; ++k)
    windows.push_back(window_of(parts[k * parts.size() / count], points, picture, extent.points));
  return windows;
}

size_t num_views(const std::vector<LensWindow>& windows) {
  size_t sum = 0;
  for (const LensWindow& window : windows) sum += window.views.size();
  return sum;
}

// The standard deviations of what is believed before the film is seen.
Lens prior_sigmas(int width, int height, double focal_px) {
  // The principal points of calibrated cameras are up to some per cent of the picture's diagonal
  // away from its middle. A rolling shutter takes up to the whole time between two frames.
  constexpr double kPriorCentre = 0.02, kPriorReadout = 0.5;
  const double centre = kPriorCentre * std::hypot(width, height) / focal_px;
  return {kPriorLogFocal, kPriorK, kPriorK, kPriorK,      kPriorP,
          kPriorP,        centre,  centre,  kPriorReadout};
}

// Levenberg-Marquardt over the windows and the lens that they share.
class Adjustment {
 public:
  Adjustment(std::vector<LensWindow> windows, const Lens& start, const Lens& prior,
             const Lens& prior_sigma)
      : windows_(std::move(windows)), lens_(start), prior_(prior), prior_sigma_(prior_sigma) {}

  const Lens& lens() const { return lens_; }
  double cost() const { return cost_; }
  double noise_sq() const { return noise_sq_; }
  size_t num_observations() const {
    size_t count = 0;
    for (const LensWindow& window : windows_)
      for (const LensWindow::Point& point : window.points) count += point.seen.size();
    return count;
  }

  void minimise(int most_steps) {
    constexpr double kSmallMove = 2e-4, kUndamped = 1e-4, kMostDamping = 1e3, kLeastDamping = 1e-8;
    const Lens longest(0.2, 0.1, 0.1, 0.1, 0.005, 0.005, 0.05, 0.05, 0.3);
    double damping = 1e-4, growth = 2;
    bool is_fresh = false;
    for (int step = 0; step < most_steps && !windows_.empty(); ++step) {
      linearise(damping);
      if (!is_fresh) measure_cost();  // under the prior of the noise as it is now
      is_fresh = true;
      LensMatrix damped = information_;
      for (int k = 0; k < kParameters; ++k) damped(k, k) *= 1 + damping;
      Lens move = -1 * (damped.inv() * score_);
      for (int k = 0; k < kParameters; ++k) move(k) = std::clamp(move(k), -longest(k), longest(k));
      const Lens next = lens_ + move;
      double next_cost = cost_of_prior(next);
      std::vector<std::vector<LensWindow::View>> views(windows_.size());
      std::vector<std::vector<LensWindow::Point>> points(windows_.size());
      for (size_t n = 0; n < windows_.size(); ++n) {
        windows_[n].step(move, next, &views[n], &points[n]);
        next_cost += LensWindow::cost_of(next, views[n], points[n]);
      }
      if (!(next_cost < cost_)) {
        damping *= growth;
        growth *= 2;
        if (damping > kMostDamping) return;
        continue;
      }
      const double gain = cost_ - next_cost;
      lens_ = next;
      is_fresh = false;
      cost_ = next_cost;
      for (size_t n = 0; n < windows_.size(); ++n) {
        windows_[n].views.swap(views[n]);
        windows_[n].points.swap(points[n]);
      }
      const bool is_settled = holds_focal_ ? gain < noise_sq_ : true;
      if (damping < kUndamped && cv::norm(move, cv::NORM_INF) < kSmallMove && is_settled) return;
      damping = std::max(damping / 3, kLeastDamping);
      growth = 2;
    }
  }

  // The covariance of the lens: that of the noise, and that of the differences between the windows.
  LensMatrix covariance() {
    constexpr double kToInvert = 1e-6;
    linearise(kToInvert);
    measure_cost();
    const LensMatrix inverse = information_.inv();
    LensMatrix spread = LensMatrix::zeros();
    for (const LensWindow& window : windows_) spread += window.score * window.score.t();
    return kSharedErrors * noise_sq_ * inverse + inverse * spread * inverse;
  }

  // The cost with the focal length held this far away and all else adjusted again.
  double cost_away(double log_step, int most_steps) const {
    Adjustment other = *this;
    other.lens_(kFocal) += log_step;
    other.holds_focal_ = true;
    other.minimise(most_steps);
    return other.cost_;
  }

 private:
  void measure_cost() {
    cost_ = cost_of_prior(lens_);
    for (const LensWindow& window : windows_) cost_ += window.cost(lens_);
  }
  double prior_weight(int k) const {
    return kSharedErrors * noise_sq_ / (prior_sigma_(k) * prior_sigma_(k));
  }
  double cost_of_prior(const Lens& at) const {
    double sum = 0;
    for (int k = 0; k < kParameters; ++k)
      sum += prior_weight(k) * (at(k) - prior_(k)) * (at(k) - prior_(k));
    return sum;
  }

  void linearise(double damping) {
    information_ = LensMatrix::zeros();
    score_ = Lens::zeros();
    double weight = 0, sum = 0;
    for (LensWindow& window : windows_) {
      window.reduce(lens_, damping);
      information_ += window.information;
      score_ += window.score;
      weight += window.weight;
      sum += window.weighted_sq;
    }
    constexpr double kLeastNoiseSq = 1e-4;
    if (weight > 0) noise_sq_ = std::max(sum / weight, kLeastNoiseSq);
    for (int k = 0; k < kParameters; ++k) {
      score_(k) += prior_weight(k) * (lens_(k) - prior_(k));
      information_(k, k) += prior_weight(k);
    }
    if (!holds_focal_) return;
    for (int k = 0; k < kParameters; ++k) information_(kFocal, k) = information_(k, kFocal) = 0;
    information_(kFocal, kFocal) = 1;
    score_(kFocal) = 0;
  }

  std::vector<LensWindow> windows_;
  Lens lens_, prior_, prior_sigma_;
  bool holds_focal_ = false;
  LensMatrix information_ = LensMatrix::eye();
  Lens score_ = Lens::zeros();
  double noise_sq_ = 1, cost_ = 0;
};

// The variance of the log of the focal length by what it costs to hold another one. Where a camera
// moves without turning, the slopes at the optimum are of noise and promise more than is known. So
// does their number: what bends all observations alike by a hundredth of their sigma does not
// average out, and such a camera shows no more of a focal length that is 10 per cent off.
double variance_by_cost(const Adjustment& best) {
  constexpr double kAway = 0.1, kAlike = 0.01;
  constexpr int kSteps = 20;
  const double least =
      std::min(best.cost_away(-kAway, kSteps), best.cost_away(kAway, kSteps)) - best.cost();
  const double of_chance = kSharedErrors * best.noise_sq();
  const double alike = kAlike * kAlike * static_cast<double>(best.num_observations());
  const double chi2 = std::max(least, 0.0) / (of_chance + alike);
  constexpr double kPriorVariance = kPriorLogFocal * kPriorLogFocal;
  return 1 / (chi2 / (kAway * kAway) + 1 / kPriorVariance);
}

// Whether a change of the camera, as a share, is more than chance, and more than calibrated cameras
// are off.
bool is_beyond(double sigmas, double change, double sigma) {
  constexpr double kOfCalibration = 0.01;
  return std::fabs(change) > sigmas * std::hypot(sigma, kOfCalibration);
}

bool is_focal_beyond(double sigmas, const CameraEvidence& e) {
  return is_beyond(sigmas, e.focal_change, e.focal_sigma);
}

bool is_lens_beyond(double sigmas, const CameraEvidence& e) {
  return is_beyond(sigmas, e.edge_change, e.edge_sigma);
}

// A shift of the principal point has about the effect of a turn of the camera, and is judged by the
// angle of that turn.
bool is_centre_beyond(double sigmas, const CameraEvidence& e) {
  const auto is_axis_beyond = [&](size_t k) {
    return is_beyond(sigmas, e.centre_shift_px[k] / e.focal_px, e.centre_sigma_px[k] / e.focal_px);
  };
  return is_axis_beyond(0) || is_axis_beyond(1);
}

CameraEvidence evidence_of(std::vector<LensWindow> windows, const Picture& picture,
                           bool is_thorough) {
  // At more than 50 degrees from the axis little is seen of any lens.
  constexpr double kFarOut = 0.8, kFarthest = 1.2;
  const double f = picture.focal_px();
  Lens as_given = Lens::zeros();
  as_given(kFocal) = std::log(f);
  Adjustment adjustment(std::move(windows), as_given, as_given,
                        prior_sigmas(picture.width(), picture.height(), f));
  adjustment.minimise(kMostRounds);
  const Lens change = adjustment.lens() - as_given;
  const LensMatrix covariance = adjustment.covariance();

  const double half_diagonal = std::hypot(picture.width(), picture.height()) / 2;
  const double d = std::min(kFarOut * half_diagonal / f, kFarthest), sq = d * d;
  Lens bend = Lens::zeros();
  bend(kK1) = sq;
  bend(kK2) = sq * sq;
  bend(kK3) = sq * sq * sq;
  const auto sigma_of = [&](int k) { return std::sqrt(covariance(k, k)); };
  CameraEvidence evidence{true,
                          std::expm1(change(kFocal)),
                          sigma_of(kFocal),
                          bend.dot(change),
                          std::sqrt(bend.dot(covariance * bend)),
                          {f * change(kCx), f * change(kCy)},
                          {f * sigma_of(kCx), f * sigma_of(kCy)},
                          f};
  if (is_thorough && evidence.contradicts_focal())
    evidence.focal_sigma = std::max(evidence.focal_sigma, std::sqrt(variance_by_cost(adjustment)));
  return evidence;
}

}  // namespace

bool CameraEvidence::contradicts_focal() const { return is_focal_beyond(3, *this); }

bool CameraEvidence::contradicts_lens() const { return is_lens_beyond(3, *this); }

bool CameraEvidence::contradicts_centre() const { return is_centre_beyond(3, *this); }

std::vector<LensKeyframe> in_motion(const std::vector<FlightKeyframe>& keyframes,
                                    const Flight& flight) {
  std::vector<LensKeyframe> moving;
  const std::vector<FlightFrame>& frames = flight.frames();
  for (const FlightKeyframe& key : keyframes) {
    moving.push_back({&key, {}, {}});
    const size_t at = flight.index_given(key.keyframe.frame);
    const int32_t segment = frames[at].live_segment;
    const auto follows = [&](size_t n) {
      return n < frames.size() && segment >= 0 && frames[n].live_segment == segment;
    };
    const size_t first = at > 0 && follows(at - 1) ? at - 1 : at;
    const size_t last = follows(at + 1) ? at + 1 : at;
    if (first == last) continue;
    const double share = 1.0 / static_cast<double>(last - first);
    const Pose last_from_first = composed(inverse(frames[last].live), frames[first].live);
    const std::array<double, 4> q = quaternion_of(last_from_first.R);
    const double sine = std::hypot(std::hypot(q[0], q[1]), q[2]);
    const double angle_over_sine = sine > 1e-12 ? 2 * std::atan2(sine, q[3]) / sine : 2;
    for (size_t k = 0; k < 3; ++k) {
      moving.back().turn[k] = share * angle_over_sine * q[k];
      moving.back().move[k] = share * last_from_first.t[k];
    }
  }
  return moving;
}

LensEstimate adjust_lens(const std::vector<LensKeyframe>& keyframes,
                         const std::vector<tv_map_point>& points, int width, int height,
                         const SimpleLens& start) {
  constexpr double kPriorVariance = kPriorLogFocal * kPriorLogFocal;
  LensEstimate estimate;
  estimate.lens = start;
  estimate.focal_variance = kPriorVariance;
  std::vector<LensWindow> windows = windows_of(keyframes, points, {width, height}, Extent{});
  if (num_views(windows) < kLeastKeyframes) return estimate;
  const double prior_px = focal_px_of(kPriorFocal35mm, width, height), f = start.focal_px;
  Adjustment adjustment(std::move(windows),
                        {std::log(f), start.k1, start.k2, start.k3, start.p1, start.p2,
                         start.cx / f, start.cy / f, 0},
                        {std::log(prior_px), 0, 0, 0, 0, 0, 0, 0, 0},
                        prior_sigmas(width, height, prior_px));
  adjustment.minimise(kMostRounds);
  const double variance = adjustment.covariance()(kFocal, kFocal);
  const Lens& lens = adjustment.lens();
  const double focal_px = std::exp(lens(kFocal));
  estimate.lens = {
      focal_px,  lens(kK1), lens(kK2), lens(kK3), focal_px * lens(kCx), focal_px * lens(kCy),
      lens(kP1), lens(kP2)};
  if (variance < kPriorVariance)
    estimate.focal_variance = std::max(variance, variance_by_cost(adjustment));
  estimate.is_known = true;
  return estimate;
}

CameraEvidence evidence_on_camera(const std::vector<LensKeyframe>& keyframes,
                                  const std::vector<tv_map_point>& points,
                                  const tv_camera& camera) {
  constexpr Extent kGlance{6, 300}, kThorough;
  const Picture picture(camera);
  std::vector<LensWindow> windows = windows_of(keyframes, points, picture, kGlance);
  if (num_views(windows) < kLeastKeyframes) return {};
  const CameraEvidence first = evidence_of(std::move(windows), picture, false);
  if (!is_focal_beyond(2, first) && !is_lens_beyond(2, first) && !is_centre_beyond(2, first))
    return first;
  return evidence_of(windows_of(keyframes, points, picture, kThorough), picture, true);
}

}  // namespace cli
