#include "odometry/kept_pictures.h"

#include <fcntl.h>
#include <unistd.h>

#include <cerrno>
#include <cstdlib>
#include <cstring>
#include <opencv2/imgcodecs.hpp>

#include "base/error.h"
#include "files/image_file.h"
#include "room_model/partners.h"
#include "sources/film.h"

namespace cli {
namespace {

constexpr int kQuality = 95;  // of JPEG

// The range of depth of the map's points around the frame's keyframe.
DepthRange range_of(const Flight& flight, const RoomView& view, int32_t segment) {
  RoomScene scene;
  scene.camera = flight.camera();
  for (const tv_map_point& point : flight.points())
    if (point.segment == segment)
      scene.points.push_back({point.position[0], point.position[1], point.position[2]});
  return depth_range(scene, view);
}

}  // namespace

KeptPictures::KeptPictures(const std::filesystem::path& folder, const std::string& kind,
                           int64_t most_bytes)
    : kind_(kind), most_bytes_(most_bytes) {
  std::string name = (folder / ".pictures.XXXXXX").string();
  file_ = ::mkostemp(name.data(), O_CLOEXEC);
  if (file_ < 0)
    throw BadInput("cannot keep pictures in folder " + folder.string() + ": " +
                   std::strerror(errno));
  ::unlink(name.c_str());
}

KeptPictures::~KeptPictures() { ::close(file_); }

void KeptPictures::keep(const SourceFrame& frame, const Flight& flight) {
  const tv_odometry_state& state = flight.state();
  if (flight.picture().empty() || !state.has_pose) return;
  // Another segment, or the metre: what is known of the depth is in another unit.
  if (state.segment != segment_ || state.scale_source != scale_source_) {
    last_.reset();
    median_depth_ = 0;
    segment_ = state.segment;
    scale_source_ = state.scale_source;
  }
  const FlightFrame& record = flight.frames().back();
  const RoomView view{record.index, record.name, record.live.R, record.live.t};
  if (record.is_keyframe) {
    const DepthRange range = range_of(flight, view, segment_);
    if (range.is_known()) median_depth_ = range.median;
  } else if (last_ && !is_elsewhere(*last_, view, median_depth_)) {
    return;
  }
  last_ = view;
  add(frame);
}

void KeptPictures::add(const SourceFrame& frame) {
  if (!full_.empty()) return;
  const bool has_colour =
      frame.colour.type() == CV_8UC3 && frame.colour.size() == frame.luma.size();
  const std::string bytes = jpeg_bytes(has_colour ? frame.colour : frame.luma, kQuality);
  Kept kept;
  kept.frame = frame;
  kept.frame.luma = kept.frame.colour = cv::Mat();
  kept.at = end_;
  kept.num_bytes = static_cast<int64_t>(bytes.size());
  if (end_ + kept.num_bytes > most_bytes_) {
    full_ = std::to_string(most_bytes_ >> 20) + " MiB are full";
    return;
  }
  for (int64_t done = 0; done < kept.num_bytes;) {
    const ssize_t count = ::pwrite(file_, bytes.data() + done,
                                   static_cast<size_t>(kept.num_bytes - done), end_ + done);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) {
      full_ = count < 0 ? std::strerror(errno) : "the disk is full";
      return;
    }
    done += count;
  }
  end_ += kept.num_bytes;
  kept_[frame.index] = kept;
}

void KeptPictures::run(const Wanted& wanted, const Consumer& consume,
                       const std::atomic<bool>& stop) {
  std::vector<uint8_t> bytes;
  for (const auto& [index, kept] : kept_) {
    if (stop) return;
    if (!wanted(index)) continue;
    bytes.resize(static_cast<size_t>(kept.num_bytes));
    int64_t done = 0;
    while (done < kept.num_bytes) {
      const ssize_t count = ::pread(file_, bytes.data() + done,
                                    static_cast<size_t>(kept.num_bytes - done), kept.at + done);
      if (count < 0 && errno == EINTR) continue;
      if (count <= 0) break;
      done += count;
    }
    SourceFrame frame = kept.frame;
    cv::Mat pixels;
    if (done == kept.num_bytes) pixels = cv::imdecode(bytes, cv::IMREAD_UNCHANGED);
    frame.luma = luma_of(pixels);
    if (pixels.type() == CV_8UC3) frame.colour = pixels;
    if (frame.luma.empty()) frame.problem = frame.name + " cannot be read again";
    if (!consume(frame)) return;
  }
}

std::vector<std::string> KeptPictures::notes() const {
  if (full_.empty()) return {};
  const std::string last =
      kept_.empty() ? "none" : "the last is " + kept_.rbegin()->second.frame.name;
  return {"the room is of the pictures that could be kept in the folder of the results (" + full_ +
          "): " + last};
}

}  // namespace cli
