// Tests of the room against surfaces that are known exactly.
#include <algorithm>
#include <cmath>
#include <cstring>
#include <map>
#include <utility>
#include <vector>

#include "base/random.h"
#include "room/blocks.h"
#include "support/box_room.h"
#include "support/scene.h"
#include "twoview/twoview.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using box_room::Map;
using box_room::Scene;
using tv::Vec3;

constexpr double kVoxel = 0.03;

// They outlive a failing test, which leaves by longjmp.
alignas(64) uint8_t memory[TV_ROOM_DEFAULT_BYTES];
std::vector<tv_room_vertex> vertices;
std::vector<tv_room_triangle> triangles;

tv_room* new_room(double voxel = kVoxel, size_t bytes = sizeof memory) {
  tv_room_options options;
  tv_room_options_init(&options);
  options.voxel = voxel;
  tv_room* room = nullptr;
  TEST_ASSERT_EQUAL(TV_OK, tv_room_init(&room, &options, memory, bytes));
  return room;
}

tv_status add(tv_room* room, const Map& m) {
  const tv_depth_map map = box_room::given(m);
  return tv_room_add(room, &map);
}

tv_status remove(tv_room* room, const Map& m) {
  const tv_depth_map map = box_room::given(m);
  return tv_room_remove(room, &map);
}

tv_status see_through(tv_room* room, const Map& m) {
  const tv_depth_map map = box_room::given(m);
  return tv_room_see_through(room, &map);
}

void mesh(tv_room* room, const tv_room_mesh_options* options = nullptr) {
  int32_t nv, nt;
  const tv_status status = tv_room_mesh(room, options, nullptr, 0, &nv, nullptr, 0, &nt);
  TEST_ASSERT_EQUAL(nv == 0 ? TV_OK : TV_ERR_CAPACITY, status);
  vertices.resize(static_cast<size_t>(nv));
  triangles.resize(static_cast<size_t>(nt));
  TEST_ASSERT_EQUAL(
      TV_OK, tv_room_mesh(room, options, vertices.data(), nv, &nv, triangles.data(), nt, &nt));
  vertices.resize(static_cast<size_t>(nv));
  triangles.resize(static_cast<size_t>(nt));
}

Vec3 position(int32_t v) {
  const float* p = vertices[static_cast<size_t>(v)].position;
  return Vec3(static_cast<double>(p[0]), static_cast<double>(p[1]), static_cast<double>(p[2]));
}

Vec3 normal(int32_t v) {
  const float* n = vertices[static_cast<size_t>(v)].normal;
  return Vec3(static_cast<double>(n[0]), static_cast<double>(n[1]), static_cast<double>(n[2]));
}

double signed_volume() {
  double sum = 0;
  for (const tv_room_triangle& f : triangles) {
    sum +=
        position(f.idx_vertex[0]).dot(position(f.idx_vertex[1]).cross(position(f.idx_vertex[2]))) /
        6;
  }
  return sum;
}

// How many edges do not have their opposite in another triangle.
int open_edges() {
  std::map<std::pair<int32_t, int32_t>, int> edges;
  for (const tv_room_triangle& f : triangles) {
    for (int k = 0; k < 3; ++k) {
      const int32_t a = f.idx_vertex[k], b = f.idx_vertex[(k + 1) % 3];
      edges[{std::min(a, b), std::max(a, b)}] += a < b ? 1 : -1;
    }
  }
  return static_cast<int>(
      std::count_if(edges.begin(), edges.end(), [](const auto& e) { return e.second != 0; }));
}

// Triangles are anticlockwise as seen from where their vertices' normals point: all but what a fold
// where the surface touches voxels takes of the area.
void check_winding() {
  double right = 0, wrong = 0;
  for (const tv_room_triangle& f : triangles) {
    const Vec3 a = position(f.idx_vertex[0]), b = position(f.idx_vertex[1]),
               c = position(f.idx_vertex[2]);
    const Vec3 n = normal(f.idx_vertex[0]) + normal(f.idx_vertex[1]) + normal(f.idx_vertex[2]);
    const double area = (b - a).cross(c - a).norm();
    ((b - a).cross(c - a).dot(n) >= 0 ? right : wrong) += area;
  }
  TEST_ASSERT_TRUE(right > 0);
  TEST_ASSERT_TRUE(wrong < 0.002 * right);
}

std::vector<Map> around_ball(const Vec3& centre, double radius, float sigma) {
  Scene ball;
  ball.centre = centre, ball.radius = radius;
  std::vector<Map> maps;
  for (int k = 0; k < 14; ++k) {
    const Vec3 corner((k & 1) * 2 - 1, (k >> 1 & 1) * 2 - 1, (k >> 2 & 1) * 2 - 1);
    Vec3 from = corner.normalized();
    if (k >= 8) from = Vec3(0, 0, 0), from[(k - 8) % 3] = k < 11 ? 1 : -1;
    maps.push_back(
        box_room::see(ball, box_room::pinhole(160, 120, 140), centre + 2 * from, centre, sigma));
  }
  return maps;
}

void test_a_plane_between_voxels_is_where_it_is() {
  for (const double offset : {2.0, 2.007, 2.013, 2.0249}) {
    Scene wall;
    wall.normal = Vec3(0, 1, 0), wall.offset = offset;
    tv_room* room = new_room();
    for (int k = 0; k < 5; ++k) {
      const Vec3 from(0.2 * k - 0.4, 0.1 * k, 0.1 * (k % 2));
      TEST_ASSERT_EQUAL(TV_OK, add(room, box_room::see(wall, box_room::pinhole(160, 120, 140), from,
                                                       from + Vec3(0.1, 1, 0.05), 0.01f)));
    }
    mesh(room);
    TEST_ASSERT_TRUE(vertices.size() > 2000);
    double worst = 0, sum = 0;
    for (size_t v = 0; v < vertices.size(); ++v) {
      const double error = position(static_cast<int32_t>(v))[1] - offset;
      worst = std::fmax(worst, std::fabs(error));
      sum += error;
      TEST_ASSERT_TRUE(normal(static_cast<int32_t>(v))[1] < -0.95);  // to the free side
      TEST_ASSERT_EQUAL(0, vertices[v].inferred);
    }
    TEST_ASSERT_DOUBLE_WITHIN(0.0005, 0, sum / static_cast<double>(vertices.size()));
    TEST_ASSERT_DOUBLE_WITHIN(0.1 * kVoxel, 0, worst);
    check_winding();
  }
}

