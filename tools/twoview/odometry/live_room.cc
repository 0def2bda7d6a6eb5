#include "odometry/live_room.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "files/camera_file.h"
#include "files/image_file.h"

namespace cli {
namespace {

// Pictures are kept at this longer side at most, and so many of them: 25 MB of colour.
constexpr int kLongerSide = 640;
constexpr size_t kMostKept = 48;
// A keyframe waits for this many later frames. Kept frames are 0.02 of the median depth apart, so
// the last of them is a fifth of the median depth away: as far as the farthest partners of a
// keyframe.
constexpr size_t kAfter = 10;

cv::Mat small_copy(const cv::Mat& picture, const cv::Size& size, int interpolation) {
  cv::Mat copy;
  if (!picture.empty() && picture.size() != size)
    cv::resize(picture, copy, size, 0, 0, interpolation);
  else
    copy = picture.clone();  // the source uses its memory again
  return copy;
}

// Where a frame is in the last state of the map; null where it is not in that segment.
std::optional<Pose> pose_in(const Flight& flight, const tv_path_frame& frame, int32_t segment) {
  const auto [pose, own] = flight.pose_now(frame);
  if (own != segment) return {};
  return pose;
}

double distance_between(const Pose& a, const Pose& b) {
  return norm({a.t[0] - b.t[0], a.t[1] - b.t[1], a.t[2] - b.t[2]});
}

}  // namespace

void LiveRoom::forget_pictures() { kept_.clear(); }

bool LiveRoom::keep(const Flight& flight) {
  const tv_odometry_state& state = flight.state();
  if (flight.picture().empty() || !state.has_pose || state.status != TV_ODOMETRY_TRACKING)
    return false;
  // Another segment, or the metre: what is known of the depth is in another unit.
  if (state.segment != segment_ || state.scale_source != scale_source_) {
    kept_.clear();
    last_key_.reset();
    median_depth_ = 0;
    segment_ = state.segment;
    scale_source_ = state.scale_source;
  }
  const FlightFrame& frame = flight.frames().back();
  Kept kept;
  kept.known = frame.known;
  kept.view = {frame.index, frame.name, frame.live.R, frame.live.t, false, frame.time_s};
  if (!kept_.empty() && !is_elsewhere(kept_.back().view, kept.view, median_depth_)) return false;
  const cv::Size size = shrunk_size(flight.picture().size(), kLongerSide);
  kept.picture.luma = small_copy(flight.picture(), size, cv::INTER_AREA);
  // A small depth map has an eighth of the pixels.
  const cv::Size half((size.width + 1) / 2, (size.height + 1) / 2);
  if (flight.colour().type() == CV_8UC3)
    kept.picture.colour = small_copy(flight.colour(), half, cv::INTER_NEAREST);
  cv::Mat mask = flight.mask();
  if (!flight.still_mask().empty())
    mask = mask.empty() ? flight.still_mask() : mask & flight.still_mask();
  kept.picture.mask = small_copy(mask, size, cv::INTER_NEAREST);
  kept_.push_back(std::move(kept));
  if (kept_.size() > kMostKept) kept_.pop_front();
  return true;
}

std::vector<PreviewPlace> LiveRoom::places(const Flight& flight, int32_t segment) const {
  std::vector<PreviewPlace> found;
  for (const Placed& placed : placed_) {
    const auto& [key, partner, distance] = placed;
    const auto at = pose_in(flight, key, segment);
    const auto other = pose_in(flight, partner, segment);
    found.emplace_back();
    if (!at || !other) continue;
    found.back() = {true, at->R, at->t, distance_between(*at, *other) / distance};
  }
  return found;
}

std::optional<LiveRoom::Job> LiveRoom::next(const Flight& flight) {
  if (kept_.size() <= kAfter) return {};
  const Kept& candidate = kept_[kept_.size() - 1 - kAfter];
  if (last_key_ && !is_new_beside(*last_key_, candidate.view, median_depth_)) return {};
  last_key_ = candidate.view;
  RoomScene scene;
  scene.camera = flight.camera();
  scene.camera.cx += flight.state().principal_point_shift_px[0];
  scene.camera.cy += flight.state().principal_point_shift_px[1];
  const cv::Size size = candidate.picture.luma.size();
  scene.camera = resized(scene.camera, size.width, size.height);
  std::vector<const Kept*> kept;  // of each view
  size_t key = 0;
  for (const Kept& one : kept_) {
    const auto pose = pose_in(flight, one.known, segment_);
    if (&one == &candidate) {
      if (!pose) return {};
      key = scene.views.size();
    }
    if (!pose) continue;
    scene.views.push_back(one.view);
    scene.views.back().R = pose->R;
    scene.views.back().t = pose->t;
    kept.push_back(&one);
  }
  for (const tv_map_point& point : flight.points())
    if (point.segment == segment_)
      scene.points.push_back({point.position[0], point.position[1], point.position[2]});
  Job job;
  job.key.camera = scene.camera;
  job.key.range = depth_range(scene, scene.views[key]);
  if (!job.key.range.is_known()) return {};
  median_depth_ = job.key.range.median;
  std::vector<size_t> chosen = choose_partners(scene, key, median_depth_);
  if (chosen.empty()) return {};
  chosen.insert(chosen.begin(), key);
  Placed placed{kept[key]->known, {}, 0};
  for (const size_t k : chosen) {
    job.key.views.push_back(scene.views[k]);
    job.key.pictures.push_back(kept[k]->picture);
    const double distance = distance_between({scene.views[key].R, scene.views[key].t},
                                             {scene.views[k].R, scene.views[k].t});
    if (distance <= placed.distance) continue;
    placed.partner = kept[k]->known;
    placed.distance = distance;
  }
  placed_.push_back(placed);
  job.places = places(flight, segment_);
  return job;
}

}  // namespace cli
