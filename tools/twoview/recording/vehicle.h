// Recordings of a MAVLink vehicle: how they are written and played. In a program without MAVLink's
// driver vehicle_none.cc stands in: there are no such recordings then, and what would need the
// driver throws BadInput.
#pragma once

#include <atomic>
#include <nlohmann/json_fwd.hpp>
#include <string>

#include "recording/driver_session.h"

namespace cli {

// What a program without the driver answers.
inline constexpr char kNoMavlink[] =
    "this program was built without MAVLink: `scripts/bootstrap mavlink` fetches its generator, "
    "then configure and build again";

// Whether a folder holds what `drone record --mavlink` writes.
bool is_vehicle_recording(const std::string& folder);

// Plays such a recording through MAVLink's driver until its end, until `stop` is set, or its first
// duration_s seconds (0: all): on_imu and on_frame of the listener are called. Speed 0 is as fast
// as possible; otherwise it is `speed` times the recorded speed. Returns the summary, as
// summary.json has it. Throws BadInput.
nlohmann::ordered_json play_vehicle(const std::string& folder, LinkListener listener,
                                    const std::atomic<bool>& stop, double speed,
                                    double duration_s = 0);

}  // namespace cli
