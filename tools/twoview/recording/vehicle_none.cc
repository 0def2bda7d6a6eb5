// Replaces vehicle.cc in a program without MAVLink's driver.
#include <filesystem>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "recording/vehicle.h"

namespace cli {

bool is_vehicle_recording(const std::string& folder) {
  std::error_code error;
  return std::filesystem::exists(std::filesystem::path(folder) / "vehicle.tlog", error);
}

nlohmann::ordered_json play_vehicle(const std::string&, LinkListener, const std::atomic<bool>&,
                                    double, double) {
  throw BadInput(kNoMavlink);
}

}  // namespace cli
