// Which frames of a flight that is under way show its live page's room, and where they are now.
#pragma once

#include <deque>
#include <optional>
#include <vector>

#include "odometry/flight.h"
#include "room_model/preview.h"

namespace cli {

class LiveRoom {
 public:
  struct Job {
    PreviewKey key;
    std::vector<PreviewPlace> places;  // of all keyframes of the room, this one included
  };

  // Keeps the frame that was tracked last where it was tracked well and from a new place. Returns
  // whether it did.
  bool keep(const Flight& flight);
  // The next keyframe of the room with its partners, once frames before and after it are kept and
  // it shows something new.
  std::optional<Job> next(const Flight& flight);
  // Forgets the kept pictures: after frames that were not kept they are of too long ago.
  void forget_pictures();

 private:
  struct Kept {
    tv_path_frame known;
    RoomView view;  // as it was when the frame was tracked
    RoomPicture picture;
  };
  // A keyframe of the room, and the partner that is farthest from it.
  struct Placed {
    tv_path_frame key, partner;
    double distance = 0;  // between both when the depth map was made
  };

  std::vector<PreviewPlace> places(const Flight& flight, int32_t segment) const;

  std::deque<Kept> kept_;  // the newest last
  std::vector<Placed> placed_;
  std::optional<RoomView> last_key_;
  double median_depth_ = 0;  // of the newest keyframe; 0: not known
  int32_t segment_ = -1, scale_source_ = -1;
};

}  // namespace cli
