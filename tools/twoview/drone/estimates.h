// What visual odometry knows of a frame, sent to the filter of a MAVLink vehicle. In a program
// without MAVLink's driver vehicle_none.cc stands in.
#pragma once

#include <array>
#include <cstdint>
#include <optional>
#include <string>

#include "base/matrix.h"
#include "twoview_drivers/mavlink/estimate.h"

namespace cli {

struct EstimateOptions {
  bool odometry = false;         // ODOMETRY
  bool vision_position = false;  // VISION_POSITION_ESTIMATE
  bool weak = false;             // weak frames, too, with larger covariances
  bool north = false;            // in axes north, east, down

  bool given() const { return odometry || vision_position; }
};

class VehicleEstimates {
 public:
  // body_from_camera and camera_in_body: the mount, in the vehicle's axes.
  VehicleEstimates(const EstimateOptions& options, const Matrix3& body_from_camera,
                   const Vector3& camera_in_body);

  // A picture was handed over that was exposed at host_ns of the session's clock, when the vehicle
  // had this velocity along the body's axes, with this standard deviation of each component.
  void begin(int64_t host_ns, const std::optional<Vector3>& velocity_m_s, double sigma);
  // Sends what was found of it. previous: the last sent frame's R and t, world_from_cam, in the map
  // as it is now.
  void send(tvm_session* session, const tv_odometry_state& state,
            const std::optional<std::array<double, 12>>& previous);
  // How many frames gave an estimate, why the others gave none, and the CPU time that a frame
  // took from begin to the end of send.
  std::string note() const;

 private:
  static constexpr size_t kNumSilences = TVM_SILENCE_MOTION + 1;
  tvm_estimator estimator_{};
  std::array<int, kNumSilences> num_{};  // of each tvm_silence
  tvm_track track_{};                    // of the picture that was handed over last
  double begun_ms_ = 0, sum_ms_ = 0, most_ms_ = 0;
};

}  // namespace cli