void test_a_ball_is_closed_and_its_signed_volume_is_right() {
  tv_room* room = new_room();
  const Vec3 centre(0.011, -0.307, 1.503);
  for (const Map& m : around_ball(centre, 0.5, 0.005f)) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  mesh(room);
  TEST_ASSERT_EQUAL(0, open_edges());
  TEST_ASSERT_DOUBLE_WITHIN(0.02 * 0.5236, 0.5236, signed_volume());
  check_winding();
  double worst = 0, worst_normal = 1;
  for (size_t v = 0; v < vertices.size(); ++v) {
    const Vec3 out = position(static_cast<int32_t>(v)) - centre;
    worst = std::fmax(worst, std::fabs(out.norm() - 0.5));
    worst_normal = std::fmin(worst_normal, normal(static_cast<int32_t>(v)).dot(out.normalized()));
  }
  TEST_ASSERT_DOUBLE_WITHIN(0.25 * kVoxel, 0, worst);
  TEST_ASSERT_TRUE(worst_normal > 0.9);
}

void test_removing_a_map_restores_the_room_bit_for_bit() {
  static uint8_t before[8 << 20];
  tv_room* room = new_room(kVoxel, sizeof before);
  const std::vector<Map> maps = around_ball(Vec3(0, 0, 1), 0.4, 0.01f);
  for (size_t k = 0; k < 4; ++k) TEST_ASSERT_EQUAL(TV_OK, add(room, maps[k]));
  mesh(room);
  const std::vector<tv_room_vertex> was = vertices;
  const std::vector<tv_room_triangle> joined = triangles;
  for (size_t k = 4; k < 9; ++k) TEST_ASSERT_EQUAL(TV_OK, add(room, maps[k]));
  for (size_t k = 9; k-- > 4;) TEST_ASSERT_EQUAL(TV_OK, remove(room, maps[k]));
  mesh(room);
  TEST_ASSERT_EQUAL(was.size(), vertices.size());
  TEST_ASSERT_EQUAL(joined.size(), triangles.size());
  TEST_ASSERT_EQUAL_MEMORY(was.data(), vertices.data(), was.size() * sizeof was[0]);
  TEST_ASSERT_EQUAL_MEMORY(joined.data(), triangles.data(), joined.size() * sizeof joined[0]);
  // What is not in the room is not removed.
  TEST_ASSERT_EQUAL(TV_ERR_ARGUMENT, remove(room, maps[5]));
  for (size_t k = 0; k < 4; ++k) TEST_ASSERT_EQUAL(TV_OK, remove(room, maps[k]));
  tv_room_state state;
  tv_room_state_init(&state);
  TEST_ASSERT_EQUAL(TV_OK, tv_room_get_state(room, &state));
  TEST_ASSERT_EQUAL(0, state.num_blocks);
  TEST_ASSERT_EQUAL(0, state.num_maps);
}

Scene hall() {
  Scene scene;
  scene.low = Vec3(0.013, -0.021, 0.007), scene.high = Vec3(4.02, 3.01, 2.51);
  scene.centre = Vec3(2.2, 1.0, 0.6), scene.radius = 0.45;
  return scene;
}

double distance_to(const Scene& scene, const Vec3& p) {
  double nearest = std::fabs((p - scene.centre).norm() - scene.radius);
  for (int i = 0; i < 3; ++i) {
    nearest = std::min({nearest, std::fabs(p[i] - scene.low[i]), std::fabs(p[i] - scene.high[i])});
  }
  return nearest;
}

std::vector<Map> tour(const Scene& scene, const tv_camera& camera, int num, float sigma) {
  std::vector<Map> maps;
  for (int k = 0; k < num; ++k) {
    const double a = 6.2831853 * k / num, b = a + 3.14 + (k % 3 - 1) * 0.5;
    const Vec3 from(2 + 1.1 * std::cos(a), 1.7 + 0.9 * std::sin(a), 1.4 + 0.2 * std::sin(3 * a));
    const Vec3 to = from + Vec3(std::cos(b), std::sin(b), (k % 3 - 1) * 0.6);
    maps.push_back(box_room::see(scene, camera, from, to, sigma));
  }
  return maps;
}

void test_a_room_seen_from_inside_through_every_lens() {
  const Scene scene = hall();
  for (int lens = 0; lens < 3; ++lens) {
    tv_camera camera = box_room::pinhole(160, 120, lens == 2 ? 70 : 110);
    camera.model = lens == 0   ? TV_CAMERA_PINHOLE
                   : lens == 1 ? TV_CAMERA_BROWN_CONRADY
                               : TV_CAMERA_KANNALA_BRANDT;
    if (lens == 1) camera.k[0] = -0.2, camera.k[1] = 0.04;
    if (lens == 2) camera.k[0] = -0.02;
    tv_room* room = new_room(0.04);
    for (const Map& m : tour(scene, camera, 24, 0.02f)) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
    mesh(room);
    TEST_ASSERT_TRUE(vertices.size() > 20000);
    std::vector<double> errors;
    size_t wrong_colours = 0;
    for (size_t v = 0; v < vertices.size(); ++v) {
      const Vec3 p = position(static_cast<int32_t>(v));
      errors.push_back(distance_to(scene, p));
      for (int i = 0; i < 3; ++i) {
        wrong_colours += std::fabs(128 + 20 * p[i] - vertices[v].rgb[i]) > 3;
      }
    }
    std::sort(errors.begin(), errors.end());
    TEST_ASSERT_TRUE(errors[errors.size() / 2] < 0.001);
    TEST_ASSERT_TRUE(errors[errors.size() * 99 / 100] < 0.012);
    TEST_ASSERT_TRUE(errors.back() < 0.04);
    TEST_ASSERT_TRUE(wrong_colours < vertices.size() / 100);
    check_winding();
  }
}

Map wall_at(double offset, const Vec3& from, float sigma) {
  Scene wall;
  wall.normal = Vec3(0, 1, 0), wall.offset = offset;
  return box_room::see(wall, box_room::pinhole(160, 120, 140), from, from + Vec3(0, 1, 0), sigma);
}

