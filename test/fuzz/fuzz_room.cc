// Fuzzes a room with maps of any distances, poses and options, in any order of adding, removing,
// coarsening, seeing through, finding planes, inferring, and meshing with those planes. A map that
// is removed leaves the surface that was there before, bit for bit; each vertex of a mesh is finite
// and of a triangle.
#include <vector>

#include "fuzz.h"
#include "twoview/room.h"

namespace {

constexpr int kMostSide = 24;
constexpr size_t kMostBytes = 1 << 20;
alignas(TV_CONTEXT_ALIGNMENT) uint8_t memory[kMostBytes];
alignas(TV_CONTEXT_ALIGNMENT) uint8_t scratch[6 * kMostSide * kMostSide + TV_CONTEXT_ALIGNMENT];

struct Map {
  tv_camera camera;
  double R[9], t[3];
  std::vector<float> distance, sigma;
  std::vector<uint8_t> witnesses, pixels;
  tv_depth_map map;
};

// The map as the library is given it.
tv_depth_map given(const Map& m) {
  tv_depth_map map = m.map;
  map.camera = &m.camera;
  std::copy(m.R, m.R + 9, map.world_from_cam_R);
  std::copy(m.t, m.t + 3, map.world_from_cam_t);
  return map;
}

Map map_of(fuzz::Bytes& bytes) {
  Map m;
  m.camera = {TV_CAMERA_PINHOLE, 0, 0, 0, 20, 20, 11.5, 11.5, {}};
  if (bytes.whole(0, 7) == 0) m.camera = fuzz::camera(bytes);
  m.camera.width = bytes.whole(1, kMostSide);
  m.camera.height = bytes.whole(1, kMostSide);
  double q[4] = {1, 0, 0, 0};
  for (int i = 1; i < 4; ++i) q[i] = bytes.whole(0, 1) * bytes.between(-1, 1);
  fuzz::rotation_of(q, m.R);
  if (bytes.whole(0, 31) == 0) m.R[bytes.whole(0, 8)] = bytes.wild(-1, 1);
  for (double& value : m.t) value = bytes.whole(0, 1) * bytes.wild(-2, 2);
  const size_t stride = static_cast<size_t>(m.camera.width + bytes.whole(0, 2));
  const size_t count = stride * static_cast<size_t>(m.camera.height);
  m.distance.resize(count);
  m.sigma.resize(count);
  m.witnesses.assign(count, 2);
  m.pixels.assign(3 * count, 90);
  const float distance = static_cast<float>(bytes.wild(0.2, 3));
  const float slope = static_cast<float>(bytes.between(-0.05, 0.05));
  for (size_t i = 0; i < count; ++i) {
    m.distance[i] = distance + slope * static_cast<float>(i % stride);
    m.sigma[i] = 0.02f;
  }
  for (int k = bytes.whole(0, 5); k > 0; --k) {
    const size_t i = bytes.raw<uint16_t>() % count;
    m.distance[i] = bytes.raw<float>();
    m.sigma[i] = bytes.raw<float>();
    m.witnesses[i] = bytes.raw<uint8_t>();
    m.pixels[3 * i] = bytes.raw<uint8_t>();
  }
  tv_depth_map_init(&m.map);
  m.map.width = m.camera.width;
  m.map.height = m.camera.height;
  m.map.stride = static_cast<int32_t>(stride);
  m.map.distance = m.distance.data();
  if (bytes.whole(0, 1) == 0) m.map.sigma = m.sigma.data();
  if (bytes.whole(0, 1) == 0) m.map.witnesses = m.witnesses.data();
  if (bytes.whole(0, 3) > 0) {
    m.map.pixels = m.pixels.data();
    m.map.channels = bytes.whole(0, 7) == 0 ? bytes.raw<uint8_t>() : bytes.whole(0, 1) * 2 + 1;
    m.map.pixel_stride_bytes = static_cast<int64_t>(3 * stride);
  }
  m.map.inferred = bytes.whole(0, 15) == 0;
  return m;
}

struct Mesh {
  std::vector<tv_room_vertex> vertices;
  std::vector<tv_room_triangle> triangles;
};

Mesh mesh_of(tv_room* room, const tv_room_mesh_options* options) {
  Mesh mesh;
  int32_t num_vertices = 0, num_triangles = 0;
  tv_status status =
      tv_room_mesh(room, options, nullptr, 0, &num_vertices, nullptr, 0, &num_triangles);
  if (status != TV_ERR_CAPACITY) return mesh;
  mesh.vertices.resize(static_cast<size_t>(num_vertices));
  mesh.triangles.resize(static_cast<size_t>(num_triangles));
  status = tv_room_mesh(room, options, mesh.vertices.data(), num_vertices, &num_vertices,
                        mesh.triangles.data(), num_triangles, &num_triangles);
  FUZZ_REQUIRE(status == TV_OK);
  mesh.vertices.resize(static_cast<size_t>(num_vertices));
  mesh.triangles.resize(static_cast<size_t>(num_triangles));
  std::vector<bool> used(mesh.vertices.size());
  for (const tv_room_triangle& triangle : mesh.triangles)
    for (const int32_t idx : triangle.idx_vertex) {
      FUZZ_REQUIRE(idx >= 0 && idx < num_vertices);
      used[static_cast<size_t>(idx)] = true;
    }
  for (size_t i = 0; i < used.size(); ++i) {
    const tv_room_vertex& v = mesh.vertices[i];
    FUZZ_REQUIRE(used[i] && v.sigma > 0 && std::isfinite(v.sigma));
    for (int k = 0; k < 3; ++k)
      FUZZ_REQUIRE(std::isfinite(v.position[k]) && std::isfinite(v.normal[k]));
  }
  return mesh;
}

void require_equal(const Mesh& a, const Mesh& b) {
  FUZZ_REQUIRE(a.vertices.size() == b.vertices.size() && a.triangles.size() == b.triangles.size());
  FUZZ_REQUIRE(a.vertices.empty() || std::memcmp(a.vertices.data(), b.vertices.data(),
                                                 a.vertices.size() * sizeof a.vertices[0]) == 0);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  fuzz::Bytes bytes(data, size);
  tv_room_options options;
  tv_room_options_init(&options);
  options.voxel = bytes.wild(0.02, 0.2);
  options.truncation_voxels = bytes.whole(0, 7) == 0 ? bytes.raw<uint8_t>() : bytes.whole(2, 8);
  options.max_distance = bytes.whole(0, 3) == 0 ? bytes.wild(0, 3) : 0;
  tv_room* room = nullptr;
  const size_t used = bytes.whole(0, 3) == 0 ? TV_ROOM_MIN_BYTES : kMostBytes;
  if (tv_room_init(&room, &options, memory, used) != TV_OK) return 0;
  std::vector<Map> held;
  tv_room_plane planes[TV_ROOM_MAX_PLANES];
  int32_t num_planes = 0;
  tv_room_mesh_options all;
  tv_room_mesh_options_init(&all);
  all.min_piece_triangles = 0;
  for (int step = bytes.whole(1, 6); step > 0; --step) {
    const int kind = bytes.whole(0, 7);
    if (kind < 4) {
      Map m = map_of(bytes);
      const tv_depth_map map = given(m);
      const tv_status status = tv_room_add(room, &map);
      if (status == TV_OK) held.push_back(std::move(m));
    } else if (kind == 4 && !held.empty()) {
      const tv_depth_map map = given(held.back());
      if (held.size() % 2 == 0) tv_room_prune(room, 2, nullptr);
      tv_room_see_through(room, &map);
      tv_room_remove(room, &map);
      held.pop_back();
    } else if (kind == 5) {
      tv_room_coarsen(room);
    } else if (kind == 6 && !held.empty()) {
      tv_room_plane_options of_planes;
      tv_room_plane_options_init(&of_planes);
      of_planes.min_area = bytes.wild(0, 0.1);
      for (double& value : of_planes.gravity) value = bytes.whole(0, 1) * bytes.wild(-1, 1);
      int32_t num_pixels = 0;
      if (tv_room_find_planes(room, &of_planes, planes, TV_ROOM_MAX_PLANES, &num_planes) != TV_OK) {
        num_planes = 0;
        continue;
      }
      Map& m = held.back();
      std::vector<float> distance(m.distance.size()), sigma(m.distance.size());
      const tv_depth_map map = given(m);
      tv_room_infer_options of_infer;
      tv_room_infer_options_init(&of_infer);
      of_infer.planes = planes;
      of_infer.num_planes = num_planes;
      tv_room_infer(room, scratch, sizeof scratch, &map, &of_infer, distance.data(), sigma.data(),
                    &num_pixels);
    } else {
      tv_room_mesh_options of_mesh;
      tv_room_mesh_options_init(&of_mesh);
      of_mesh.min_maps = bytes.whole(0, 3);
      of_mesh.min_piece_triangles = bytes.whole(0, 100);
      of_mesh.measured_only = bytes.whole(0, 1);
      if (bytes.whole(0, 1) == 0)
        for (int k = 0; k < 3; ++k) of_mesh.min[k] = bytes.wild(-1, 0), of_mesh.max[k] = 1;
      // Planes that were found, perhaps before the room changed, or one before the first camera.
      if (num_planes == 0 && bytes.whole(0, 1) == 0) {
        planes[0] = {};
        planes[0].normal[2] = -1;
        planes[0].offset = -bytes.wild(0.2, 3);
        if (bytes.whole(0, 7) == 0) planes[0].normal[bytes.whole(0, 2)] = bytes.wild(-1, 1);
        num_planes = 1;
      }
      of_mesh.planes = planes;
      of_mesh.num_planes = bytes.whole(0, 3) == 0 ? 0 : num_planes;
      of_mesh.max_sigma = bytes.whole(0, 3) == 0 ? bytes.wild(0, 0.1) : 0;
      mesh_of(room, &of_mesh);
    }
  }
  // What is added and removed again leaves no trace, in a room with memory for it.
  const Mesh before = mesh_of(room, &all);
  const Map m = map_of(bytes);
  const tv_depth_map map = given(m);
  if (tv_room_add(room, &map) == TV_OK) {
    FUZZ_REQUIRE(tv_room_remove(room, &map) == TV_OK);
    if (held.empty()) require_equal(before, mesh_of(room, &all));
  }
  mesh_of(room, &all);
  return 0;
}
