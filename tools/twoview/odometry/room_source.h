// What a room is made from, read from the disk: a source of frames and the poses of its frames.
#pragma once

#include <map>
#include <memory>
#include <string>
#include <vector>

#include "files/mask_file.h"
#include "odometry/frames.h"
#include "odometry/outputs.h"
#include "odometry/room_truth.h"
#include "room_model/builder.h"

namespace cli {

// Frames of a source that have a pose, as the scene that they show.
struct RoomSource {
  std::unique_ptr<FrameSource> source;
  RoomScene scene;
  Masks masks;                  // of the source's pictures
  cv::Mat still;                // what stands still in all of them, 0; may be empty
  std::string name;             // of the source, for people
  std::string given;            // as the user or result.json names it
  std::string truth_file;       // of true poses, that result.json names; empty: none
  bool has_true_poses = false;  // the poses are given ones, which a truth is in the frame of
  std::string poses_file;       // that the poses are of
  TruePoses::Order quaternion_order = TruePoses::Order::kKnown;  // of that file
  std::vector<std::string> files;  // that were read, which no output may replace
  std::vector<std::string> notes;
};

// What `twoview odometry` wrote into `folder`. moved_to: where its source lies now; empty: where
// its result.json says. Throws BadInput.
RoomSource room_source_of_flight(const std::string& folder, const std::string& moved_to);

// A folder of frames, or a film, with the poses of a file (TUM, EuRoC or KITTI, world_from_cam).
// camera: a file; empty: what the source says of it. fps: of images without times, 0: not given.
RoomSource room_source_of_poses(const std::string& source, const std::string& poses,
                                const std::string& camera, double fps);

// A model of COLMAP as text (cameras.txt, images.txt, points3D.txt) of one camera, and the folder
// of its pictures.
RoomSource room_source_of_colmap(const std::string& model, const std::string& pictures);

// The true poses of the source's frames: of `file`, else those that the source knows, else none.
TruePath true_path(const RoomSource& from, const std::string& file);

// Matches pictures of the scene's views, from first_view on and at most most_pictures of them.
// Throws BadInput where the matches contradict the poses, and says under which reading the poses
// would fit. Finds points for a scene without any.
void add_posed_points(RoomSource& from, size_t first_view, size_t most_pictures,
                      const std::atomic<bool>& stop);

// The scene of a flight that has just ended: its longest segment.
RoomScene room_scene(const FlightResult& result);

// Gives the builder the pictures that it needs, until `stop` is set. tracked_still: as in
// RoomSource, of the size at which the frames were tracked. `after_picture` may be empty.
// Throws BadInput where none of the pictures could be used.
void read_room_pictures(FrameSource& source, const Masks& masks, const cv::Mat& tracked_still,
                        RoomBuilder& builder, const std::atomic<bool>& stop,
                        const std::function<void()>& after_picture);

}  // namespace cli
