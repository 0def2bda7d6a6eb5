// Plays a recording of `drone record` through its driver as if the drone sent the data again.
#pragma once

#include <atomic>
#include <string>

#include "recording/driver_session.h"

namespace cli {

// Plays the recording in a folder until its end, until `stop` is set, or its first duration_s
// seconds (0: all). Speed 0 is as fast as possible; otherwise it is `speed` times the recorded
// speed. A recording of a MAVLink vehicle is played by its own driver, and the counters are then 0.
// Throws BadInput if there is no recording.
ardrone_counters play(const std::string& folder, LinkListener listener,
                      const std::atomic<bool>& stop, double speed, double duration_s = 0);

}  // namespace cli
