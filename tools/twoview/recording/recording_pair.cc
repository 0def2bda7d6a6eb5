#include "recording/recording_pair.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <map>
#include <nlohmann/json.hpp>
#include <opencv2/core.hpp>
#include <set>

#include "base/error.h"
#include "base/output.h"
#include "files/camera_file.h"
#include "pair/reconstruct_pair.h"
#include "recording/playback.h"

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;
constexpr double kAttitudeGapS = 0.25;
constexpr size_t kCandidates = 24;  // number of frames among which the pair is chosen
constexpr double kFarthestS = 4;    // longest time between the two frames of a pair, seconds
constexpr double kEnoughParallaxDeg = 3;

Matrix3 matrix_of(const double q[4]) {
  const double w = q[0], x = q[1], y = q[2], z = q[3];
  return {1 - 2 * (y * y + z * z), 2 * (x * y - w * z),     2 * (x * z + w * y),
          2 * (x * y + w * z),     1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
          2 * (x * z - w * y),     2 * (y * z + w * x),     1 - 2 * (x * x + y * y)};
}

FlightSample sample_of(const tvs_imu& imu) {
  FlightSample sample;
  sample.time_s = static_cast<double>(imu.time.host_ns) * 1e-9;
  sample.run = imu.attitude.clock_id;
  sample.world_from_body = matrix_of(imu.attitude.world_from_body);
  sample.attitude_sigma_rad = imu.attitude.sigma_rad;
  constexpr uint32_t kVelocity = TVS_IMU_VELOCITY_XY | TVS_IMU_VELOCITY_Z;
  if ((imu.valid & kVelocity) == kVelocity) {
    sample.velocity_m_s = Vector3{imu.velocity_m_s[0], imu.velocity_m_s[1], imu.velocity_m_s[2]};
    sample.velocity_sigma = imu.velocity_sigma;
  }
  if ((imu.valid & TVS_IMU_ALTITUDE) != 0) {
    sample.altitude_m = imu.altitude_m;
    sample.altitude_sigma = imu.altitude_sigma;
  }
  return sample;
}

// Decodes the pictures with these indices; the keys are the indices.
std::map<int, cv::Mat> read_pictures(const std::string& folder, const std::set<int>& wanted) {
  std::map<int, cv::Mat> pictures;
  int index = 0;
  LinkListener listener;
  listener.on_frame = [&](const tvs_frame& frame) {
    if (wanted.count(index) != 0)
      pictures[index] = cv::Mat(frame.image.height, frame.image.width, CV_8U,
                                const_cast<uint8_t*>(frame.image.data),
                                static_cast<size_t>(frame.image.stride_bytes))
                            .clone();
    ++index;
  };
  static const std::atomic<bool> never{false};
  play(folder, listener, never, 0);
  return pictures;
}

Picture picture_of(const RecordedFrame& frame, const cv::Mat& luma) {
  Picture picture;
  picture.name = "frame " + std::to_string(frame.index);
  picture.path = picture.name;
  picture.luma = luma;
  cv::merge(std::vector<cv::Mat>(3, luma), picture.colour);
  picture.file_width = luma.cols;
  picture.file_height = luma.rows;
  return picture;
}

// The attitude at a frame's time; empty if the time or the attitude is unknown.
std::optional<FlightSample> sample_of(const RecordedFlight& flight, const RecordedFrame& frame) {
  if (!frame.timed) return {};
  return sample_at(flight.log, frame.time_s, kAttitudeGapS);
}

// At most kCandidates frames, evenly spread: over the frames with a known attitude in which the
// drone moved faster than 0.05 m/s; if there are fewer than two, over those with a known attitude;
// if there are fewer than two of these, over all frames.
std::vector<RecordedFrame> candidates_of(const RecordedFlight& flight) {
  std::vector<RecordedFrame> moving, known;
  for (const RecordedFrame& frame : flight.frames) {
    const std::optional<FlightSample> at = sample_of(flight, frame);
    if (!at) continue;
    known.push_back(frame);
    if (at->velocity_m_s && norm(*at->velocity_m_s) > 0.05) moving.push_back(frame);
  }
  const std::vector<RecordedFrame>& from = moving.size() > 1  ? moving
                                           : known.size() > 1 ? known
                                                              : flight.frames;
  std::vector<RecordedFrame> chosen;
  const size_t count = std::min(kCandidates, from.size());
  for (size_t k = 0; k < count; ++k) chosen.push_back(from[k * from.size() / count]);
  return chosen;
}