size_t vertices_near(double y) {
  return static_cast<size_t>(
      std::count_if(vertices.begin(), vertices.end(), [y](const tv_room_vertex& v) {
        return std::fabs(static_cast<double>(v.position[1]) - y) < 0.05;
      }));
}

void test_what_others_see_through_vanishes_and_one_error_removes_no_wall() {
  tv_room* room = new_room();
  TEST_ASSERT_EQUAL(TV_OK, add(room, wall_at(1, Vec3(0, 0, 0), 0.03f)));  // it is not there
  mesh(room);
  TEST_ASSERT_TRUE(vertices_near(1) > 500);
  for (int k = 0; k < 6; ++k) {
    TEST_ASSERT_EQUAL(TV_OK, add(room, wall_at(2, Vec3(0.1 * k - 0.3, 0, 0), 0.01f)));
  }
  mesh(room);
  TEST_ASSERT_EQUAL(0, vertices_near(1));
  const size_t wall = vertices_near(2);
  TEST_ASSERT_TRUE(wall > 2000);
  TEST_ASSERT_EQUAL(TV_OK, add(room, wall_at(4, Vec3(0, 0, 0), 0.03f)));
  mesh(room);
  TEST_ASSERT_TRUE(vertices_near(2) > wall * 95 / 100);
}

void test_a_map_sees_through_later_blocks_when_told_and_is_removed_exactly_then() {
  tv_room* room = new_room();
  std::vector<Map> right;
  for (int k = 0; k < 6; ++k) right.push_back(wall_at(2, Vec3(0.1 * k - 0.3, 0, 0), 0.01f));
  const Map wrong = wall_at(1, Vec3(0, 0, 0), 0.03f);
  for (const Map& m : right) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  TEST_ASSERT_EQUAL(TV_OK, add(room, wrong));
  mesh(room);
  const size_t before = vertices_near(1);
  TEST_ASSERT_TRUE(before > 500);
  for (const Map& m : right) {
    TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
  }
  mesh(room);
  TEST_ASSERT_EQUAL(0, vertices_near(1));
  // A second time nothing is left to see through: after a removal the sums are those from before.
  for (const Map& m : right) {
    TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
  }
  for (const Map& m : right) TEST_ASSERT_EQUAL(TV_OK, remove(room, m));
  mesh(room);
  TEST_ASSERT_EQUAL(before, vertices_near(1));
  TEST_ASSERT_EQUAL(before, vertices.size());
}

// Memory for a tenth of the room: it says so, keeps what it has, and goes on with a coarser voxel.
void test_a_room_that_is_full_keeps_what_it_has_and_goes_on_coarser() {
  const Scene scene = hall();
  const std::vector<Map> maps = tour(scene, box_room::pinhole(160, 120, 110), 24, 0.02f);
  tv_room* room = new_room(kVoxel, 2 << 20);
  tv_room_state state;
  tv_room_state_init(&state);
  int full = 0;
  for (const Map& m : maps) {
    mesh(room);
    const std::vector<tv_room_vertex> was = vertices;
    tv_status status = add(room, m);
    if (status == TV_ERR_CAPACITY && full == 0) {
      mesh(room);
      TEST_ASSERT_EQUAL(was.size(), vertices.size());
      TEST_ASSERT_EQUAL_MEMORY(was.data(), vertices.data(), was.size() * sizeof was[0]);
    }
    for (; status == TV_ERR_CAPACITY; ++full) {
      TEST_ASSERT_EQUAL(TV_OK, tv_room_coarsen(room));
      status = add(room, m);
    }
    TEST_ASSERT_EQUAL(TV_OK, status);
  }
  TEST_ASSERT_TRUE(full == 1 || full == 2);
  TEST_ASSERT_EQUAL(TV_OK, tv_room_get_state(room, &state));
  TEST_ASSERT_EQUAL(24, state.num_maps);
  TEST_ASSERT_DOUBLE_WITHIN(1e-12, kVoxel * (1 << full), state.voxel);
  mesh(room);
  std::vector<double> errors;
  double area = 0;
  for (const tv_room_triangle& f : triangles) {
    const Vec3 a = position(f.idx_vertex[0]);
    area += (position(f.idx_vertex[1]) - a).cross(position(f.idx_vertex[2]) - a).norm() / 2;
    errors.push_back(distance_to(scene, a));
  }
  std::sort(errors.begin(), errors.end());
  TEST_ASSERT_TRUE(errors[errors.size() / 2] < 0.05 * state.voxel);
  TEST_ASSERT_TRUE(errors[errors.size() * 99 / 100] < 0.4 * state.voxel);
  TEST_ASSERT_TRUE(area > 40);  // of 60, of which the tour does not see all
  TEST_ASSERT_EQUAL(TV_ERR_ARGUMENT, remove(room, maps[0]));  // coarsening fixed it
  TEST_ASSERT_EQUAL(TV_OK, remove(room, maps[23]));
}

bool is_before(const tv_room_vertex& a, const tv_room_vertex& b) {
  return std::memcmp(&a, &b, sizeof a) < 0;
}

// The vertices of the surface that two maps confirm, in an order that blocks do not decide.
std::vector<tv_room_vertex> confirmed(tv_room* room) {
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  options.min_maps = 2;
  options.min_piece_triangles = 0;
  mesh(room, &options);
  std::vector<tv_room_vertex> sorted = vertices;
  std::sort(sorted.begin(), sorted.end(), is_before);
  return sorted;
}

