#include "odometry/measurements.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <limits>

#include "base/error.h"
#include "base/output.h"
#include "odometry/numbers.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = 1 << 28;
constexpr double kGapS = 0.25;      // longest time between two samples that are interpolated
constexpr double kSameS = 1e-6;     // a sample at the time of the frame, as times are written
constexpr size_t kNumbers = 12;     // a sample
constexpr double kGyroGapS = 0.1;   // longest time between two samples of a gyro
constexpr int kMostRateRadS = 100;  // above it, a gyro's rates are in degrees
// What no drone has, as in the drivers: such a number is no measurement.
constexpr double kMostHeightM = 3000, kMostSpeedMS = 150;

// The numbers of words[first..], in which "nan" means "not measured".
std::vector<double> numbers_of(const std::vector<std::string_view>& words, size_t first,
                               const std::string& where) {
  std::vector<double> numbers;
  for (size_t k = first; k < words.size(); ++k) {
    double value = std::numeric_limits<double>::quiet_NaN();
    const bool is_nan = words[k] == "nan" || words[k] == "NaN" || words[k] == "NAN";
    if (!is_nan && !to_number(words[k], value))
      throw BadInput(where + " has '" + std::string(words[k]) +
                     "', which is neither a finite number nor nan");
    numbers.push_back(value);
  }
  return numbers;
}

// Whether all of numbers[first..last] were measured.
bool is_known(const std::vector<double>& numbers, size_t first, size_t last) {
  return std::none_of(numbers.begin() + static_cast<std::ptrdiff_t>(first),
                      numbers.begin() + static_cast<std::ptrdiff_t>(last) + 1,
                      [](double value) { return std::isnan(value); });
}

bool is_quaternion(const double* q) {
  return q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] > 1e-12;
}

// The quaternion `share` of the way from a to b: the normalised mean, which is exact enough for the
// short way between two samples.
std::array<double, 4> between(const std::array<double, 4>& a, const std::array<double, 4>& b,
                              double share) {
  double product = 0, length_a = 0, length_b = 0;
  for (size_t k = 0; k < 4; ++k) {
    product += a[k] * b[k];
    length_a += a[k] * a[k];
    length_b += b[k] * b[k];
  }
  const double of_a = (1 - share) / std::sqrt(length_a);
  const double of_b = (product < 0 ? -share : share) / std::sqrt(length_b);
  std::array<double, 4> q;
  for (size_t k = 0; k < 4; ++k) q[k] = of_a * a[k] + of_b * b[k];
  return q;
}

}  // namespace

Measurements::Sample Measurements::sample_of(const std::vector<double>& n,
                                             const std::string& where) {
  if (n.size() != kNumbers)
    throw BadInput(where + " has " + std::to_string(n.size()) +
                   " numbers, not 12: a time, an attitude, a height and a velocity, with a sigma "
                   "each");
  Sample sample;
  sample.time_s = n[0];
  if (std::isnan(n[0])) throw BadInput(where + " has no time");
  for (const size_t sigma : {5, 7, 11})
    if (n[sigma] < 0) throw BadInput(where + " has a negative standard deviation");
  if (is_known(n, 1, 5)) {
    if (!is_quaternion(&n[1])) throw BadInput(where + " has a quaternion of length 0");
    sample.world_from_body = {n[2], n[3], n[4], n[1]};
    sample.attitude_sigma_rad = n[5];
  }
  if (is_known(n, 6, 7) && n[7] > 0) {
    const bool is_possible = std::abs(n[6]) <= kMostHeightM;
    ++heights_.measured;
    heights_.impossible += !is_possible;
    sample.height_m = n[6];
    sample.height_sigma_m = is_possible ? n[7] : 0;
  }
  if (is_known(n, 8, 11) && n[11] > 0) {
    const bool is_possible = std::hypot(n[8], n[9], n[10]) <= kMostSpeedMS;
    ++velocities_.measured;
    velocities_.impossible += !is_possible;
    sample.velocity_m_s = {n[8], n[9], n[10]};
    sample.velocity_sigma_m_s = is_possible ? n[11] : 0;
  }
  return sample;
}

void Measurements::add_gyro(const std::vector<double>& n, const std::string& where) {
  if (n.size() != 5)
    throw BadInput(where + " has " + std::to_string(n.size()) +
                   " numbers after gyro, not 5: a time, three rates and their sigma");
  if (std::isnan(n[0])) throw BadInput(where + " has no time");
  if (n[4] < 0) throw BadInput(where + " has a negative standard deviation");
  if (!is_known(n, 1, 4) || n[4] == 0) return;
  if (std::hypot(n[1], n[2], n[3]) > kMostRateRadS)
    throw BadInput(where + " has a rate above " + std::to_string(kMostRateRadS) +
                   " rad/s: are its rates in degrees?");
  if (!gyro_.empty() && !(n[0] > gyro_.back().time_s))
    throw BadInput(where + ": its time is not later than that of the gyro line before");
  const Vector3 rate = applied(transposed(body_from_camera_), {n[1], n[2], n[3]});
  gyro_.push_back({n[0], {rate[0], rate[1], rate[2]}});
  gyro_sigma_rad_s_ = std::max(gyro_sigma_rad_s_, n[4]);
}

bool Measurements::are_metres() const {
  return 2 * heights_.impossible <= heights_.measured &&
         2 * velocities_.impossible <= velocities_.measured;
}