double score_of(const tv_two_view& v) {
  if (!has_full_pose(v) || v.verdict != TV_VERDICT_OK) return 0;
  const double parallax = v.median_parallax_rad * kDegrees;
  return v.num_inliers * std::min(1.0, parallax / kEnoughParallaxDeg);
}

}  // namespace

FlightSample flight_sample(const tvs_imu& imu) { return sample_of(imu); }

RecordedFlight read_flight(const std::string& folder) {
  RecordedFlight flight;
  LinkListener listener;
  listener.on_imu = [&](const tvs_imu& imu) {
    if ((imu.valid & TVS_IMU_ATTITUDE) != 0) flight.log.push_back(sample_of(imu));
  };
  listener.on_frame = [&](const tvs_frame& frame) {
    if (flight.frames.empty()) {
      flight.width = frame.image.width;
      flight.height = frame.image.height;
    }
    const double time_s = static_cast<double>(frame.time.host_ns) * 1e-9;
    // A picture can arrive before the attitude sample that follows its time; the complete log
    // contains that sample.
    const bool follows_log =
        !flight.log.empty() && time_s - flight.log.back().time_s < kAttitudeGapS;
    flight.frames.push_back({static_cast<int>(flight.frames.size()), frame.number, time_s,
                             follows_log || (frame.flags & TVS_FRAME_HAS_ATTITUDE) != 0});
  };
  static const std::atomic<bool> never{false};
  play(folder, listener, never, 0);
  std::stable_sort(
      flight.log.begin(), flight.log.end(),
      [](const FlightSample& a, const FlightSample& b) { return a.time_s < b.time_s; });
  if (flight.frames.empty()) throw BadInput("no picture decodes in the recording " + folder);
  return flight;
}

RecordingPair pair_of(const std::string& folder, const RecordedFlight& flight, int index0,
                      int index1) {
  for (const int index : {index0, index1})
    if (index < 0 || static_cast<size_t>(index) >= flight.frames.size())
      throw BadInput("--frames: there is no frame " + std::to_string(index) + " in " + folder +
                     ", which has 0 to " + std::to_string(flight.frames.size() - 1));
  const std::map<int, cv::Mat> pictures = read_pictures(folder, {index0, index1});
  RecordingPair pair;
  const int indices[2] = {index0, index1};
  for (int k = 0; k < 2; ++k) {
    pair.frame[k] = flight.frames[static_cast<size_t>(indices[k])];
    pair.picture[k] = picture_of(pair.frame[k], pictures.at(indices[k]));
  }
  pair.why = "as asked for";
  return pair;
}

RecordingPair choose_pair(const std::string& folder, const RecordedFlight& flight,
                          const tv_camera& camera, const CameraMount& mount, Session& session,
                          const Options& options, const Progress& progress) {
  const std::vector<RecordedFrame> candidates = candidates_of(flight);
  std::set<int> wanted;
  for (const RecordedFrame& frame : candidates) wanted.insert(frame.index);
  const std::map<int, cv::Mat> pictures = read_pictures(folder, wanted);
  RecordingPair best;
  double best_score = 0;
  int tried = 0, inliers = 0;
  double parallax_deg = 0;
  for (size_t i = 0; i < candidates.size(); ++i) {
    progress.tell("frame " + std::to_string(i + 1) + " of " + std::to_string(candidates.size()) +
                  " beside those after it: " + std::to_string(tried) + " pairs tried");
    for (size_t j = i + 1; j < candidates.size(); ++j) {
      if (candidates[j].time_s - candidates[i].time_s > kFarthestS) break;
      Outcome outcome;
      outcome.has_cameras = true;
      const RecordedFrame frames[2] = {candidates[i], candidates[j]};
      Picture whole[2];
      for (int k = 0; k < 2; ++k) {
        whole[k] = picture_of(frames[k], pictures.at(frames[k].index));
        outcome.picture[k] = whole[k];
        const cv::Mat& luma = whole[k].luma;
        outcome.picture[k].mask = options.masks.of(whole[k].name, luma.cols, luma.rows);
        shrink(outcome.picture[k], options.longer_side(luma.cols, luma.rows));
        outcome.camera[k] =
            resized(camera, outcome.picture[k].luma.cols, outcome.picture[k].luma.rows);
      }
      Options own = options;
      own.effort = Options::kEffortFixed;  // the best pair of many is one that rung 0 knows
      set_gravity(flight, frames, mount, own.estimate);
      reconstruct_pair(session, own, outcome);
      ++tried;
      const double score = score_of(outcome.two_view);
      if (score <= best_score) continue;
      best_score = score;
      inliers = outcome.two_view.num_inliers;
      parallax_deg = outcome.two_view.median_parallax_rad * kDegrees;
      std::copy(std::begin(frames), std::end(frames), std::begin(best.frame));
      std::copy(std::begin(whole), std::end(whole), std::begin(best.picture));
    }
  }
  if (best_score == 0)
    throw BadInput("no two of " + std::to_string(candidates.size()) + " frames of " + folder +
                   " give a pose to be believed; --frames I J takes two of your own");
  char why[160];
  std::snprintf(why, sizeof why, "the best of %d pairs: %d matches agree, %.1f deg of parallax",
                tried, inliers, parallax_deg);
  best.why = why;
  return best;
}