// What one map alone saw makes way, again and again. With the maps added to what others have made
// again, the surface is that of unlimited memory, bit for bit, but for a few cells beside blocks
// that nobody made again. Without that, each map takes back what it still has in the room.
void test_what_was_pruned_comes_back_where_another_map_confirms_it() {
  const std::vector<Map> maps = tour(hall(), box_room::pinhole(160, 120, 110), 12, 0.02f);
  tv_room* room = new_room(0.04);
  for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
  const std::vector<tv_room_vertex> unlimited = confirmed(room);
  TEST_ASSERT_TRUE(unlimited.size() > 5000);
  for (const bool comes_back : {true, false}) {
    room = new_room(0.04);
    int32_t freed = 0, all_freed = 0;
    for (size_t k = 0; k < maps.size(); ++k) {
      TEST_ASSERT_EQUAL(TV_OK, add(room, maps[k]));
      if (k % 2 == 0) continue;
      for (size_t n = 0; comes_back && n <= k; ++n)
        TEST_ASSERT_EQUAL(TV_OK, see_through(room, maps[n]));
      TEST_ASSERT_EQUAL(TV_OK, tv_room_prune(room, 2, &freed));
      all_freed += freed;
      TEST_ASSERT_EQUAL(TV_OK, tv_room_prune(room, 2, &freed));
      TEST_ASSERT_EQUAL(0, freed);
    }
    TEST_ASSERT_TRUE(all_freed > 1000);
    if (comes_back) {
      for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
      const std::vector<tv_room_vertex> now = confirmed(room);
      TEST_ASSERT_TRUE(
          std::includes(unlimited.begin(), unlimited.end(), now.begin(), now.end(), is_before));
      TEST_ASSERT_TRUE(unlimited.size() - now.size() < unlimited.size() / 200);
    }
    for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, remove(room, m));
    tv_room_state state;
    tv_room_state_init(&state);
    TEST_ASSERT_EQUAL(TV_OK, tv_room_get_state(room, &state));
    TEST_ASSERT_EQUAL(0, state.num_blocks);
  }
}

// The voxels' sums, block by block in the order of their places.
std::map<uint64_t, std::vector<uint64_t>> sums_of(const tv_room* room) {
  std::map<uint64_t, std::vector<uint64_t>> sums;
  for (int32_t k = 0; k < room->end_blocks; ++k) {
    if (room->blocks[k].key == 0) continue;
    const tv::Voxel* voxels = tv::voxels_of(*room, k);
    std::vector<uint64_t>& all = sums[room->blocks[k].key];
    for (int32_t v = 0; v < tv::kBlockVoxels; ++v) {
      all.push_back(voxels[v].evidence);
      all.push_back(voxels[v].colour);
    }
  }
  return sums;
}

// How far in front of what a map shows at its nearest pixel a point lies; below 0 outside the map.
double in_front(const Map& m, const double point[3]) {
  double p[3] = {0, 0, 0}, square = 0;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) p[i] += m.R[3 * k + i] * (point[k] - m.t[k]);
    square += p[i] * p[i];
  }
  const double x = std::floor(m.camera.fx * p[0] / p[2] + m.camera.cx + 0.5);
  const double y = std::floor(m.camera.fy * p[1] / p[2] + m.camera.cy + 0.5);
  if (!(p[2] > 0 && x >= 0 && y >= 0 && x < m.camera.width && y < m.camera.height)) return -1;
  return static_cast<double>(m.distance[static_cast<size_t>(y * m.camera.width + x)]) -
         std::sqrt(square);
}

void test_voxels_are_seen_through_by_the_maps_that_see_farther() {
  std::vector<Map> maps = tour(hall(), box_room::pinhole(160, 120, 110), 5, 0.02f);
  // One is noise, which makes blocks anywhere before the surfaces of the others.
  tv::Random random = tv::random_seeded(7);
  for (float& d : maps[2].distance)
    d *= 0.1f + 0.001f * static_cast<float>(tv::random_below(random, 900));
  tv_room* room = new_room(0.06);
  for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
  int num_free = 0, num_wrong = 0;
  for (int32_t k = 0; k < room->end_blocks; ++k) {
    if (room->blocks[k].key == 0) continue;
    const tv::BlockPlace at = tv::place_of(room->blocks[k].key);
    const double corner[3] = {at.x * 0.24, at.y * 0.24, at.z * 0.24};
    const double centre[3] = {corner[0] + 0.12, corner[1] + 0.12, corner[2] + 0.12};
    for (int32_t v = 0; v < tv::kBlockVoxels; ++v) {
      const double voxel[3] = {corner[0] + 0.06 * (v % 4 + 0.5),
                               corner[1] + 0.06 * (v / 4 % 4 + 0.5),
                               corner[2] + 0.06 * (v / 16 + 0.5)};
      int at_least = 0, at_most = 0;
      for (const Map& m : maps) {
        const bool is_free = in_front(m, voxel) > 3 * 0.06;
        at_most += is_free;
        at_least += is_free && in_front(m, centre) > -1;
      }
      const int32_t num = tv::free_count(tv::voxels_of(*room, k)[v].evidence);
      num_free += num;
      num_wrong += num < at_least || num > at_most;
    }
  }
  TEST_ASSERT_TRUE(num_free > 10000);
  TEST_ASSERT_EQUAL(0, num_wrong);
}

// Fusion compares blocks with squares of a map whose size follows from the room's memory.
void test_the_voxels_are_the_same_in_little_memory_as_in_much() {
  std::vector<Map> maps = tour(hall(), box_room::pinhole(640, 480, 440), 4, 0.02f);
  for (size_t k = 0; k < maps[1].distance.size(); k += 7) maps[1].distance[k] = 0;
  std::map<uint64_t, std::vector<uint64_t>> sums[2][3];
  for (const bool little : {false, true}) {
    tv_room* room = new_room(0.3, little ? TV_ROOM_MIN_BYTES : sizeof memory);
    for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
    sums[little][0] = sums_of(room);
    for (const Map& m : maps) TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
    sums[little][1] = sums_of(room);
    TEST_ASSERT_EQUAL(TV_OK, remove(room, maps[2]));
    sums[little][2] = sums_of(room);
  }
  TEST_ASSERT_TRUE(sums[0][0].size() > 50);
  TEST_ASSERT_TRUE(sums[0][1] != sums[0][0]);
  for (int k = 0; k < 3; ++k) TEST_ASSERT_TRUE(sums[0][k] == sums[1][k]);
}

