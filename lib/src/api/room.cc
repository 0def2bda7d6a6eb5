// The entry points of the room: they validate, and call the stages of lib/src/room.
#include "twoview/room.h"

#include <algorithm>

#include "api/sized.h"
#include "api/validate.h"
#include "api/within.h"
#include "geometry/essential.h"
#include "room/coarsen.h"
#include "room/infer.h"
#include "room/mesh.h"
#include "room/planes.h"
#include "room/records.h"

namespace tv {
namespace {

constexpr int32_t kMaxSide = 16384;
constexpr int32_t kMostMinMaps = 255;
constexpr tv_room_options kDefaults = {sizeof(tv_room_options), 3, 0.03, 0.0};
constexpr tv_room_mesh_options kMeshDefaults = {
    sizeof(tv_room_mesh_options), 1, 64, 0, {0, 0, 0}, {0, 0, 0}, nullptr, 0, 0, 0};
constexpr tv_room_plane_options kPlaneDefaults = {
    sizeof(tv_room_plane_options), 1, 0, {0, 0, 0}, 0.02};
constexpr tv_room_infer_options kInferDefaults = {sizeof(tv_room_infer_options), 3, nullptr, 0, 0};

tv_status read_options(const tv_room_options* given, tv_room_options* options) {
  *options = kDefaults;
  const tv_status status = read_sized(given, options);
  if (status != TV_OK) return status;
  if (!is_finite(options->voxel) || !is_finite(options->max_distance)) return TV_ERR_NOT_FINITE;
  // Within these, squares of sizes and counts of voxels are numbers.
  const bool valid = within(options->truncation_voxels, 2, 8) && options->voxel >= 1e-9 &&
                     options->voxel <= 1e9 && options->max_distance >= 0;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

// Checks the rows of an image that lies on a map of this camera.
tv_status check_rows(const tv_image& rows, const tv_camera& camera) {
  tv_camera size = camera;
  size.width = rows.width, size.height = rows.height;
  return check_camera_image(size, rows);
}

tv_status check_map(const tv_depth_map& map, const tv_camera& camera) {
  if (map.distance == nullptr) return TV_ERR_NULL;
  const bool valid = within(map.width, 1, kMaxSide) && within(map.height, 1, kMaxSide) &&
                     map.stride >= map.width && within(map.inferred, 0, 1);
  if (!valid) return TV_ERR_ARGUMENT;
  if (map.pixels != nullptr) {
    if (map.channels != 1 && map.channels != 3) return TV_ERR_ARGUMENT;
    const tv_status status = check_rows(
        {map.pixels, map.channels * map.width, map.height, map.pixel_stride_bytes}, camera);
    if (status != TV_OK) return status;
  }
  if (map.mask != nullptr) {
    const tv_status status =
        check_rows({map.mask, map.width, map.height, map.mask_stride_bytes}, camera);
    if (status != TV_OK) return status;
  }
  return map.width == camera.width && map.height == camera.height ? TV_OK : TV_ERR_CAMERA;
}

// Checks what tv_room_add and tv_room_remove are given, and makes the view of it.
tv_status read_view(const tv_room* room, const tv_depth_map* map, RoomView* view) {
  if (room == nullptr || map == nullptr) return TV_ERR_NULL;
  view->map = tv_depth_map{};
  const tv_depth_map& given = view->map;
  tv_status status = read_sized(map, &view->map);
  if (status == TV_OK) status = tv_camera_check(given.camera);
  if (status == TV_OK) status = check_map(given, *given.camera);
  if (status != TV_OK) return status;
  const double *const R = given.world_from_cam_R, *const t = given.world_from_cam_t;
  if (!all_finite(R, 9) || !all_finite(t, 3)) return TV_ERR_NOT_FINITE;
  if (!is_rotation(R)) return TV_ERR_ARGUMENT;
  view->camera = prepare_camera(*given.camera);
  view->rotation = matrix_of(R);
  view->centre = Vec3(t);
  return TV_OK;
}

Bytes bytes_of(const tv_room& room) { return {&room, room_bytes(room)}; }

tv_status read_plane_request(const tv_room& room, const tv_room_plane_options* given,
                             PlaneRequest* request) {
  tv_room_plane_options o = kPlaneDefaults;
  const tv_status status = read_sized(given, &o);
  if (status != TV_OK) return status;
  if (!is_finite(o.min_area) || !all_finite(o.gravity, 3) || !is_finite(o.gravity_sigma_rad)) {
    return TV_ERR_NOT_FINITE;
  }
  const double voxel = room.options.voxel;
  *request = {std::max(o.min_maps_behind, 1),
              o.min_area > 0 ? o.min_area : kLeastArea * voxel * voxel,
              false,
              {0, 0, 0},
              o.gravity_sigma_rad};
  request->has_gravity = up_of(o.gravity, request->up);
  const bool valid = within(o.min_maps_behind, 0, kMostMinMaps) && o.min_area >= 0 &&
                     o.gravity_sigma_rad > 0 && o.gravity_sigma_rad <= 1;
  return valid ? TV_OK : TV_ERR_ARGUMENT;
}

bool are_finite(const tv_room_plane* planes, int32_t num_planes) {
  bool finite = true;
  for (int32_t k = 0; k < num_planes; ++k) {
    const tv_room_plane& p = planes[k];
    finite = finite && all_finite(p.normal, 3) && is_finite(p.offset) && is_finite(p.sigma);
  }
  return finite;
}

tv_status read_request(const tv_room& room, const tv_room_mesh_options* given,
                       MeshRequest* request) {
  tv_room_mesh_options o = kMeshDefaults;
  const tv_status status = read_sized(given, &o);
  if (status != TV_OK) return status;
  if (o.planes == nullptr && o.num_planes > 0) return TV_ERR_NULL;
  if (!all_finite(o.min, 3) || !all_finite(o.max, 3) || !is_finite(o.max_sigma)) {
    return TV_ERR_NOT_FINITE;
  }
  bool valid = within(o.min_maps, 1, kMostMinMaps) && o.min_piece_triangles >= 0 &&
               within(o.measured_only, 0, 1) && within(o.num_planes, 0, TV_ROOM_MAX_PLANES) &&
               o.reserved == 0 && o.max_sigma >= 0;
  if (!valid) return TV_ERR_ARGUMENT;
  if (!are_finite(o.planes, o.num_planes)) return TV_ERR_NOT_FINITE;
  *request = {o.min_maps, o.min_piece_triangles, o.measured_only != 0, {}, {},
              o.planes,   o.num_planes,          o.max_sigma};
  for (int i = 0; i < 3; ++i) valid = valid && o.min[i] <= o.max[i];
  if (!valid) return TV_ERR_ARGUMENT;
  choose_blocks(room, o.min, o.max, request);
  return TV_OK;
}

}  // namespace
}  // namespace tv

void tv_room_options_init_sized(tv_room_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kDefaults, sizeof tv::kDefaults);
}

