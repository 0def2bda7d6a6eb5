// The pictures of a live source that a room needs after the flight: those of keyframes, and those
// from which a keyframe may be compared.
#pragma once

#include <filesystem>
#include <map>
#include <optional>
#include <string>
#include <vector>

#include "odometry/flight.h"
#include "odometry/frames.h"
#include "room_model/scene.h"

namespace cli {

// As a source: the frames that were kept. They lie in a file without a name, which the system
// removes however the program ends.
class KeptPictures : public FrameSource {
 public:
  static constexpr int64_t kMostBytes = int64_t{2} << 30;

  // In the file system of the folder. kind: the live source's. Throws BadInput.
  KeptPictures(const std::filesystem::path& folder, const std::string& kind,
               int64_t most_bytes = kMostBytes);
  ~KeptPictures() override;
  KeptPictures(const KeptPictures&) = delete;
  KeptPictures& operator=(const KeptPictures&) = delete;

  // Keeps the frame that was tracked last where a room may need it; within after_frame of
  // Flight::track.
  void keep(const SourceFrame& frame, const Flight& flight);
  // Keeps a frame. Once there is no space for one, no later one is kept.
  void add(const SourceFrame& frame);
  bool has(int index) const { return kept_.count(index) != 0; }

  void run(const Wanted& wanted, const Consumer& consume, const std::atomic<bool>& stop) override;
  bool can_run_again() const override { return true; }
  int num_frames() const override { return static_cast<int>(kept_.size()); }
  std::string kind() const override { return kind_; }
  std::vector<std::string> notes() const override;

 private:
  struct Kept {
    SourceFrame frame;  // without its pixels
    int64_t at = 0, num_bytes = 0;
  };

  std::string kind_;
  int64_t most_bytes_;
  int file_ = -1;
  int64_t end_ = 0;
  std::map<int, Kept> kept_;  // by the frame's index
  std::string full_;          // why no more are kept; empty: they are
  std::optional<RoomView> last_;
  double median_depth_ = 0;  // of the newest keyframe; 0: not known
  int32_t segment_ = -1, scale_source_ = -1;
};

}  // namespace cli
