#include "odometry/stored_source.h"

#include <filesystem>

#include "base/error.h"
#include "files/folder.h"
#include "files/image_header.h"
#ifdef TWOVIEW_HAS_DRONE
#include "odometry/drone_frames.h"
#endif

namespace cli {
namespace {

namespace fs = std::filesystem;

std::unique_ptr<FrameSource> open_recording_folder(const std::string& path,
                                                   const std::string& camera_file) {
#ifdef TWOVIEW_HAS_DRONE
  return open_recording(path, camera_file);
#else
  (void)camera_file;
  throw BadInput("cannot read " + path + ": this program was built without the drone's driver");
#endif
}

}  // namespace

namespace {

// Whether this is one file of several pictures that follow each other in time; pages of a TIFF do
// not.
bool is_animated_picture(const std::string& path) {
  const std::string ending = fs::path(path).extension().string();
  return has_picture_ending(path) && (ending == ".webp" || ending == ".png") &&
         read_image_header(picture_head(path)).has_more;
}

}  // namespace

bool is_recording_folder(const std::string& path) {
  std::error_code error;
  return fs::exists(fs::path(path) / "video.pave", error) ||
         fs::exists(fs::path(path) / "vehicle.tlog", error);
}

std::unique_ptr<FrameSource> open_stored_source(const std::string& path, double fps, bool with_imu,
                                                const std::string& camera_file) {
  std::error_code error;
  if (fs::is_directory(path, error)) {
    if (!is_recording_folder(path)) return open_image_folder(path, fps, with_imu);
    if (fps > 0) throw BadInput("--fps: a recording of a drone has times");
    return open_recording_folder(path, camera_file);
  }
  if (is_animated_picture(path))
    throw BadInput(path +
                   " is an animated picture, whose frames are not read: give a folder of them with "
                   "--fps (of WebP by anim_dump of libwebp), or a film");
  if (has_picture_ending(path) && fs::is_regular_file(path, error))
    throw BadInput("cannot read " + path +
                   " as a film: it is one picture; give the folder of the pictures, and --fps "
                   "(pages of a TIFF: each as a file)");
  if (fs::is_regular_file(path, error)) return open_film(path, fps);
  return nullptr;
}

}  // namespace cli
