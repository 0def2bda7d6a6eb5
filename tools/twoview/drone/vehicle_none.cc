// Replaces vehicle.cc in a program without MAVLink's driver.
#include "base/error.h"
#include "drone/estimates.h"
#include "drone/vehicle.h"
#include "recording/vehicle.h"

namespace cli {

VehicleEstimates::VehicleEstimates(const EstimateOptions&, const Matrix3&, const Vector3&) {
  throw BadInput(kNoMavlink);
}

void VehicleEstimates::begin(int64_t, const std::optional<Vector3>&, double) {}

void VehicleEstimates::send(tvm_session*, const tv_odometry_state&,
                            const std::optional<std::array<double, 12>>&) {}

std::string VehicleEstimates::note() const { return {}; }

void fly_vehicle(const VehicleAddress&, const LinkListener&, const std::function<bool()>&,
                 const std::atomic<bool>&, double, bool, tvm_session**) {
  throw BadInput(kNoMavlink);
}

int record_vehicle(const VehicleAddress&, const std::string&, double, bool, bool) {
  throw BadInput(kNoMavlink);
}

int info_vehicle(const VehicleAddress&, double, bool) { throw BadInput(kNoMavlink); }

}  // namespace cli