void test_distances_that_are_none_are_unknown() {
  const float odd[] = {0.0f, -1.0f, NAN, INFINITY, -INFINITY, 1e-38f, 3e38f};
  tv_room* room = new_room();
  Map m = wall_at(2.007, Vec3(0, 0, 0), 0.01f);
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  mesh(room);
  const std::vector<tv_room_vertex> was = vertices;
  TEST_ASSERT_EQUAL(TV_OK, remove(room, m));
  for (size_t k = 0; k < m.distance.size(); ++k) {
    if (k / 160 % 2 != 0) m.distance[k] = odd[k % 5];
  }
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  mesh(room);
  TEST_ASSERT_TRUE(vertices.size() > was.size() * 9 / 10);
  for (const tv_room_vertex& v : vertices) {
    TEST_ASSERT_FLOAT_WITHIN(0.01f, 2.007f, v.position[1]);
  }
  TEST_ASSERT_EQUAL(TV_OK, remove(room, m));
  // Nothing is known at all, by each of the ways to say so.
  for (int way = 0; way < 5; ++way) {
    Map none = wall_at(2.007, Vec3(0, 0, 0), 0.01f);
    const std::vector<uint8_t> witnesses(none.distance.size(), 0);
    for (size_t k = 0; k < none.distance.size(); ++k) {
      if (way == 0) none.distance[k] = odd[k % 7];
      if (way == 1) none.sigma[k] = k % 2 != 0 ? NAN : 0.0f;
      if (way == 2) none.sigma[k] = k % 2 != 0 ? INFINITY : -1.0f;
      if (way == 3) none.sigma[k] = 1.0f;  // weighs nothing
    }
    if (way == 4) none.map.witnesses = witnesses.data();
    TEST_ASSERT_EQUAL(TV_OK, add(room, none));
    mesh(room);
    TEST_ASSERT_EQUAL(0, vertices.size());
    TEST_ASSERT_EQUAL(TV_OK, remove(room, none));
  }
  // Poses beyond what blocks can be counted to.
  Map far = wall_at(2, Vec3(0, 0, 0), 0.01f);
  far.t[0] = 1e15;
  TEST_ASSERT_EQUAL(TV_OK, add(room, far));
  mesh(room);
  TEST_ASSERT_EQUAL(0, vertices.size());
}

void test_small_pieces_are_left_out() {
  tv_room* room = new_room();
  Map m = wall_at(2.007, Vec3(0, 0, 0), 0.01f);
  for (size_t y = 40; y < 80; ++y) {
    for (size_t x = 70; x < 78; ++x)
      m.distance[y * 160 + x] = x < 76 && y > 56 && y < 63 ? 1.5f : 0;
  }
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  options.min_piece_triangles = 0;
  mesh(room, &options);
  TEST_ASSERT_TRUE(vertices_near(1.5) > 0);
  mesh(room);
  TEST_ASSERT_EQUAL(0, vertices_near(1.5));
  TEST_ASSERT_TRUE(vertices_near(2.007) > 1000);
  // With the pieces go their vertices: each that is left is of a triangle.
  std::vector<bool> is_used(vertices.size());
  for (const tv_room_triangle& t : triangles)
    for (const int32_t idx : t.idx_vertex) is_used[static_cast<size_t>(idx)] = true;
  for (const bool used : is_used) TEST_ASSERT_TRUE(used);
}

// ---- Planes, and what is inferred along them.

// Whether a point of the hall has texture: within 15 cm of the edges, on the ball, on posters.
bool has_texture(const Scene& scene, const Vec3& p, int* wall) {
  double inner = 9;
  *wall = 0;
  for (int i = 0; i < 3; ++i) {
    const double a = p[i] - scene.low[i], b = scene.high[i] - p[i];
    if (a < 1e-3) *wall = 2 * i + 1;
    if (b < 1e-3) *wall = 2 * i + 2;
    if (a >= 1e-3 && b >= 1e-3) inner = std::min({inner, a, b});
  }
  const bool poster = *wall >= 1 && *wall <= 4 && std::fabs(p[2] - 1.4) < 0.2 &&
                      std::fmod(p[0] + p[1] + 3, 1.5) < 0.4;
  return *wall == 0 || inner < 0.15 || poster;
}

// Leaves only the distances where there is texture, and paints the walls plain elsewhere.
void make_plain(const Scene& scene, Map* m, uint64_t seed) {
  const tv::Camera lens = tv::prepare_camera(m->camera);
  const Eigen::Map<const tv::Mat3> R(m->R);
  const Vec3 from(m->t[0], m->t[1], m->t[2]);
  tv::Random random = tv::random_seeded(seed);
  for (size_t k = 0; k < m->distance.size(); ++k) {
    Vec3 ray;
    TEST_ASSERT_TRUE(tv::unproject(
        lens,
        tv::Vec2(static_cast<int>(k) % m->camera.width, static_cast<int>(k) / m->camera.width),
        &ray, nullptr));
    const Vec3 p = from + static_cast<double>(m->distance[k]) * (R * ray);
    int wall;
    const bool textured = has_texture(scene, p, &wall);
    const double grey = textured ? scene::uniform(&random, 60, 200) : 160 + 8 * wall;
    const double noisy = grey + scene::uniform(&random, -2, 2);
    for (size_t c = 0; c < 3; ++c) m->pixels[3 * k + c] = static_cast<uint8_t>(noisy);
    if (!textured) m->distance[k] = 0;
    m->distance[k] *= static_cast<float>(1 + scene::uniform(&random, -0.005, 0.005));
  }
}

struct Planes {
  tv_room_plane planes[TV_ROOM_MAX_PLANES];
  int32_t num;
};

Planes find_planes(tv_room* room, bool with_gravity, int32_t min_maps_behind = 1) {
  Planes found;
  tv_room_plane_options options;
  tv_room_plane_options_init(&options);
  options.min_maps_behind = min_maps_behind;
  if (with_gravity) options.gravity[2] = -9.81;
  TEST_ASSERT_EQUAL(
      TV_OK, tv_room_find_planes(room, &options, found.planes, TV_ROOM_MAX_PLANES, &found.num));
  return found;
}

// What is inferred for a map, which lives as long as these arrays.
Map infer(tv_room* room, const Map& m, const Planes& planes, int32_t* num) {
  alignas(64) static uint8_t scratch[1 << 20];
  Map inferred = m;
  const tv_depth_map map = box_room::given(m);
  tv_room_infer_options options;
  tv_room_infer_options_init(&options);
  options.planes = planes.planes;
  options.num_planes = planes.num;
  TEST_ASSERT_EQUAL(TV_OK, tv_room_infer(room, scratch, sizeof scratch, &map, &options,
                                         inferred.distance.data(), inferred.sigma.data(), num));
  box_room::aim(&inferred);
  inferred.map.inferred = 1;
  return inferred;
}