Measurements Measurements::read(const std::string& file) {
  const std::string text = read_file(file, kMaxFileBytes);
  Measurements found;
  found.file_ = file;
  bool has_mount = false;
  for (const TextLine& line : lines_of(text)) {
    const std::string where = file + ": line " + std::to_string(line.number);
    const std::vector<std::string_view> words = words_of(line.text);
    if (!has_mount) {
      const std::vector<double> q =
          words[0] == "body_from_cam" ? numbers_of(words, 1, where) : std::vector<double>();
      if (q.size() != 4 || !is_known(q, 0, 3) || !is_quaternion(q.data()))
        throw BadInput(where + " is not body_from_cam and a quaternion w x y z");
      found.body_from_camera_ = rotation_of_quaternion(q[1], q[2], q[3], q[0]);
      has_mount = true;
      continue;
    }
    if (words[0] == "gyro") {
      found.add_gyro(numbers_of(words, 1, where), where);
      continue;
    }
    const Sample sample = found.sample_of(numbers_of(words, 0, where), where);
    if (!found.samples_.empty() && !(sample.time_s > found.samples_.back().time_s))
      throw BadInput(where + ": its time is not later than that of the line before");
    found.samples_.push_back(sample);
  }
  if (!has_mount) throw BadInput(file + ": no line body_from_cam in it");
  if (!found.are_metres())
    for (Sample& sample : found.samples_) sample.height_sigma_m = sample.velocity_sigma_m_s = 0;
  return found;
}

std::string Measurements::note(const std::vector<double>& frame_times_s) const {
  const std::string units = note_on_units(), clock = note_on_clock(frame_times_s);
  return units + (units.empty() || clock.empty() ? "" : "; ") + clock;
}

std::string Measurements::note_on_clock(const std::vector<double>& frame_times_s) const {
  if (samples_.empty() || frame_times_s.empty()) return {};
  const auto num_met = std::count_if(frame_times_s.begin(), frame_times_s.end(),
                                     [this](double time) { return around(time)[0] != nullptr; });
  if (2 * static_cast<size_t>(num_met) >= frame_times_s.size()) return {};
  char text[320];
  std::snprintf(text, sizeof text,
                ": only %d of %zu frames have a sample before and behind them, at most %g s apart; "
                "its times are %.12g to %.12g s, the frames' %.12g to %.12g s: are they seconds of "
                "one clock?",
                static_cast<int>(num_met), frame_times_s.size(), kGapS, samples_.front().time_s,
                samples_.back().time_s, frame_times_s.front(), frame_times_s.back());
  return file_ + text;
}

std::string Measurements::note_on_units() const {
  if (heights_.impossible + velocities_.impossible == 0) return {};
  const std::string found = file_ + ": of " + std::to_string(samples_.size()) + " samples " +
                            std::to_string(heights_.impossible) + " heights above 3000 m and " +
                            std::to_string(velocities_.impossible) + " velocities above 150 m/s";
  if (are_metres()) return found + " were left out: are they in metres?";
  return found +
         ": most are not in metres, so no height and no velocity is used, and the scale is "
         "unknown";
}

std::array<const Measurements::Sample*, 2> Measurements::around(double time_s) const {
  const auto b =
      std::lower_bound(samples_.begin(), samples_.end(), time_s - kSameS,
                       [](const Sample& sample, double time) { return sample.time_s < time; });
  if (b == samples_.end()) return {};
  auto a = b;
  if (b->time_s > time_s + kSameS) {
    if (b == samples_.begin()) return {};
    a = b - 1;
  }
  if (b->time_s - a->time_s > kGapS) return {};
  return {&*a, &*b};
}

void Measurements::add_turn(double before_s, SourceFrame& frame) const {
  const auto is_before = [](const tv_gyro_sample& s, double time) { return s.time_s < time; };
  const auto last = std::lower_bound(gyro_.begin(), gyro_.end(), frame.time_s, is_before);
  auto first = std::lower_bound(gyro_.begin(), last, before_s, is_before);
  if (last == gyro_.end() || first == gyro_.begin()) return;
  --first;
  for (auto k = first; k != last; ++k)
    if (std::next(k)->time_s - k->time_s > kGyroGapS) return;
  Matrix3 turn;
  double sigma = 0;
  if (tv_integrate_gyro(&*first, static_cast<int32_t>(last - first) + 1, gyro_sigma_rad_s_,
                        before_s, frame.time_s, turn.data(), &sigma) != TV_OK)
    return;
  frame.previous_from_cam = turn;
  frame.turn_sigma_rad = sigma;
}

void Measurements::add_to(SourceFrame& frame) const {
  const auto [a, b] = around(frame.time_s);
  if (a == nullptr) return;
  const double seconds = b->time_s - a->time_s;
  const double share = a == b ? 0 : (frame.time_s - a->time_s) / seconds;
  const auto mean = [share](double x, double y) { return x + share * (y - x); };
  if (a->attitude_sigma_rad > 0 && b->attitude_sigma_rad > 0) {
    const std::array<double, 4> q = between(a->world_from_body, b->world_from_body, share);
    frame.world_from_cam =
        product(rotation_of_quaternion(q[0], q[1], q[2], q[3]), body_from_camera_);
    frame.attitude_sigma_rad = std::max(a->attitude_sigma_rad, b->attitude_sigma_rad);
  }
  if (a->height_sigma_m > 0 && b->height_sigma_m > 0) {
    frame.height_m = mean(a->height_m, b->height_m);
    frame.height_sigma_m = std::max(a->height_sigma_m, b->height_sigma_m);
  }
  if (a->velocity_sigma_m_s > 0 && b->velocity_sigma_m_s > 0) {
    Vector3 velocity;
    for (size_t k = 0; k < 3; ++k) velocity[k] = mean(a->velocity_m_s[k], b->velocity_m_s[k]);
    frame.velocity_m_s = applied(transposed(body_from_camera_), velocity);
    frame.velocity_sigma_m_s = std::max(a->velocity_sigma_m_s, b->velocity_sigma_m_s);
  }
}

}  // namespace cli
