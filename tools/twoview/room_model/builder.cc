#include "room_model/builder.h"

#include <time.h>

#include <algorithm>
#include <cmath>

#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "base/median.h"
#include "base/upright.h"
#include "files/camera_file.h"
#include "files/image_file.h"
#include "room_model/axes.h"
#include "room_model/plan.h"

namespace cli {
namespace {

// The side of a voxel as a share of the median depth: 3 cm at 2.5 m, about three pixels of a depth
// map.
constexpr double kVoxelShare = 0.012;
// Maps are fused so many voxels before and behind their surface: three of their standard
// deviations, 1.8 % of the depth in the median.
constexpr int32_t kTruncationVoxels = 5;
constexpr int32_t kFewestMaps = 2;  // that must have seen a surface, where there are two at all
// Surface of a larger standard deviation is left out, in voxels: 1.8 % of the median depth. With
// one voxel rendered flights gain, and real sequences lose more (docs/algorithms/room.md).
constexpr double kMostSigmaVoxels = 1.5;

// CPU time of this thread, in milliseconds: other programs on the machine do not count.
double cpu_ms() {
  timespec time{};
  clock_gettime(CLOCK_THREAD_CPUTIME_ID, &time);
  return 1e3 * static_cast<double>(time.tv_sec) + 1e-6 * static_cast<double>(time.tv_nsec);
}

// The number rounded to two digits, as scenes state the size of a voxel that fits them.
double two_digits(double value) {
  const double unit = std::pow(10.0, std::floor(std::log10(value)) - 1);
  return std::round(value / unit) * unit;
}

// Pictures are kept and compared at this longer side at most: three times that of a depth map.
constexpr int kLongerSide = 960;

RoomScene with_small_pictures(RoomScene scene) {
  const cv::Size size = shrunk_size({scene.camera.width, scene.camera.height}, kLongerSide);
  scene.camera = resized(scene.camera, size.width, size.height);
  return scene;
}

// The picture at the size of this camera, in memory of its own.
cv::Mat small_copy(const cv::Mat& picture, const tv_camera& camera, int interpolation) {
  const cv::Size size(camera.width, camera.height);
  cv::Mat copy;
  if (picture.empty() || picture.size() == size)
    copy = picture.clone();
  else
    cv::resize(picture, copy, size, 0, 0, interpolation);
  return copy;
}

}  // namespace

RoomBuilder::RoomBuilder(RoomScene scene, const RoomSettings& settings)
    : picture_size_(scene.camera.width, scene.camera.height),
      scene_(with_small_pictures(std::move(scene))),
      settings_(settings),
      sweep_(scene_.camera),
      uses_(scene_.views.size()) {
  std::map<size_t, DepthRange> ranges;
  std::vector<double> depths;
  for (size_t k = 0; k < scene_.views.size(); ++k) {
    if (!scene_.views[k].is_keyframe) continue;
    ranges[k] = depth_range(scene_, scene_.views[k]);
    if (ranges[k].is_known()) depths.push_back(ranges[k].median);
  }
  // Of the keyframes' median depths; 0 where none is known.
  median_depth_ = depths.empty() ? 0 : median_of(depths);
  for (const size_t k : choose_keyframes(scene_, median_depth_)) {
    Job job{k, {k}, k, ranges[k]};
    if (job.range.is_known())
      for (const size_t partner : choose_partners(scene_, k, job.range.median))
        job.views.push_back(partner);
    job.last = *std::max_element(job.views.begin(), job.views.end());
    jobs_.push_back(std::move(job));
  }
  std::stable_sort(jobs_.begin(), jobs_.end(),
                   [](const Job& a, const Job& b) { return a.last < b.last; });
  for (const Job& job : jobs_)
    for (const size_t view : job.views) ++uses_[view];
  tv_room_options options;
  tv_room_options_init(&options);
  first_voxel_ = options.voxel;
  if (settings_.voxel > 0)
    first_voxel_ = settings_.voxel;
  else if (median_depth_ > 0)
    first_voxel_ = two_digits(kVoxelShare * median_depth_);
  begin(first_voxel_);
}

// Makes the room anew, and empty.
void RoomBuilder::begin(double voxel) {
  tv_room_options options;
  tv_room_options_init(&options);
  options.voxel = voxel_ = voxel;
  // The standard deviations do not grow with the voxel.
  options.truncation_voxels =
      std::max(2, static_cast<int32_t>(std::ceil(kTruncationVoxels * first_voxel_ / voxel)));
  const size_t bytes = static_cast<size_t>(settings_.max_memory_mib) << 20;
  memory_.resize(bytes + TV_CONTEXT_ALIGNMENT);
  check(tv_room_init(&room_, &options, aligned(memory_), bytes), "cannot make a room");
}

void RoomBuilder::add_picture(size_t k, const RoomPicture& picture) {
  if (k > 0) run_until(k - 1);
  if (wants(k)) {
    // The source may use its memory again for the next picture.
    pictures_[k] = {small_copy(picture.luma, scene_.camera, cv::INTER_AREA),
                    small_copy(picture.colour, scene_.camera, cv::INTER_AREA),
                    small_copy(picture.mask, scene_.camera, cv::INTER_NEAREST)};
  }
  run_until(k);
}

// Runs the jobs that need no view after `view`.
void RoomBuilder::run_until(size_t view) {
  for (; next_job_ < jobs_.size() && jobs_[next_job_].last <= view; ++next_job_) {
    const Job& job = jobs_[next_job_];
    run(job);
    for (const size_t used : job.views)
      if (--uses_[used] == 0) pictures_.erase(used);
  }
}

void RoomBuilder::run(const Job& job) {
  std::vector<const RoomView*> views;
  std::vector<const RoomPicture*> pictures;
  for (const size_t k : job.views) {
    const auto found = pictures_.find(k);
    if (found == pictures_.end() || found->second.luma.empty()) {
      ++num_missing_;
      if (k == job.key) {
        ++num_without_;
        return;
      }
      continue;
    }
    views.push_back(&scene_.views[k]);
    pictures.push_back(&found->second);
  }
  const double before = cpu_ms();
  if (views.size() < 2) {
    ++num_without_;
    sweep_.count_unmapped(*pictures[0], counts_[job.key]);
    return;
  }
  maps_.push_back(
      {job.key, sweep_.run(views, pictures, job.range.near, job.range.far, counts_[job.key])});
  const double swept = cpu_ms();
  fuse_newest();
  ms_depth_ += swept - before;
  ms_fusion_ += cpu_ms() - swept;
}

void RoomBuilder::fill(const Map& map, tv_depth_map& out) {
  const RoomView& view = scene_.views[map.view];
  const tv_camera& camera = sweep_.map_camera();
  map.pixels.unpack(pixels_);
  tv_depth_map_init(&out);
  out.width = out.stride = camera.width;
  out.height = camera.height;
  out.camera = &camera;
  std::copy(view.R.begin(), view.R.end(), out.world_from_cam_R);
  std::copy(view.t.begin(), view.t.end(), out.world_from_cam_t);
  out.distance = pixels_.distance.data();
  out.sigma = pixels_.sigma.data();
  out.pixels = pixels_.rgb.data();
  out.pixel_stride_bytes = 3 * static_cast<int64_t>(camera.width);
  out.channels = 3;
  out.mask = pixels_.shown.data();
  out.mask_stride_bytes = camera.width;
}

// False where the memory is full.
bool RoomBuilder::add(const Map& map) {
  tv_depth_map given;
  fill(map, given);
  const tv_status status = tv_room_add(room_, &given);
  if (status == TV_ERR_CAPACITY) return false;
  check(status, "the depth map of " + scene_.views[map.view].name);
  return true;
}

// Frees the blocks in which fewer maps saw a surface than the mesh asks for. False where that is
// less than an eighth of the memory: it would soon be full again.
bool RoomBuilder::prune() {
  constexpr int32_t kLeastShare = 8;
  int32_t freed = 0;
  check(tv_room_prune(room_, kFewestMaps, &freed), "the room's memory");
  tv_room_state state;
  tv_room_state_init(&state);
  check(tv_room_get_state(room_, &state), "the room");
  return freed >= state.cap_blocks / kLeastShare;
}

// Returns false where the memory is full and nothing can be freed.
bool RoomBuilder::fuse(const Map& map) {
  if (add(map)) return true;
  see_through();  // what an earlier call freed may have been measured again
  return prune() && add(map);
}

// Where the memory is full, all maps are fused again with voxels of twice the side. In a room that
// was coarsened as it is, no map could see through what is added later, and no plane be carried.
void RoomBuilder::fuse_newest() {
  constexpr double kMostDoubled = 65536;
  if (fuse(maps_.back())) return;
  do {
    if (voxel_ > kMostDoubled * first_voxel_)
      throw BadInput("the room does not fit into --max-memory");
    begin(2 * voxel_);
  } while (!std::all_of(maps_.begin(), maps_.end(), [this](const Map& map) { return fuse(map); }));
}

void RoomBuilder::find_up(RoomModel& model) const {
  if (scene_.gravity) {
    for (size_t axis = 0; axis < 3; ++axis) model.up[axis] = -(*scene_.gravity)[axis];
    model.up_source = "gravity";
    return;
  }
  std::vector<Matrix3> held;
  for (const RoomView& view : scene_.views) held.push_back(view.R);
  model.up = up_of_cameras(held);
  model.up_source = "cameras";
  // Where planes nearly across that direction were measured (floor, ceiling, tables), they
  // determine "up" more precisely.
  constexpr double kMostCosine = 0.94;  // of 20 degrees
  Vector3 level{0, 0, 0};
  for (const tv_room_plane& plane : model.planes) {
    const Vector3 normal{plane.normal[0], plane.normal[1], plane.normal[2]};
    const double cosine = dot(normal, model.up);
    if (std::abs(cosine) < kMostCosine) continue;
    for (size_t axis = 0; axis < 3; ++axis)
      level[axis] += (cosine < 0 ? -plane.area : plane.area) * normal[axis];
  }
  const double weight = norm(level);
  if (!(weight > 0)) return;
  for (size_t axis = 0; axis < 3; ++axis) model.up[axis] = level[axis] / weight;
  model.up_source = "level surfaces";
}

void RoomBuilder::find_planes(RoomModel& model) const {
  const auto find = [&](const Vector3* up) {
    tv_room_plane_options options;
    tv_room_plane_options_init(&options);
    options.min_maps_behind = fewest_maps();
    if (up != nullptr)
      for (size_t axis = 0; axis < 3; ++axis) options.gravity[axis] = -(*up)[axis];
    model.planes.resize(TV_ROOM_MAX_PLANES);
    int32_t count = 0;
    check(tv_room_find_planes(room_, &options, model.planes.data(), TV_ROOM_MAX_PLANES, &count),
          "the planes of the room");
    model.planes.resize(static_cast<size_t>(count));
  };
  if (!scene_.gravity) find(nullptr);
  find_up(model);
  find(&model.up);
}

// Lets the maps see through surfaces that were added after them. Returns how many maps could: those
// that were added before the voxels became coarser are part of the sums for good, and cannot be
// used again.
size_t RoomBuilder::see_through() {
  size_t num = 0;
  for (const Map& map : maps_) {
    tv_depth_map given;
    fill(map, given);
    const tv_status status = tv_room_see_through(room_, &given);
    if (status == TV_ERR_ARGUMENT) continue;
    check(status, "the depth map of " + scene_.views[map.view].name);
    ++num;
  }
  return num;
}

// Carries the planes across what has no texture. What was measured keeps its memory and its voxels:
// an inferred map that does not fit is left out.
void RoomBuilder::infer(RoomModel& model) {
  const tv_camera& camera = sweep_.map_camera();
  size_t bytes = 0;
  check(tv_room_infer_size(camera.width, camera.height, &bytes), "the plain walls");
  std::vector<uint8_t> memory(bytes + TV_CONTEXT_ALIGNMENT);
  std::vector<float> distance(pixels_.distance.size()), sigma(pixels_.distance.size());
  tv_room_infer_options options;
  tv_room_infer_options_init(&options);
  options.planes = model.planes.data();
  options.num_planes = static_cast<int32_t>(model.planes.size());
  for (const Map& map : maps_) {
    const std::string what = "the plain walls of " + scene_.views[map.view].name;
    tv_depth_map given;
    fill(map, given);
    distance.resize(pixels_.distance.size());
    sigma.resize(pixels_.distance.size());
    int32_t num_pixels = 0;
    check(tv_room_infer(room_, aligned(memory), bytes, &given, &options, distance.data(),
                        sigma.data(), &num_pixels),
          what);
    if (num_pixels == 0) continue;
    given.distance = distance.data();
    given.sigma = sigma.data();
    given.inferred = 1;
    tv_status status = tv_room_add(room_, &given);
    if (status == TV_ERR_CAPACITY && prune()) status = tv_room_add(room_, &given);
    if (status == TV_ERR_CAPACITY || status == TV_ERR_LIMITS)
      ++model.inferred_without_memory;
    else
      check(status, what);
  }
}

int32_t RoomBuilder::fewest_maps() const {
  return std::min(kFewestMaps, std::max(1, static_cast<int32_t>(maps_.size())));
}

RoomMesh RoomBuilder::mesh(const RoomModel& model) const {
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  options.measured_only = settings_.measured_only ? 1 : 0;
  options.planes = model.planes.data();
  options.num_planes = static_cast<int32_t>(model.planes.size());
  options.min_maps = fewest_maps();
  RoomMesh mesh;
  tv_room_state state;
  tv_room_state_init(&state);
  check(tv_room_get_state(room_, &state), "the room");
  mesh.voxel = state.voxel;
  options.max_sigma = kMostSigmaVoxels * state.voxel;
  int32_t num_vertices = 0, num_triangles = 0;
  tv_status status =
      tv_room_mesh(room_, &options, nullptr, 0, &num_vertices, nullptr, 0, &num_triangles);
  if (status == TV_ERR_CAPACITY) {
    mesh.vertices.resize(static_cast<size_t>(num_vertices));
    mesh.triangles.resize(static_cast<size_t>(num_triangles));
    status = tv_room_mesh(room_, &options, mesh.vertices.data(), num_vertices, &num_vertices,
                          mesh.triangles.data(), num_triangles, &num_triangles);
  }
  check(status, "the surface");
  mesh.vertices.resize(static_cast<size_t>(num_vertices));
  mesh.triangles.resize(static_cast<size_t>(num_triangles));
  return mesh;
}

// Coarsens the room, which must not be needed any more.
void RoomBuilder::add_page_mesh(RoomModel& model) {
  constexpr size_t kMostTriangles = 250000;  // a page of 5 MB, which is drawn in about 0.1 s
  model.page_mesh = {model.vertices, model.triangles, model.voxel};
  while (model.page_mesh.triangles.size() > kMostTriangles && tv_room_coarsen(room_) == TV_OK)
    model.page_mesh = mesh(model);
}

void RoomBuilder::add_depth_maps(RoomModel& model) {
  const tv_camera& camera = sweep_.map_camera();
  for (const Map& map : maps_) {
    map.pixels.unpack(pixels_);
    for (int y = 0, i = 0; y < camera.height; ++y) {
      for (int x = 0; x < camera.width; ++x, ++i) {
        const double u = (x - camera.cx) / camera.fx, v = (y - camera.cy) / camera.fy;
        pixels_.distance[static_cast<size_t>(i)] /=
            static_cast<float>(std::sqrt(1 + u * u + v * v));
      }
    }
    const RoomView& view = scene_.views[map.view];
    model.depth_maps.push_back({view.index, view.name, pixels_.distance});
  }
}

void RoomBuilder::count_pixels(RoomModel& model) const {
  for (const auto& [view, tiles] : counts_) {
    for (int row = 0, k = 0; row < kTileRows; ++row) {
      for (int column = 0; column < kTileColumns; ++column, ++k) {
        const Vector3 ray =
            applied(model.axes, applied(scene_.views[view].R, sweep_.ray_of_tile(column, row)));
        size_t axis = 0;
        for (size_t other = 1; other < 3; ++other)
          if (std::abs(ray[other]) > std::abs(ray[axis])) axis = other;
        const PixelCounts& counts = tiles[static_cast<size_t>(k)];
        model.pixels.add(counts);
        model.pixels_towards[2 * axis + (ray[axis] < 0)].add(counts);
      }
    }
  }
}

void RoomBuilder::add_free_area(RoomModel& model) {
  constexpr int kStep = 4;  // pixels between rays
  const tv_camera& camera = sweep_.map_camera();
  FreeArea area(model);
  for (const Map& map : maps_) {
    const RoomView& view = scene_.views[map.view];
    map.pixels.unpack(pixels_);
    for (int y = 0; y < camera.height; y += kStep) {
      for (int x = 0; x < camera.width; x += kStep) {
        const double distance = static_cast<double>(
            pixels_.distance[static_cast<size_t>(y) * static_cast<size_t>(camera.width) +
                             static_cast<size_t>(x)]);
        if (!(distance > 0)) continue;
        Vector3 ray{(x - camera.cx) / camera.fx, (y - camera.cy) / camera.fy, 1};
        const double scale = distance / norm(ray);
        for (double& value : ray) value *= scale;
        Vector3 hit = applied(view.R, ray);
        for (size_t k = 0; k < 3; ++k) hit[k] += view.t[k];
        area.add_ray(view.t, hit);
      }
    }
  }
  model.free_cells = area.cells();
  model.free_cell = area.cell();
  model.free_origin = area.origin();
}

RoomModel RoomBuilder::finish() {
  // A flight that was ended has jobs whose partners will not come.
  if (!scene_.views.empty()) run_until(scene_.views.size() - 1);
  RoomModel model;
  const double before = cpu_ms();
  const bool all_see = see_through() == maps_.size();
  find_planes(model);
  // Nothing is inferred where some maps cannot be used again, because the memory ran out and the
  // voxels became coarser: what is inferred must agree with all that was measured.
  if (!settings_.measured_only && all_see) {
    infer(model);
    see_through();
  } else if (!settings_.measured_only) {
    model.inferred_without_memory = static_cast<int>(maps_.size());
  }
  RoomMesh surface = mesh(model);
  model.vertices = std::move(surface.vertices);
  model.triangles = std::move(surface.triangles);
  model.voxel = surface.voxel;
  find_axes(model);
  add_free_area(model);
  model.ms_mesh = cpu_ms() - before;
  model.first_voxel = first_voxel_;
  model.keyframes_used = static_cast<int>(maps_.size());
  model.keyframes_without = num_without_;
  model.pictures_missing = num_missing_;
  const double num = std::max<double>(1, model.keyframes_used);
  model.ms_depth = ms_depth_ / num;
  model.ms_fusion = ms_fusion_ / num;
  model.memory_bytes = static_cast<size_t>(settings_.max_memory_mib) << 20;
  model.median_depth = median_depth_;
  count_pixels(model);
  model.map_camera = sweep_.map_camera();
  if (settings_.keeps_depth_maps) add_depth_maps(model);
  add_page_mesh(model);
  return model;
}

}  // namespace cli