void test_plain_walls_are_found_by_their_edges_and_inferred_between() {
  const Scene scene = hall();
  const tv_camera camera = box_room::pinhole(240, 180, 170);
  const std::vector<Map> truths = tour(scene, camera, 24, 0.02f);
  std::vector<Map> maps = truths, inferred(24);
  tv_room* room = new_room();
  for (size_t k = 0; k < maps.size(); ++k) {
    make_plain(scene, &maps[k], k + 1);
    box_room::aim(&maps[k]);
    TEST_ASSERT_EQUAL(TV_OK, add(room, maps[k]));
  }
  const Planes planes = find_planes(room, true);
  TEST_ASSERT_EQUAL(6, planes.num);
  int upright = 0, level = 0;
  for (int k = 0; k < 6; ++k) {
    const tv_room_plane& p = planes.planes[k];
    int axis = 0;
    for (int i = 1; i < 3; ++i)
      axis = std::fabs(p.normal[i]) > std::fabs(p.normal[axis]) ? i : axis;
    TEST_ASSERT_TRUE(std::fabs(p.normal[axis]) > 0.9999);
    const double at = p.normal[axis] > 0 ? scene.low[axis] : -scene.high[axis];
    TEST_ASSERT_DOUBLE_WITHIN(0.01, at, p.offset);
    upright += p.kind == TV_ROOM_PLANE_UPRIGHT, level += p.kind == TV_ROOM_PLANE_LEVEL;
    TEST_ASSERT_TRUE(k == 0 || p.area <= 1.2 * planes.planes[k - 1].area);
  }
  TEST_ASSERT_EQUAL(4, upright);
  TEST_ASSERT_EQUAL(2, level);
  int64_t pixels = 0, wrong = 0;
  for (size_t k = 0; k < maps.size(); ++k) {
    int32_t num;
    inferred[k] = infer(room, maps[k], planes, &num);
    const Map& truth = truths[k];
    for (size_t i = 0; i < truth.distance.size(); ++i) {
      if (inferred[k].distance[i] == 0) continue;
      TEST_ASSERT_TRUE(maps[k].distance[i] == 0 && inferred[k].sigma[i] > 0);
      ++pixels, --num;
      wrong += std::fabs(inferred[k].distance[i] - truth.distance[i]) > 0.05f;
    }
    TEST_ASSERT_EQUAL(0, num);
  }
  TEST_ASSERT_TRUE(pixels > 300000);
  TEST_ASSERT_TRUE(wrong * 50 < pixels);
  mesh(room);
  const size_t measured = vertices.size();
  for (const Map& m : inferred) TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  for (const Map& m : maps) {
    TEST_ASSERT_EQUAL(TV_OK, see_through(room, m));
  }
  mesh(room);
  size_t num_inferred = 0, off = 0;
  for (size_t v = 0; v < vertices.size(); ++v) {
    num_inferred += vertices[v].inferred;
    off += distance_to(scene, position(static_cast<int32_t>(v))) > 0.05;
  }
  TEST_ASSERT_TRUE(num_inferred > 20000);
  TEST_ASSERT_TRUE(off * 100 < vertices.size());
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  options.measured_only = 1;
  mesh(room, &options);
  TEST_ASSERT_EQUAL(measured, vertices.size());
  for (const tv_room_vertex& v : vertices) TEST_ASSERT_EQUAL(0, v.inferred);
}

// Two noisy walls side by side, one 6 cm behind the other. More of the surface lies near an oblique
// plane through both than near either wall.
void test_walls_that_are_nearly_in_line_are_planes_of_their_own() {
  const double kNear = 2.007, kFar = 2.067;
  tv::Random random = tv::random_seeded(5);
  tv_room* room = new_room();
  for (int k = 0; k < 2; ++k) {
    Map m = wall_at(kNear, Vec3(0, 0, 0), 0.02f);
    for (size_t i = 0; i < m.distance.size(); ++i) {
      const size_t x = i % 160;
      const double to_wall = x < 70 ? 1 : x < 90 ? 0 : kFar / kNear;
      m.distance[i] *= static_cast<float>(to_wall * (1 + scene::uniform(&random, -0.01, 0.01)));
    }
    TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  }
  const Planes planes = find_planes(room, false);
  TEST_ASSERT_EQUAL(2, planes.num);
  for (int k = 0; k < 2; ++k) {
    const tv_room_plane& p = planes.planes[k];
    TEST_ASSERT_TRUE(p.normal[1] < -0.9999);  // within 0.8 degrees
    TEST_ASSERT_DOUBLE_WITHIN(0.005, p.centre[0] < 0 ? kNear : kFar, p.centre[1]);
  }
  TEST_ASSERT_TRUE(planes.planes[0].centre[0] * planes.planes[1].centre[0] < 0);
}

// A wall that was measured with waves of 2 cm, at their sigma, and a box before it.
void test_surface_on_a_plane_is_drawn_to_it_and_other_surface_stays() {
  const double kWall = 2.007, kBox = 1.6;
  Map m = wall_at(kWall, Vec3(0, 0, 0), 0.02f);
  for (size_t y = 0; y < 120; ++y) {
    for (size_t x = 0; x < 160; ++x) {
      const float wave = 0.02f * ((x / 20 + y / 20) % 2 == 0 ? 1.0f : -1.0f);
      const bool on_box = x >= 60 && x < 100 && y >= 40 && y < 80;
      float& distance = m.distance[y * 160 + x];
      distance = on_box ? distance * static_cast<float>(kBox / kWall) : distance + wave;
    }
  }
  tv_room* room = new_room();
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  const Planes planes = find_planes(room, false);
  TEST_ASSERT_TRUE(planes.num >= 1);
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  const auto rms_of_wall = [&](double* most_sigma) {
    mesh(room, &options);
    double sum = 0, count = 0;
    *most_sigma = 0;
    for (const tv_room_vertex& v : vertices) {
      const double away = static_cast<double>(v.position[1]) - kWall;
      if (std::fabs(away) > 0.1 || v.normal[1] > -0.9f) continue;
      sum += away * away, ++count;
      *most_sigma = std::max(*most_sigma, static_cast<double>(v.sigma));
    }
    TEST_ASSERT_TRUE(count > 1000);
    return std::sqrt(sum / count);
  };
  double sigma_before, sigma_after;
  const double before = rms_of_wall(&sigma_before);
  const std::vector<tv_room_vertex> all = vertices;
  options.planes = planes.planes;
  options.num_planes = 1;
  const double after = rms_of_wall(&sigma_after);
  TEST_ASSERT_TRUE(before > 0.01 && after < 0.5 * before);
  TEST_ASSERT_TRUE(sigma_before > 0.015 && sigma_after <= kVoxel / 3 && sigma_after > 0.005);
  TEST_ASSERT_EQUAL(all.size(), vertices.size());
  for (size_t v = 0; v < all.size(); ++v) {
    if (static_cast<double>(all[v].position[1]) < kBox + 0.1)
      TEST_ASSERT_EQUAL_MEMORY(&all[v], &vertices[v], 40);
  }
}

