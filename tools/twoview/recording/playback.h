// A recording of `drone record`, played through the driver as if the drone sent it again.
#pragma once

#include <atomic>
#include <string>

#include "recording/driver_session.h"

namespace cli {

// Plays a recording's folder through a session until its end or `stop`: as fast as the computer can
// when `speed` is 0, else `speed` times as fast as it was recorded. Throws BadInput where there is
// no recording.
ardrone_counters play(const std::string& folder, LinkListener listener,
                      const std::atomic<bool>& stop, double speed);

}  // namespace cli
