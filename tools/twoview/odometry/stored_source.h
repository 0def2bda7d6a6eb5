// Sources of frames that lie on the disk, and so can be read again.
#pragma once

#include <memory>
#include <string>

#include "odometry/frames.h"

namespace cli {

// A folder of images, a recording of a drone, or a film; null where `path` is none of them, which
// may be a camera. fps 0: not given. camera_file: gives the mount of a drone's camera; may be
// empty. Throws BadInput.
std::unique_ptr<FrameSource> open_stored_source(const std::string& path, double fps, bool with_imu,
                                                const std::string& camera_file);

// Whether a folder holds a recording of a drone.
bool is_recording_folder(const std::string& path);

}  // namespace cli