void tv_depth_map_init_sized(tv_depth_map* map, size_t struct_size) {
  tv::init_zeros(map, struct_size);
}

void tv_room_state_init_sized(tv_room_state* state, size_t struct_size) {
  tv::init_zeros(state, struct_size);
}

void tv_room_mesh_options_init_sized(tv_room_mesh_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kMeshDefaults, sizeof tv::kMeshDefaults);
}

void tv_room_plane_options_init_sized(tv_room_plane_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kPlaneDefaults, sizeof tv::kPlaneDefaults);
}

void tv_room_infer_options_init_sized(tv_room_infer_options* options, size_t struct_size) {
  tv::init_sized(options, struct_size, &tv::kInferDefaults, sizeof tv::kInferDefaults);
}

tv_status tv_room_init(tv_room** room, const tv_room_options* options, void* memory,
                       size_t size_bytes) {
  if (memory == nullptr || room == nullptr) return TV_ERR_NULL;
  tv_room_options checked;
  const tv_status status = tv::read_options(options, &checked);
  if (status != TV_OK) return status;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < TV_ROOM_MIN_BYTES) return TV_ERR_MEMORY;
  *room = tv::make_room(checked, memory, size_bytes);
  return TV_OK;
}

tv_status tv_room_add(tv_room* room, const tv_depth_map* map) {
  tv::RoomView view;
  const tv_status status = tv::read_view(room, map, &view);
  if (status != TV_OK) return status;
  if (room->num_maps == TV_ROOM_MAX_MAPS) return TV_ERR_LIMITS;
  return tv::add_map(*room, view) ? TV_OK : TV_ERR_CAPACITY;
}