void test_surface_of_a_large_sigma_is_left_out_when_wanted() {
  Map m = wall_at(2.007, Vec3(0, 0, 0), 0.02f);
  for (size_t i = 0; i < m.sigma.size(); ++i)
    if (i % 160 >= 80) m.sigma[i] = 0.06f;
  tv_room* room = new_room();
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  mesh(room);
  const size_t all = vertices.size();
  tv_room_mesh_options options;
  tv_room_mesh_options_init(&options);
  options.max_sigma = 0.045;
  mesh(room, &options);
  TEST_ASSERT_TRUE(vertices.size() > all / 3 && vertices.size() < 2 * all / 3);
  for (const tv_room_vertex& v : vertices) TEST_ASSERT_TRUE(v.sigma <= 0.045f);
  for (const tv_room_triangle& t : triangles)
    for (const int32_t idx : t.idx_vertex)
      TEST_ASSERT_TRUE(static_cast<size_t>(idx) < vertices.size());
}

// A wall with an opening into another room: nothing is carried across it, although its middle is
// plain and the wall borders on it, because farther things were measured around its middle.
void test_a_plane_is_not_carried_where_farther_things_were_measured() {
  const tv_camera camera = box_room::pinhole(160, 120, 110);
  const Vec3 from(0, 0, 0);
  Scene wall, other;
  wall.normal = other.normal = Vec3(0, 1, 0);
  wall.offset = 2, other.offset = 3;
  Map m = box_room::see(wall, camera, from, Vec3(0, 1, 0), 0.02f);
  const Map behind = box_room::see(other, camera, from, Vec3(0, 1, 0), 0.02f);
  for (size_t y = 0; y < 120; ++y) {
    for (size_t x = 0; x < 160; ++x) {
      const size_t k = y * 160 + x;
      const bool left = x < 50, frame = y < 12 || y >= 108;
      const int grey = left || frame ? static_cast<int>((x * 71 ^ y * 37) % 200) : 150;
      for (size_t c = 0; c < 3; ++c) m.pixels[3 * k + c] = static_cast<uint8_t>(grey);
      if (!left && frame) m.distance[k] = behind.distance[k];  // all around the door
      if (!left && !frame) m.distance[k] = 0;
    }
  }
  box_room::aim(&m);
  tv_room* room = new_room();
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  Planes planes = find_planes(room, false);
  TEST_ASSERT_TRUE(planes.num >= 1);
  TEST_ASSERT_DOUBLE_WITHIN(0.01, -2, planes.planes[0].offset);
  TEST_ASSERT_TRUE(planes.planes[0].share_behind > 0.1);
  int32_t num;
  planes.num = 1;
  infer(room, m, planes, &num);
  TEST_ASSERT_EQUAL(0, num);
}

// What one map alone saw behind a wall is no evidence that the room goes on there.
void test_what_one_map_saw_behind_a_wall_counts_only_where_one_is_enough() {
  Map first = wall_at(2, Vec3(0, 0, 0), 0.02f);
  const Map second = wall_at(2, Vec3(0.05, 0, 0), 0.02f);
  for (size_t k = 0; k < first.distance.size(); ++k)
    if (k % 160 >= 140) first.distance[k] *= 1.5f;
  box_room::aim(&first);
  tv_room* room = new_room();
  TEST_ASSERT_EQUAL(TV_OK, add(room, first));
  TEST_ASSERT_EQUAL(TV_OK, add(room, second));
  const Planes of_one = find_planes(room, false, 1), of_two = find_planes(room, false, 2);
  TEST_ASSERT_TRUE(of_one.num >= 1 && of_two.num == of_one.num);
  TEST_ASSERT_DOUBLE_WITHIN(0.01, -2, of_one.planes[0].offset);
  TEST_ASSERT_TRUE(of_one.planes[0].share_behind > 0.03);
  TEST_ASSERT_EQUAL_DOUBLE(0, of_two.planes[0].share_behind);
}

