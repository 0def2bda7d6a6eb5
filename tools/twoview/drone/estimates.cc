#include "drone/estimates.h"

#include <algorithm>
#include <cstdio>
#include <ctime>
#include <numeric>

#include "base/error.h"
#include "recording/driver_session.h"

namespace cli {
namespace {

// CPU time of this thread, in milliseconds, as that of the tracker.
double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

}  // namespace

VehicleEstimates::VehicleEstimates(const EstimateOptions& options, const Matrix3& body_from_camera,
                                   const Vector3& camera_in_body) {
  tvm_estimator_options o;
  tvm_estimator_options_init(&o);
  o.messages = (options.odometry ? TVM_SEND_ODOMETRY : 0) |
               (options.vision_position ? TVM_SEND_VISION_POSITION : 0);
  o.weak = options.weak ? TVM_WEAK_GROWN : TVM_WEAK_SILENT;
  o.world = options.north ? TVM_WORLD_NED : TVM_WORLD_FRD;
  std::copy(body_from_camera.begin(), body_from_camera.end(), o.body_from_camera);
  std::copy(camera_in_body.begin(), camera_in_body.end(), o.camera_in_body);
  check_driver(tvm_estimator_init(&estimator_, &o), "the mount of the camera");
}

void VehicleEstimates::begin(int64_t host_ns, const std::optional<Vector3>& velocity_m_s,
                             double sigma) {
  begun_ms_ = cpu_ms();
  track_ = {};
  track_.struct_size = sizeof track_;
  track_.host_ns = host_ns;
  if (!velocity_m_s) return;
  std::copy(velocity_m_s->begin(), velocity_m_s->end(), track_.velocity_m_s);
  track_.velocity_sigma_m_s = sigma;
}

void VehicleEstimates::send(tvm_session* session, const tv_odometry_state& state,
                            const std::optional<std::array<double, 12>>& previous) {
  tvm_track track = track_;
  track.state = &state;
  if (previous) {
    track.has_previous = 1;
    std::copy_n(previous->begin(), 9, track.previous_R);
    std::copy_n(previous->begin() + 9, 3, track.previous_t);
  }
  tvm_estimate estimate{};
  estimate.struct_size = sizeof estimate;
  // If the socket cannot send at this moment, the flight goes on.
  const tvs_status status = tvm_session_send_track(session, &estimator_, &track, &estimate);
  if (status == TVS_OK || status == TVS_NONE) ++num_[static_cast<size_t>(estimate.silence)];
  const double took_ms = cpu_ms() - begun_ms_;
  sum_ms_ += took_ms;
  most_ms_ = std::max(most_ms_, took_ms);
}

std::string VehicleEstimates::note() const {
  constexpr std::array<const char*, kNumSilences> kWords = {"",
                                                            "before the map began",
                                                            "lost",
                                                            "rotation",
                                                            "weak",
                                                            "metre not known",
                                                            "vertical not known",
                                                            "velocity not known",
                                                            "not as the vehicle moves"};
  std::string text = std::to_string(num_[TVM_SILENCE_NONE]) + " frames were sent to the vehicle";
  std::string others;
  for (size_t k = 1; k < kNumSilences; ++k)
    if (num_[k] > 0) others += ", " + std::to_string(num_[k]) + " " + kWords[k];
  if (!others.empty()) text += "; not sent: " + others.substr(2);
  const int num_frames = std::accumulate(num_.begin(), num_.end(), 0);
  if (num_frames == 0) return text;
  std::array<char, 80> times{};
  std::snprintf(times.data(), times.size(),
                "; from picture to message %.2f ms (mean), %.2f ms (max)", sum_ms_ / num_frames,
                most_ms_);
  return text + times.data();
}

}  // namespace cli
