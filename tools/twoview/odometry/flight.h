// A source's frames through the library's odometry: the tracker with its memory, and what is known
// of each frame while the flight lasts and in the last state of the map.
#pragma once

#include <array>
#include <cstdint>
#include <functional>
#include <map>
#include <memory>
#include <optional>
#include <string>
#include <vector>

#include "files/mask_file.h"
#include "odometry/combed_rows.h"
#include "odometry/flight_frame.h"
#include "odometry/frames.h"
#include "odometry/poses.h"
#include "odometry/repeated_pictures.h"
#include "odometry/two_eyes.h"
#include "twoview/odometry.h"

namespace cli {

// A keyframe with what it sees, and its frame.
struct FlightKeyframe {
  tv_keyframe keyframe;
  std::vector<tv_map_observation> observations;
  // The covariance of the pose relative to the keyframe before it, as tv_odometry_covariance gives
  // it; set by add_covariances.
  bool has_covariance = false;
  std::array<double, 36> covariance{};
};

// The grey levels of points as colours.
std::vector<std::array<uint8_t, 3>> greys_of(const std::vector<tv_map_point>& points);

// The keyframes of a map in their order. max_keypoints: the odometry's own.
std::vector<FlightKeyframe> keyframes_of(const tv_odometry* odometry, int32_t max_keypoints);

// How many segments the keyframes are in: fewer than were begun where some were joined or removed.
int count_segments(const std::vector<FlightKeyframe>& keyframes);

// Fills the covariances of the keyframes, which must be those of the odometry's whole map, in
// order. Each takes about as long as an adjustment.
void add_covariances(tv_odometry* odometry, std::vector<FlightKeyframe>& keyframes);

using Rgb = std::array<uint8_t, 3>;

// A small picture of a keyframe, for the report.
struct Thumbnail {
  int width = 0, height = 0;  // pixels
  std::string jpeg;
};

struct FlightOptions {
  tv_odometry_options odometry;
  int max_frames = 0;  // 0: all
  int every = 1;
  int resize = 0;  // longer side, pixels; 0: as they are
  Masks masks;
  bool scales_camera = false;       // whether camera_file may be for another size of the picture
  std::string camera_file;          // empty: the source's own camera, or
  double focal_35mm = 0;            // a pinhole's of this focal length, millimetres; 0: none
  std::optional<tv_camera> camera;  // of the source's frames, in place of all these
  bool keeps_pictures = true;       // for the report
};

class Flight {
 public:
  Flight(FrameSource& source, const FlightOptions& options);
  ~Flight();
  Flight(const Flight&) = delete;
  Flight& operator=(const Flight&) = delete;

  // Tracks the source's frames until its end or until `stop` is set. after_frame gets each of them
  // as the source gave it, and may be empty. Throws BadInput where the first frame cannot be used.
  void track(const std::atomic<bool>& stop,
             const std::function<void(const SourceFrame&)>& after_frame);
  // Fills the frames' final poses: of tracked frames from the map, of the others, where the source
  // can be read again, by looking for them in the map.
  void finish(const std::atomic<bool>& stop);

  const std::vector<FlightFrame>& frames() const { return frames_; }
  // The frame with this number among those that were given to the tracker. Unreadable and repeated
  // frames are not given to it and are not counted.
  const FlightFrame& given(int number) const {
    return frames_[given_[static_cast<size_t>(number)]];
  }
  // The pose of a frame in the last state of the map, and its segment, -1 where it has none.
  std::pair<Pose, int32_t> pose_now(const tv_path_frame& frame) const;
  size_t index_given(int number) const { return given_[static_cast<size_t>(number)]; }
  // The picture of a frame that was given and became a keyframe; null for other frames.
  const Thumbnail* thumbnail(int number) const;
  // The picture of the last frame, as it was tracked; only within `after_frame` of track(), and
  // empty for a frame that could not be used.
  const cv::Mat& picture() const { return picture_; }
  // The colours, BGR, of the picture, of the size of the source's frames, and its mask, of the size
  // of picture(). Both may be empty, and both are valid only within `after_frame`.
  const cv::Mat& colour() const { return colour_; }
  const cv::Mat& mask() const { return mask_; }
  // The direction down in a segment of the map by the attitudes of its frames; null where none was
  // given. It is the z axis where the segment began with an attitude.
  std::optional<Vector3> down(int32_t segment) const;
  // By how much a viewer turns the frames clockwise, degrees.
  int turn_deg() const { return source_.turn_deg(); }
  const tv_odometry_state& state() const { return state_; }
  // Notes about the camera file: which entries were left out, and whether the camera was scaled.
  const std::vector<std::string>& notes() const { return notes_; }
  // As frames are tracked; after finish() with the principal point as the odometry has moved it.
  const tv_camera& camera() const { return camera_; }
  // The camera of the frames as the source gives them, before they are scaled down.
  const tv_camera& file_camera() const { return file_camera_; }
  // file_camera() with the principal point as the odometry has moved it.
  tv_camera corrected_file_camera() const;
  bool has_corrected_camera() const {
    return state_.principal_point_shift_px[0] != 0 || state_.principal_point_shift_px[1] != 0;
  }
  size_t context_bytes() const { return context_bytes_; }
  // The mean share of the frames that masks have left out; 0 without masks.
  double masked_share() const {
    return given_.empty() ? 0 : masked_ / static_cast<double>(given_.size());
  }
  // Of all pixels that were found to stand still while the scene moved, in any frame: 0 in a
  // picture of 255, of the frames' size as they are tracked; empty where there were none.
  const cv::Mat& still_mask() const { return still_mask_; }
  const Masks& masks() const { return options_.masks; }
  const std::vector<std::string>& mask_files() const { return options_.masks.files(); }
  int num_unreadable() const { return num_unreadable_; }
  // Pictures that the source gave again while the camera moved on. After finish().
  int num_repeated() const { return static_cast<int>(repeated_.stood().size()); }
  // A line about the repeated pictures; empty where there are none.
  std::string repeated_note() const;
  // Whether the pictures are of two eyes, so that no camera describes them.
  const TwoEyes& eyes() const { return eyes_; }
  const CombedRows& combed_rows() const { return combed_rows_; }
  const std::string& first_problem() const { return first_problem_; }
  // Whether the source ended before its frames could be tracked to the end, or --max-frames did.
  bool ended_tracked() const;

