#include "odometry/flight.h"

#include <time.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <cstring>
#include <map>
#include <opencv2/core.hpp>
#include <opencv2/imgcodecs.hpp>
#include <set>
#include <tuple>
#include <utility>

#include "base/error.h"
#include "base/upright.h"
#include "files/camera_formats.h"
#include "files/image_file.h"

namespace cli {
namespace {

// CPU time of this thread, in milliseconds: other programs on the machine do not count.
double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

tv_image view_of(const cv::Mat& luma) {
  return {luma.data, luma.cols, luma.rows, static_cast<int64_t>(luma.step)};
}

// The picture scaled down as --resize does.
cv::Mat shrunk(const cv::Mat& luma, int longer) {
  Picture picture;
  picture.luma = picture.colour = luma;
  shrink(picture, longer);
  return picture.luma;
}

Thumbnail thumbnail_of(const cv::Mat& luma) {
  constexpr int kLongerSide = 400;
  const cv::Mat small = shrunk(luma, kLongerSide);
  std::vector<uint8_t> bytes;
  cv::imencode(".jpg", small, bytes, {cv::IMWRITE_JPEG_QUALITY, 75});
  return {small.cols, small.rows, std::string(bytes.begin(), bytes.end())};
}

// The colour of the pixel at (x, y), where the picture may be larger than the one that x and y
// refer to.
Rgb colour_at(const cv::Mat& picture, double scale_x, double scale_y, double x, double y) {
  const int column = static_cast<int>(std::floor((x + 0.5) * scale_x));
  const int row = static_cast<int>(std::floor((y + 0.5) * scale_y));
  const auto& bgr = picture.at<cv::Vec3b>(std::clamp(row, 0, picture.rows - 1),
                                          std::clamp(column, 0, picture.cols - 1));
  return {bgr[2], bgr[1], bgr[0]};
}

// In seconds, as in the library: over a longer pause velocities say no way.
constexpr double kLongestPause_s = 0.25;

Pose pose_of(const double R[9], const double t[3]) {
  Pose pose;
  std::copy(R, R + 9, pose.R.begin());
  std::copy(t, t + 3, pose.t.begin());
  return pose;
}

// Whether a picture is as even as one of a covered or dazzled camera, but for noise.
bool shows_nothing(const cv::Mat& luma) {
  constexpr double kMostNoise = 5;  // grey values, standard deviation
  cv::Scalar mean, sigma;
  cv::meanStdDev(luma, mean, sigma);
  return sigma[0] < kMostNoise;
}

}  // namespace

int count_segments(const std::vector<FlightKeyframe>& keyframes) {
  std::set<int32_t> segments;
  for (const FlightKeyframe& key : keyframes) segments.insert(key.keyframe.segment);
  return static_cast<int>(segments.size());
}

void add_covariances(tv_odometry* odometry, std::vector<FlightKeyframe>& keyframes) {
  for (size_t k = 0; k < keyframes.size(); ++k) {
    int32_t is_known = 0;
    check(tv_odometry_covariance(odometry, static_cast<int32_t>(k), keyframes[k].covariance.data(),
                                 &is_known),
          "keyframe " + std::to_string(k));
    keyframes[k].has_covariance = is_known != 0;
  }
}

void Flight::Free::operator()(void* memory) const { std::free(memory); }

Flight::Flight(FrameSource& source, const FlightOptions& options)
    : source_(source), options_(options) {
  tv_odometry_state_init(&state_);
  if (options.camera_file.empty()) return;
  const CameraFile file = load_camera_file(options.camera_file);
  file_camera_ = file.of("");
  if (!file.note().empty()) notes_.push_back(file.note());
  source.fit(file_camera_);
}

Flight::~Flight() = default;

tv_camera Flight::corrected_file_camera() const {
  tv_camera camera = file_camera_;
  const double scale = static_cast<double>(file_camera_.width) / camera_.width;
  camera.cx += scale * state_.principal_point_shift_px[0];
  camera.cy += scale * state_.principal_point_shift_px[1];
  return camera;
}

bool Flight::wants(int index) const {
  if (index % options_.every != 0) return false;
  return options_.max_frames == 0 || index / options_.every < options_.max_frames;
}

void Flight::prepare(SourceFrame& frame) {
  if (!options_.camera_file.empty())
    require_size(file_camera_, options_.camera_file, frame.luma.cols, frame.luma.rows, frame.name);
  if (odometry_ != nullptr &&
      (frame.luma.cols != file_camera_.width || frame.luma.rows != file_camera_.height))
    throw BadInput("frame " + frame.name + " is " + std::to_string(frame.luma.cols) + "x" +
                   std::to_string(frame.luma.rows) + ", not " + std::to_string(file_camera_.width) +
                   "x" + std::to_string(file_camera_.height) + " as the first one");
  mask_ =
      shrunk_mask(options_.masks.of(frame.name, frame.luma.cols, frame.luma.rows), options_.resize);
  frame.luma = shrunk(frame.luma, options_.resize);
}

void Flight::start(const SourceFrame& first) {
  SourceFrame frame = first;
  if (options_.camera) {
    file_camera_ = *options_.camera;
  } else if (options_.focal_35mm > 0) {
    file_camera_ =
        film_camera(options_.focal_35mm, frame.luma.cols, frame.luma.rows, source_.pixel_aspect());
  } else if (options_.camera_file.empty()) {
    const auto camera = source_.camera(frame, frame.luma.cols, frame.luma.rows);
    if (!camera)
      throw BadInput("--camera is required, or " + focal_option(frame.exif) + ": " +
                     source_.kind() + " does not describe its camera");
    file_camera_ = *camera;
  } else {
    const int width = frame.luma.cols, height = frame.luma.rows;
    const std::string note = scaled_note(file_camera_, options_.camera_file, width, height);
    file_camera_ = fitted(file_camera_, options_.camera_file, width, height, frame.name,
                          options_.scales_camera);
    if (!note.empty()) notes_.push_back(note);
  }
  prepare(frame);
  camera_ = resized(file_camera_, frame.luma.cols, frame.luma.rows);
  const tv_odometry_options& options = options_.odometry;
  check(tv_odometry_size(&camera_, &options, &context_bytes_), "cannot track these frames");
  const size_t unit = TV_CONTEXT_ALIGNMENT;
  memory_.reset(std::aligned_alloc(unit, (context_bytes_ + unit - 1) / unit * unit));
  if (!memory_)
    throw BadInput("not enough memory: the odometry needs " +
                   std::to_string((context_bytes_ >> 20) + 1) + " MiB");
  const tv_status status =
      tv_odometry_init(&odometry_, &camera_, &options, memory_.get(), context_bytes_);
  if (status == TV_ERR_KERNELS)
    check(status,
          std::string("--kernels ") + tv_kernels_string(static_cast<tv_kernels>(options.kernels)));
  check(status, "cannot start the odometry");
}

void Flight::track(const std::atomic<bool>& stop,
                   const std::function<void(const SourceFrame&)>& after_frame) {
  const auto wanted = [this](int index) { return wants(index); };
  const auto consume = [&](const SourceFrame& frame) {
    track_frame(frame);
    if (after_frame) after_frame(frame);
    picture_.release();
    colour_.release();
    const int next = frame.index / options_.every + 1;
    return options_.max_frames == 0 || next < options_.max_frames;
  };
  source_.run(wanted, consume, stop);
}

void Flight::tell_source() {
  std::optional<std::array<double, 12>> previous;
  if (told_ && told_->has_pose && state_.has_pose && told_->segment == state_.segment) {
    std::array<double, 12> pose{};
    int32_t segment = -1;
    if (tv_odometry_pose_of(odometry_, told_->reference_id, told_->reference_from_cam_R,
                            told_->reference_from_cam_t, pose.data(), pose.data() + 9,
                            &segment) == TV_OK &&
        segment == state_.segment)
      previous = pose;
  }
  source_.found(state_, previous);
  told_ = state_;
}

// The tracker takes the turn since the frame that it was given before.
void Flight::add_turn(const SourceFrame& frame) {
  if (!frame.previous_from_cam) {
    turn_.reset();
    return;
  }
  if (!turn_) return;
  turn_->previous_from_cam = product(turn_->previous_from_cam, *frame.previous_from_cam);
  turn_->sigma_rad = std::hypot(turn_->sigma_rad, frame.turn_sigma_rad);
}

void Flight::track_frame(SourceFrame frame) {
  const bool is_first = odometry_ == nullptr;
  FlightFrame record;
  record.index = frame.index;
  record.name = frame.name;
  record.time_s = frame.time_s;
  add_turn(frame);
  try {
    if (frame.luma.empty()) throw BadInput(frame.problem);
    if (is_first) start(frame);
    prepare(frame);
  } catch (const BadInput& e) {
    // A picture that does not decode is a missing frame, also the first one. Where the first
    // picture does not fit the camera none will, and the source is refused.
    if (is_first && !frame.luma.empty()) throw;
    if (num_unreadable_++ == 0) first_problem_ = e.what();
    record.unreadable = true;
    record.status = lost_status();
    gap_ = true;
    frames_.push_back(record);
    return;
  }
  // A picture that shows nothing is none that was stored twice: the tracker turns on by the gyro.
  if (!(turn_ && shows_nothing(frame.luma)) && repeated_.is_repeated(frame.luma, frames_.size())) {
    record.withheld = true;
    record.status = lost_status();
    frames_.push_back(record);
    return;
  }
  // Over a longer pause the motion is not predicted.
  if (!given_.empty() && frames_.back().withheld)
    gap_ = gap_ || frame.time_s - frames_[given_.back()].time_s > kLongestPause_s;
  give(frame, record);
  // What a vehicle waits for comes before what only the report needs.
  if (source_.wants_found()) tell_source();
  eyes_.add(frame.luma);
  combed_rows_.add(frame.luma);
  picture_ = frame.luma;
  colour_ = frame.colour;
  if (record.is_keyframe && options_.keeps_pictures)
    thumbnails_[static_cast<int>(given_.size())] = thumbnail_of(frame.luma);
  if (record.is_keyframe) keep_colours(frame);
  masked_ += cli::masked_share(mask_);
  given_.push_back(frames_.size());
  frames_.push_back(record);
}

int32_t Flight::lost_status() const {
  return state_.status == TV_ODOMETRY_STARTING ? TV_ODOMETRY_STARTING : TV_ODOMETRY_LOST;
}

void Flight::give(const SourceFrame& frame, FlightFrame& record) {
  tv_odometry_frame input;
  tv_odometry_frame_init(&input);
  input.gap = frame.gap || gap_ ? 1 : 0;
  input.image = view_of(frame.luma);
  if (!mask_.empty()) input.mask = view_of(mask_);
  input.time_s = frame.time_s;
  if (frame.world_from_cam) {
    std::copy(frame.world_from_cam->begin(), frame.world_from_cam->end(), input.world_from_cam);
    input.attitude_sigma_rad = frame.attitude_sigma_rad;
  }
  if (frame.height_m) {
    input.height_m = *frame.height_m;
    input.height_sigma_m = frame.height_sigma_m;
  }
  if (frame.velocity_m_s) {
    std::copy(frame.velocity_m_s->begin(), frame.velocity_m_s->end(), input.velocity_m_s);
    input.velocity_sigma_m_s = frame.velocity_sigma_m_s;
  }
  if (turn_) {
    const Matrix3& turn = turn_->previous_from_cam;
    std::copy(turn.begin(), turn.end(), input.previous_from_cam);
    input.turn_sigma_rad = turn_->sigma_rad;
  }
  turn_ = Turn{};
  const double before = cpu_ms();
  check(tv_odometry_track(odometry_, &input, &state_), "frame " + frame.name);
  record.time_ms = cpu_ms() - before;
  gap_ = false;
  add_still_mask();
  check(tv_path_record(&state_, frame.time_s, &record.known), "frame " + frame.name);
  record.status = state_.status;
  record.reasons = state_.reasons;
  record.map_reasons = state_.map_reasons;
  record.is_keyframe = state_.is_keyframe != 0;
  record.relocated = state_.relocated != 0;
  record.loop_closed = state_.loop_closed != 0;
  record.attitude_ignored = state_.attitude_ignored != 0;
  record.attitude = frame.world_from_cam;
  record.num_keypoints = state_.num_keypoints;
  record.num_matches = state_.num_matches;
  record.num_inliers = state_.num_inliers;
  if (state_.has_pose) {
    record.live_segment = state_.segment;
    record.live_metric = state_.scale_source != TV_SCALE_UNIT;
    record.live_scale_sigma = state_.scale_sigma;
    record.live = pose_of(state_.world_from_cam_R, state_.world_from_cam_t);
  }
}

std::optional<Vector3> Flight::down(int32_t segment) const {
  DownSum sum;
  for (const FlightFrame& frame : frames_) {
    if (!frame.attitude || frame.attitude_ignored) continue;
    if (frame.origin != PoseOrigin::kNone && frame.segment == segment)
      sum.add(frame.pose.R, *frame.attitude);
    else if (frame.origin == PoseOrigin::kNone && frame.live_segment == segment)
      sum.add(frame.live.R, *frame.attitude);
  }
  return sum.down();
}

// A point is made of keypoints of a keyframe now or later, so all of them keep their colour.
void Flight::keep_colours(const SourceFrame& frame) {
  if (frame.colour.type() != CV_8UC3 || frame.colour.empty()) return;
  std::vector<tv_map_observation> seen(static_cast<size_t>(options_.odometry.max_keypoints));
  int32_t count = 0;
  check(tv_odometry_last_frame(odometry_, seen.data(), static_cast<int32_t>(seen.size()), &count),
        "frame " + frame.name);
  const double scale_x = static_cast<double>(frame.colour.cols) / frame.luma.cols;
  const double scale_y = static_cast<double>(frame.colour.rows) / frame.luma.rows;
  std::vector<Rgb> colours(static_cast<size_t>(count));
  bool is_grey = true;
  for (size_t k = 0; k < colours.size(); ++k) {
    colours[k] = colour_at(frame.colour, scale_x, scale_y, static_cast<double>(seen[k].x),
                           static_cast<double>(seen[k].y));
    is_grey = is_grey && colours[k][0] == colours[k][1] && colours[k][1] == colours[k][2];
  }
  // The points of a grey picture have the map's own grey levels, which are between pixels.
  if (!is_grey) colours_[static_cast<int>(given_.size())] = std::move(colours);
}

void Flight::add_still_mask() {
  if (!(state_.still_share > 0)) return;
  cv::Mat mask(camera_.height, camera_.width, CV_8U);
  check(tv_odometry_still_mask(odometry_, mask.data, mask.total()), "the mask");
  if (still_mask_.empty())
    still_mask_ = mask;
  else
    still_mask_ &= mask;
}

void Flight::finish(const std::atomic<bool>& stop) {
  if (odometry_ == nullptr) return;
  check(tv_odometry_finish(odometry_), "the map");
  check(tv_odometry_camera(odometry_, &camera_), "the camera");
  for (FlightFrame& frame : frames_) {
    const auto [pose, segment] = pose_now(frame.known);
    if (segment < 0) continue;  // also where its segment was wrong, and was removed
    frame.pose = pose;
    frame.segment = segment;
    frame.origin = PoseOrigin::kTracked;
  }
  std::map<int, size_t> missing;       // the source's index and the number of the given frame
  std::map<int, int> without_picture;  // the same
  const std::vector<FlightKeyframe> keyframes = this->keyframes();
  for (const FlightKeyframe& key : keyframes) {
    FlightFrame& frame = frames_[index_given(key.keyframe.frame)];
    frame.is_keyframe = true;
    if (thumbnail(key.keyframe.frame) == nullptr) without_picture[frame.index] = key.keyframe.frame;
  }
  settle_repeated();
  if (!source_.can_run_again() || keyframes.empty()) return;
  std::vector<tv_path_frame> path;
  for (size_t number = 0; number < given_.size(); ++number) {
    const FlightFrame& frame = frames_[given_[number]];
    path.push_back(frame.known);
    // A frame that was followed by its turn alone has the position of the frame before it.
    const bool is_known = frame.origin != PoseOrigin::kNone && frame.status != TV_ODOMETRY_ROTATION;
    if (!is_known && !frame.is_repeated) missing[frame.index] = number;
    if (frame.is_repeated) path.back().origin = TV_PATH_UNKNOWN;
  }
  int last = missing.empty() ? -1 : missing.rbegin()->first;
  if (!without_picture.empty()) last = std::max(last, without_picture.rbegin()->first);
  if (last < 0) return;
  const auto wanted = [&](int index) {
    return missing.count(index) != 0 || without_picture.count(index) != 0;
  };
  const auto consume = [&](const SourceFrame& frame) {
    const auto picture = without_picture.find(frame.index);
    if (picture != without_picture.end() && !frame.luma.empty())
      thumbnails_[picture->second] = thumbnail_of(frame.luma);
    const auto found = missing.find(frame.index);
    if (found != missing.end() && !frame.luma.empty()) locate(frame, path, found->second);
    return frame.index < last;
  };
  source_.run(wanted, consume, stop);
  settle_waited();
}

void Flight::settle_repeated() {
  repeated_.end();
  for (const size_t n : repeated_.stood()) {
    frames_[n].is_repeated = true;
    frames_[n].origin = PoseOrigin::kNone;
    frames_[n].segment = -1;
  }
  settle_waited();
}

// Gives a frame that was withheld because the camera stood still the pose and the status of the
// frame before it.
void Flight::settle_waited() {
  for (const size_t n : repeated_.waited()) {
    FlightFrame& frame = frames_[n];
    if (!frame.withheld) continue;
    const FlightFrame& before = frames_[n - 1];
    frame.status = before.status;
    frame.reasons = before.reasons;
    frame.map_reasons = before.map_reasons;
    frame.origin = before.origin;
    frame.segment = before.segment;
    frame.pose = before.pose;
  }
}

std::string Flight::repeated_note() const {
  if (repeated_.stood().empty()) return "";
  const size_t count = repeated_.stood().size();
  return std::to_string(count) + (count == 1 ? " picture is" : " pictures are") +
         " the one before again, the first " + frames_[repeated_.stood()[0]].name +
         ", while the camera moved: a film or a stream that stood or was filled up; " +
         (count == 1 ? "it has" : "they have") + " no pose";
}

void Flight::locate(SourceFrame frame, std::vector<tv_path_frame>& path, size_t number) {
  try {
    prepare(frame);
  } catch (const BadInput&) {
    return;
  }
  const tv_image image = view_of(frame.luma), mask = view_of(mask_);
  int32_t is_found = 0;
  check(tv_path_locate(odometry_, path.data(), static_cast<int32_t>(path.size()),
                       static_cast<int32_t>(number), &image, &mask, &is_found),
        "frame " + frame.name);
  if (is_found == 0) return;
  FlightFrame& record = frames_[given_[number]];
  std::tie(record.pose, record.segment) = pose_now(path[number]);
  record.origin = PoseOrigin::kLocated;
}

std::pair<Pose, int32_t> Flight::pose_now(const tv_path_frame& frame) const {
  tv_path_pose now;
  check(tv_path_poses(odometry_, &frame, 1, &now), "the path");
  return {pose_of(now.world_from_cam_R, now.world_from_cam_t), now.segment};
}

const Thumbnail* Flight::thumbnail(int number) const {
  const auto found = thumbnails_.find(number);
  return found == thumbnails_.end() ? nullptr : &found->second;
}

namespace {

std::vector<tv_map_observation> observations_of(const tv_odometry* odometry, int32_t idx,
                                                int32_t max_keypoints) {
  std::vector<tv_map_observation> seen(static_cast<size_t>(max_keypoints));
  int32_t count = 0;
  check(tv_odometry_observations(odometry, idx, seen.data(), max_keypoints, &count),
        "keyframe " + std::to_string(idx));
  return {seen.begin(), seen.begin() + count};
}

// All keyframes, without what they see.
std::vector<FlightKeyframe> poses_of(const tv_odometry* odometry) {
  std::vector<FlightKeyframe> keyframes;
  FlightKeyframe key;
  tv_keyframe_init(&key.keyframe);
  for (int32_t idx = 0; tv_odometry_keyframe(odometry, idx, &key.keyframe) == TV_OK; ++idx)
    keyframes.push_back(key);
  return keyframes;
}

}  // namespace

std::vector<FlightKeyframe> keyframes_of(const tv_odometry* odometry, int32_t max_keypoints) {
  std::vector<FlightKeyframe> keyframes = poses_of(odometry);
  for (size_t k = 0; k < keyframes.size(); ++k)
    keyframes[k].observations = observations_of(odometry, static_cast<int32_t>(k), max_keypoints);
  return keyframes;
}

bool Flight::ended_tracked() const {
  if (frames_.empty()) return false;
  auto last = frames_.rbegin();
  while (last->withheld && std::next(last) != frames_.rend()) ++last;
  return !last->unreadable && last->live_segment >= 0;
}

std::vector<FlightKeyframe> Flight::keyframes() const {
  return odometry_ ? keyframes_of(odometry_, options_.odometry.max_keypoints)
                   : std::vector<FlightKeyframe>();
}

std::vector<FlightKeyframe> Flight::keyframe_poses() const {
  return odometry_ ? poses_of(odometry_) : std::vector<FlightKeyframe>();
}

std::vector<std::pair<tv_map_observation, Rgb>> Flight::coloured(int32_t idx) const {
  FlightKeyframe key;
  tv_keyframe_init(&key.keyframe);
  check(tv_odometry_keyframe(odometry_, idx, &key.keyframe), "keyframe " + std::to_string(idx));
  key.observations = observations_of(odometry_, idx, options_.odometry.max_keypoints);
  return coloured(key);
}

std::vector<std::pair<tv_map_observation, Rgb>> Flight::coloured(const FlightKeyframe& key) const {
  std::vector<std::pair<tv_map_observation, Rgb>> found;
  const auto kept = colours_.find(key.keyframe.frame);
  if (kept == colours_.end()) return found;
  for (const tv_map_observation& seen : key.observations) {
    const auto keypoint = static_cast<size_t>(seen.idx_keypoint);
    if (seen.idx_point >= 0 && keypoint < kept->second.size())
      found.emplace_back(seen, kept->second[keypoint]);
  }
  return found;
}

std::vector<tv_map_point> Flight::points() const {
  std::vector<tv_map_point> points(odometry_ ? static_cast<size_t>(options_.odometry.max_points)
                                             : 0);
  if (!odometry_) return points;
  int32_t count = 0;
  check(tv_odometry_points(odometry_, points.data(), options_.odometry.max_points, &count),
        "the map's points");
  points.resize(static_cast<size_t>(count));
  return points;
}

std::vector<Rgb> greys_of(const std::vector<tv_map_point>& points) {
  std::vector<Rgb> greys;
  greys.reserve(points.size());
  for (const tv_map_point& point : points) {
    const auto grey = static_cast<uint8_t>(std::clamp(point.grey, 0, 255));
    greys.push_back({grey, grey, grey});
  }
  return greys;
}

std::vector<Rgb> Flight::colours(const std::vector<tv_map_point>& points,
                                 const std::vector<FlightKeyframe>& keyframes) const {
  std::vector<Rgb> colours = greys_of(points);
  for (const FlightKeyframe& key : keyframes)  // the newest comes last
    for (const auto& [seen, rgb] : coloured(key))
      colours[static_cast<size_t>(seen.idx_point)] = rgb;
  return colours;
}

std::string Flight::map_bytes() const {
  if (!odometry_) return "";
  size_t size = 0;
  check(tv_odometry_save_size(odometry_, &size), "the map");
  std::string bytes(size, '\0');
  check(tv_odometry_save(odometry_, reinterpret_cast<uint8_t*>(bytes.data()), size, &size),
        "the map");
  bytes.resize(size);
  return bytes;
}

}  // namespace cli