bool set_gravity(const RecordedFlight& flight, const RecordedFrame frames[2],
                 const CameraMount& mount, tv_estimate_options& options) {
  double sigma = 0;
  Vector3 down[2];
  for (int k = 0; k < 2; ++k) {
    const auto at = sample_of(flight, frames[k]);
    if (!at) return false;
    const Matrix3 camera_from_world =
        transposed(product(at->world_from_body, mount.body_from_camera));
    down[k] = applied(camera_from_world, {0, 0, 1});
    sigma = std::max(sigma, at->attitude_sigma_rad);
  }
  if (!(sigma > 0)) return false;
  std::copy(down[0].begin(), down[0].end(), options.gravity0);
  std::copy(down[1].begin(), down[1].end(), options.gravity1);
  options.gravity_sigma_rad = sigma;
  return true;
}

nlohmann::ordered_json imu_json(const RecordedFlight& flight, const RecordedFrame frames[2],
                                const CameraMount& mount, const tv_two_view& two_view,
                                bool gravity_used, const std::optional<MetricScale>& scale) {
  const auto at0 = sample_of(flight, frames[0]), at1 = sample_of(flight, frames[1]);
  if (!at0 || !at1 || at0->run != at1->run || !two_view.has_R) return nullptr;
  const Matrix3 camera1_from_world =
      transposed(product(at1->world_from_body, mount.body_from_camera));
  const Matrix3 by_imu =
      product(camera1_from_world, product(at0->world_from_body, mount.body_from_camera));
  // The standard deviation of the angle: both attitudes have errors about each of three axes.
  const double imu_sigma =
      std::sqrt(3.0) * std::hypot(at0->attitude_sigma_rad, at1->attitude_sigma_rad);
  const double* c = two_view.covariance;
  const double vision_sigma = two_view.has_covariance ? std::sqrt(c[0] + c[6] + c[12]) : NAN;
  nlohmann::ordered_json json;
  json["rotation_difference_deg"] = rotation_error_deg(rotation_of(two_view), by_imu);
  json["sigma_deg"] = finite_or_null(
      kDegrees * (two_view.has_covariance ? std::hypot(imu_sigma, vision_sigma) : imu_sigma));
  json["imu_sigma_deg"] = kDegrees * imu_sigma;
  json["vision_sigma_deg"] = finite_or_null(kDegrees * vision_sigma);
  json["gravity_used"] = gravity_used;
  json["scale_source"] =
      scale ? nlohmann::ordered_json(scale->source) : nlohmann::ordered_json(nullptr);
  return json;
}

std::vector<std::optional<MetricScale>> scales_of(const RecordedFlight& flight,
                                                  const RecordedFrame frames[2],
                                                  const CameraMount& mount,
                                                  const Outcome& outcome) {
  const tv_two_view& v = outcome.two_view;
  const auto at0 = sample_of(flight, frames[0]);
  if (!has_full_pose(v) || !at0) return {};
  const Matrix3 world_from_camera = product(at0->world_from_body, mount.body_from_camera);
  const Vector3 seen = applied(transposed(rotation_of(v)), translation_of(v));
  const Vector3 way = applied(world_from_camera, {-seen[0], -seen[1], -seen[2]});
  const double direction_sigma =
      v.has_covariance ? std::sqrt(std::max(v.covariance[18], v.covariance[24])) : 0.05;
  std::vector<Vector3> points;
  const tv_reconstruction& r = outcome.reconstruction;
  for (int32_t k = 0; k < r.num_matches; ++k) {
    const tv_point& p = r.points[k];
    if (p.status == TV_POINT_OK) points.push_back({p.position[0], p.position[1], p.position[2]});
  }
  const double time0 = frames[0].time_s, time1 = frames[1].time_s;
  return {scale_by_velocity(flight.log, time0, time1, mount, way),
          scale_by_altitude(flight.log, time0, time1, way, direction_sigma, mount),
          scale_by_floor(flight.log, time0, points, mount)};
}

}  // namespace cli