  // The map as it is. The index of a point in points() is that of the observations.
  std::vector<FlightKeyframe> keyframes() const;
  // The keyframes without their observations.
  std::vector<FlightKeyframe> keyframe_poses() const;
  std::vector<tv_map_point> points() const;
  // The points that a keyframe of the map sees (by its number, or as keyframes() gives it), each
  // with the colour of its pixel. Empty where the picture had none.
  std::vector<std::pair<tv_map_observation, Rgb>> coloured(int32_t idx) const;
  std::vector<std::pair<tv_map_observation, Rgb>> coloured(const FlightKeyframe& key) const;
  // For each of these points of the map the colour of its pixel in the newest of these keyframes
  // that sees it and whose picture had colours; else its grey level.
  std::vector<Rgb> colours(const std::vector<tv_map_point>& points,
                           const std::vector<FlightKeyframe>& keyframes) const;
  std::string map_bytes() const;
  tv_odometry* odometry() const { return odometry_; }

 private:
  bool wants(int index) const;
  // Scales the frame and its mask, which is put into mask_, down; throws BadInput where it does not
  // fit the camera.
  void prepare(SourceFrame& frame);
  void start(const SourceFrame& frame);
  void add_turn(const SourceFrame& frame);
  void track_frame(SourceFrame frame);
  // The status of a frame that is not given to the tracker.
  int32_t lost_status() const;
  // Gives the frame to the tracker; record then has what is known of it.
  void give(const SourceFrame& frame, FlightFrame& record);
  // Once the pictures after a repeated one have come: decides whether the camera moved on
  // meanwhile.
  void settle_repeated();
  void settle_waited();
  // Reports to the source what the tracker found for the last frame that was given to it.
  void tell_source();
  void add_still_mask();
  void keep_colours(const SourceFrame& frame);
  // Looks for the frame that was given after `number` others in the finished map.
  void locate(SourceFrame frame, std::vector<tv_path_frame>& path, size_t number);

  FrameSource& source_;
  FlightOptions options_;
  std::vector<std::string> notes_;
  cv::Mat mask_;                        // of the frame
  tv_camera file_camera_{}, camera_{};  // of the frames' files, and as they are tracked
  struct Free {
    void operator()(void* memory) const;
  };
  std::unique_ptr<void, Free> memory_;
  size_t context_bytes_ = 0;
  tv_odometry* odometry_ = nullptr;
  tv_odometry_state state_;
  std::optional<tv_odometry_state> told_;  // the last one that was passed to the source
  std::vector<FlightFrame> frames_;
  cv::Mat picture_, colour_;  // of the frame
  cv::Mat still_mask_;
  double masked_ = 0;                    // sum of the shares that masks have left out
  std::vector<size_t> given_;            // indices of frames_
  std::map<int, Thumbnail> thumbnails_;  // by the number of the frame that was given
  // The colours of the keypoints of the frames that were given and became keyframes.
  std::map<int, std::vector<Rgb>> colours_;
  struct Turn {
    Matrix3 previous_from_cam{1, 0, 0, 0, 1, 0, 0, 0, 1};
    double sigma_rad = 0;
  };
  std::optional<Turn> turn_;  // since the frame that was given before; empty: not known
  bool gap_ = false;          // a frame was left out before the next one
  RepeatedPictures repeated_;
  TwoEyes eyes_;
  CombedRows combed_rows_;
  int num_unreadable_ = 0;
  std::string first_problem_;
};

}  // namespace cli