tv_status tv_room_remove(tv_room* room, const tv_depth_map* map) {
  tv::RoomView view;
  const tv_status status = tv::read_view(room, map, &view);
  if (status != TV_OK) return status;
  const int32_t record = tv::find_record(*room, view);
  if (record < 0) return TV_ERR_ARGUMENT;
  tv::remove_map(*room, view, record);
  return TV_OK;
}

tv_status tv_room_see_through(tv_room* room, const tv_depth_map* map) {
  tv::RoomView view;
  const tv_status status = tv::read_view(room, map, &view);
  if (status != TV_OK) return status;
  const int32_t record = tv::find_record(*room, view);
  if (record < 0) return TV_ERR_ARGUMENT;
  tv::see_through_again(*room, view, record);
  return TV_OK;
}

tv_status tv_room_prune(tv_room* room, int32_t min_maps, int32_t* num_freed) {
  if (room == nullptr) return TV_ERR_NULL;
  if (!tv::within(min_maps, 1, tv::kMostMinMaps)) return TV_ERR_ARGUMENT;
  const int32_t freed = tv::prune(*room, min_maps);
  if (num_freed != nullptr) *num_freed = freed;
  return TV_OK;
}

tv_status tv_room_coarsen(tv_room* room) {
  if (room == nullptr) return TV_ERR_NULL;
  if (room->level == tv::kMaxLevels) return TV_ERR_LIMITS;
  tv::coarsen(*room);
  return TV_OK;
}

tv_status tv_room_get_state(const tv_room* room, tv_room_state* state) {
  if (room == nullptr || state == nullptr) return TV_ERR_NULL;
  const tv_status status = tv::check_sized(state);
  if (status != TV_OK) return status;
  tv_room_state s = {};
  s.num_maps = room->num_maps;
  s.num_blocks = room->num_blocks;
  s.cap_blocks = room->cap_blocks;
  s.voxel = room->options.voxel;
  tv::find_bounds(*room, s.min, s.max);
  tv::write_sized(s, state);
  return TV_OK;
}

tv_status tv_room_mesh(tv_room* room, const tv_room_mesh_options* options, tv_room_vertex* vertices,
                       int32_t cap_vertices, int32_t* num_vertices, tv_room_triangle* triangles,
                       int32_t cap_triangles, int32_t* num_triangles) {
  if (room == nullptr || num_vertices == nullptr || num_triangles == nullptr ||
      (vertices == nullptr && cap_vertices > 0) || (triangles == nullptr && cap_triangles > 0)) {
    return TV_ERR_NULL;
  }
  tv::MeshRequest request;
  const tv_status status = tv::read_request(*room, options, &request);
  if (status != TV_OK) return status;
  if (cap_vertices < 0 || cap_triangles < 0) return TV_ERR_ARGUMENT;
  const tv::Bytes arrays[6] = {
      {vertices, static_cast<size_t>(cap_vertices) * sizeof(tv_room_vertex)},
      {triangles, static_cast<size_t>(cap_triangles) * sizeof(tv_room_triangle)},
      {num_vertices, sizeof *num_vertices},
      {num_triangles, sizeof *num_triangles},
      tv::bytes_of(*room),
      {request.planes, static_cast<size_t>(request.num_planes) * sizeof(tv_room_plane)}};
  if (tv::outputs_overlap(arrays, 4, 6)) return TV_ERR_OVERLAP;
  int64_t most_vertices, most_triangles;
  tv::count_mesh(*room, request, &most_vertices, &most_triangles);
  if (most_vertices > INT32_MAX || most_triangles > INT32_MAX) return TV_ERR_LIMITS;
  *num_vertices = static_cast<int32_t>(most_vertices);
  *num_triangles = static_cast<int32_t>(most_triangles);
  if (*num_vertices > cap_vertices || *num_triangles > cap_triangles) return TV_ERR_CAPACITY;
  tv::MeshOutput output = {vertices, triangles, 0, 0};
  tv::write_mesh(*room, request, &output);
  *num_vertices = output.num_vertices;
  *num_triangles = output.num_triangles;
  return TV_OK;
}

