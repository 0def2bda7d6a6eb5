// Replaces vehicle.cc in a program without MAVLink's driver.
#include "base/error.h"
#include "drone/vehicle.h"
#include "recording/vehicle.h"

namespace cli {

void fly_vehicle(const VehicleAddress&, const LinkListener&, const std::function<bool()>&,
                 const std::atomic<bool>&, double, bool) {
  throw BadInput(kNoMavlink);
}

int record_vehicle(const VehicleAddress&, const std::string&, double, bool, bool) {
  throw BadInput(kNoMavlink);
}

int info_vehicle(const VehicleAddress&, double, bool) { throw BadInput(kNoMavlink); }

}  // namespace cli