// A plain wall through a lens whose corners are black, with texture in stripes alone: the wall is
// carried up to the edge of what the lens shows and not into the corners, which are plain as well.
void test_a_plane_is_carried_to_the_edge_of_the_mask_and_no_farther() {
  constexpr int kWidth = 160, kHeight = 120;
  Map m = wall_at(2, Vec3(0, 0, 0), 0.02f);
  const Map truth = m;
  std::vector<uint8_t> mask(kWidth * kHeight);
  const auto at = [](int x, int y) { return static_cast<size_t>(y * kWidth + x); };
  const auto is_shown = [](int x, int y) {
    const double dx = x - 79.5, dy = y - 59.5;
    return dx * dx + dy * dy < 80.0 * 80.0;
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool textured = x % 60 < 12;
      mask[at(x, y)] = is_shown(x, y) ? 1 : 0;
      const int grey = !is_shown(x, y) ? 0 : textured ? (x * 71 ^ y * 37) % 200 : 150;
      for (size_t c = 0; c < 3; ++c) m.pixels[3 * at(x, y) + c] = static_cast<uint8_t>(grey);
      if (!textured) m.distance[at(x, y)] = 0;
    }
  }
  const auto aim = [&] {
    box_room::aim(&m);
    m.map.mask = mask.data();
    m.map.mask_stride_bytes = kWidth;
  };
  aim();
  tv_room* room = new_room();
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  mesh(room);
  const size_t measured = vertices.size();
  const Planes planes = find_planes(room, false);
  TEST_ASSERT_EQUAL(1, planes.num);
  const auto expect_inferred = [&] {
    int32_t num;
    const Map inferred = infer(room, m, planes, &num);
    int edge = 0, carried = 0;
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float d = inferred.distance[at(x, y)];
        TEST_ASSERT_TRUE(is_shown(x, y) || d == 0);
        TEST_ASSERT_TRUE(d == 0 || std::fabs(d - truth.distance[at(x, y)]) < 0.02f);
        // The shown pixels beside the edge, in a column without texture.
        const bool beside = is_shown(x, y) && (!is_shown(x, y - 1) || !is_shown(x, y + 1));
        if (!beside || x % 60 < 24 || x % 60 >= 48) continue;
        ++edge, carried += d > 0;
      }
    }
    TEST_ASSERT_TRUE(edge > 30);
    TEST_ASSERT_EQUAL(edge, carried);
  };
  expect_inferred();
  // Distances that a map claims where its mask is 0 are not read.
  for (int k = 0; k < kWidth * kHeight; ++k)
    if (mask[static_cast<size_t>(k)] == 0) m.distance[static_cast<size_t>(k)] = 1;
  aim();
  expect_inferred();
  TEST_ASSERT_EQUAL(TV_OK, add(room, m));
  mesh(room);
  TEST_ASSERT_TRUE(vertices.size() < measured + measured / 8);
  TEST_ASSERT_EQUAL(0, vertices_near(1));
  m.map.mask = nullptr;  // another map
  TEST_ASSERT_EQUAL(TV_ERR_ARGUMENT, remove(room, m));
  aim();
  TEST_ASSERT_EQUAL(TV_OK, remove(room, m));
}

void test_an_inferred_wall_that_a_map_sees_through_vanishes() {
  tv_room* room = new_room();
  Map inferred = wall_at(1, Vec3(0, 0, 0), 0.02f);
  inferred.map.inferred = 1;
  const Map measured = wall_at(2, Vec3(0, 0, 0), 0.02f);
  TEST_ASSERT_EQUAL(TV_OK, add(room, measured));
  TEST_ASSERT_EQUAL(TV_OK, add(room, inferred));
  mesh(room);
  TEST_ASSERT_EQUAL(0, vertices_near(1));  // one map alone infers nothing
  inferred.t[0] = 0.05;
  TEST_ASSERT_EQUAL(TV_OK, add(room, inferred));
  mesh(room);
  TEST_ASSERT_TRUE(vertices_near(1) > 500);
  TEST_ASSERT_EQUAL(TV_OK, see_through(room, measured));
  mesh(room);
  TEST_ASSERT_EQUAL(0, vertices_near(1));
  TEST_ASSERT_TRUE(vertices_near(2) > 500);
}

// The same distances as measured and as inferred ones, through a wide truncation.
void test_an_inferred_wall_takes_few_blocks_for_the_same_surface() {
  tv_room_options options;
  tv_room_options_init(&options);
  options.truncation_voxels = 6;
  int32_t blocks[2];
  size_t num[2];
  for (int inferred = 0; inferred < 2; ++inferred) {
    tv_room* room = nullptr;
    TEST_ASSERT_EQUAL(TV_OK, tv_room_init(&room, &options, memory, sizeof memory));
    for (int k = 0; k < 2; ++k) {
      Map m = wall_at(2.007, Vec3(0, 0, 0), 0.02f);
      m.map.inferred = inferred;
      TEST_ASSERT_EQUAL(TV_OK, add(room, m));
    }
    tv_room_state state;
    tv_room_state_init(&state);
    TEST_ASSERT_EQUAL(TV_OK, tv_room_get_state(room, &state));
    mesh(room);
    blocks[inferred] = state.num_blocks, num[inferred] = vertices.size();
    for (const tv_room_vertex& v : vertices)
      TEST_ASSERT_FLOAT_WITHIN(0.003f, 2.007f, v.position[1]);
  }
  TEST_ASSERT_TRUE(4 * blocks[1] < 3 * blocks[0]);
  TEST_ASSERT_TRUE(num[0] > 2000 && 100 * num[1] > 98 * num[0]);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_plane_between_voxels_is_where_it_is);
  RUN_TEST(test_a_ball_is_closed_and_its_signed_volume_is_right);
  RUN_TEST(test_removing_a_map_restores_the_room_bit_for_bit);
  RUN_TEST(test_a_room_seen_from_inside_through_every_lens);
  RUN_TEST(test_what_others_see_through_vanishes_and_one_error_removes_no_wall);
  RUN_TEST(test_a_map_sees_through_later_blocks_when_told_and_is_removed_exactly_then);
  RUN_TEST(test_a_room_that_is_full_keeps_what_it_has_and_goes_on_coarser);
  RUN_TEST(test_what_was_pruned_comes_back_where_another_map_confirms_it);
  RUN_TEST(test_voxels_are_seen_through_by_the_maps_that_see_farther);
  RUN_TEST(test_the_voxels_are_the_same_in_little_memory_as_in_much);
  RUN_TEST(test_distances_that_are_none_are_unknown);
  RUN_TEST(test_small_pieces_are_left_out);
  RUN_TEST(test_plain_walls_are_found_by_their_edges_and_inferred_between);
  RUN_TEST(test_walls_that_are_nearly_in_line_are_planes_of_their_own);
  RUN_TEST(test_surface_on_a_plane_is_drawn_to_it_and_other_surface_stays);
  RUN_TEST(test_surface_of_a_large_sigma_is_left_out_when_wanted);
  RUN_TEST(test_a_plane_is_not_carried_where_farther_things_were_measured);
  RUN_TEST(test_what_one_map_saw_behind_a_wall_counts_only_where_one_is_enough);
  RUN_TEST(test_a_plane_is_carried_to_the_edge_of_the_mask_and_no_farther);
  RUN_TEST(test_an_inferred_wall_that_a_map_sees_through_vanishes);
  RUN_TEST(test_an_inferred_wall_takes_few_blocks_for_the_same_surface);
  return UNITY_END();
}