tv_status tv_room_find_planes(tv_room* room, const tv_room_plane_options* options,
                              tv_room_plane* planes, int32_t cap_planes, int32_t* num_planes) {
  if (room == nullptr || num_planes == nullptr || (planes == nullptr && cap_planes > 0)) {
    return TV_ERR_NULL;
  }
  tv::PlaneRequest request;
  const tv_status status = tv::read_plane_request(*room, options, &request);
  if (status != TV_OK) return status;
  if (!tv::within(cap_planes, 0, TV_ROOM_MAX_PLANES)) return TV_ERR_ARGUMENT;
  const tv::Bytes arrays[3] = {{planes, static_cast<size_t>(cap_planes) * sizeof(tv_room_plane)},
                               {num_planes, sizeof *num_planes},
                               tv::bytes_of(*room)};
  if (tv::outputs_overlap(arrays, 2, 3)) return TV_ERR_OVERLAP;
  *num_planes = tv::find_planes(*room, request, planes, cap_planes);
  return TV_OK;
}

tv_status tv_room_infer_size(int32_t width, int32_t height, size_t* size_bytes) {
  if (size_bytes == nullptr) return TV_ERR_NULL;
  if (!tv::within(width, 1, tv::kMaxSide) || !tv::within(height, 1, tv::kMaxSide)) {
    return TV_ERR_ARGUMENT;
  }
  *size_bytes = tv::infer_bytes(width, height);
  return TV_OK;
}

tv_status tv_room_infer(const tv_room* room, void* memory, size_t size_bytes,
                        const tv_depth_map* map, const tv_room_infer_options* options,
                        float* distance, float* sigma, int32_t* num_pixels) {
  if (memory == nullptr || distance == nullptr || sigma == nullptr || num_pixels == nullptr) {
    return TV_ERR_NULL;
  }
  tv::RoomView view;
  tv_status status = tv::read_view(room, map, &view);
  tv_room_infer_options checked = tv::kInferDefaults;
  if (status == TV_OK) status = tv::read_sized(options, &checked);
  if (status != TV_OK) return status;
  const tv_room_plane* const planes = checked.planes;
  const int32_t num_planes = checked.num_planes;
  if (planes == nullptr && num_planes > 0) return TV_ERR_NULL;
  if (view.map.pixels == nullptr || view.map.inferred != 0 || checked.reserved != 0 ||
      !tv::within(num_planes, 0, TV_ROOM_MAX_PLANES) || !tv::within(checked.max_step, 0, 255)) {
    return TV_ERR_ARGUMENT;
  }
  if (!tv::are_finite(planes, num_planes)) return TV_ERR_NOT_FINITE;
  if (reinterpret_cast<uintptr_t>(memory) % TV_CONTEXT_ALIGNMENT != 0) return TV_ERR_ALIGNMENT;
  if (size_bytes < tv::infer_bytes(view.map.width, view.map.height)) return TV_ERR_MEMORY;
  const size_t pixels = static_cast<size_t>(view.map.width) * static_cast<size_t>(view.map.height);
  const size_t strided =
      static_cast<size_t>(view.map.stride) * static_cast<size_t>(view.map.height - 1) +
      static_cast<size_t>(view.map.width);
  const tv_image picture = {view.map.pixels, view.map.channels * view.map.width, view.map.height,
                            view.map.pixel_stride_bytes};
  const tv_image mask = {view.map.mask, view.map.width, view.map.height,
                         view.map.mask_stride_bytes};
  const tv::Bytes arrays[11] = {{distance, pixels * sizeof *distance},
                                {sigma, pixels * sizeof *sigma},
                                {num_pixels, sizeof *num_pixels},
                                {memory, size_bytes},
                                tv::bytes_of(*room),
                                {planes, static_cast<size_t>(num_planes) * sizeof(tv_room_plane)},
                                {view.map.distance, strided * sizeof(float)},
                                {view.map.sigma, strided * sizeof(float)},
                                {view.map.witnesses, strided},
                                {view.map.pixels, tv::image_bytes(picture)},
                                {view.map.mask, tv::image_bytes(mask)}};
  if (tv::outputs_overlap(arrays, 4, 11)) return TV_ERR_OVERLAP;
  tv::Arena arena = tv::arena_over(memory, size_bytes);
  *num_pixels = tv::infer_distances(*room, view, {planes, num_planes, checked.max_step}, arena,
                                    distance, sigma);
  return TV_OK;
}
