// Writes the files of `drone record --mavlink`: vehicle.tlog (the telemetry log that ground
// stations write, too), frames.txt, frames/NUMBER.png, attitude.tum and summary.json. Only in a
// program with MAVLink's driver.
#pragma once

#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>

#include "recording/recording.h"

namespace cli {

class VehicleRecording {
 public:
  // Creates the folder if it does not exist. Throws BadInput if it already holds a recording.
  explicit VehicleRecording(const std::filesystem::path& folder);

  // Times are nanoseconds since 1970 began.
  void add_packet(int64_t now_ns, const uint8_t* bytes, size_t size);
  void add_sample(const tvs_imu& sample);
  void add_frame(const tvs_frame& frame);
  void add_summary(const std::string& json);

 private:
  std::filesystem::path folder_;
  std::unique_ptr<GrowingFile> log_, attitude_, frames_;
};

}  // namespace cli
