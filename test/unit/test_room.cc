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
  TEST_ASSERT_EQUAL(TV_OK, tv_room_init(&options, memory, bytes, &room));
  return room;
}

tv_status add(tv_room* room, const Map& m) {
  return tv_room_add(room, &m.camera, m.R, m.t, &m.map);
}

tv_status remove(tv_room* room, const Map& m) {
  return tv_room_remove(room, &m.camera, m.R, m.t, &m.map);
}

void mesh(tv_room* room, const tv_room_mesh_options* options = nullptr) {
  int32_t nv, nt;
  const tv_status status = tv_room_mesh(room, options, nullptr, 0, nullptr, 0, &nv, &nt);
  TEST_ASSERT_EQUAL(nv == 0 ? TV_OK : TV_ERR_CAPACITY, status);
  vertices.resize(static_cast<size_t>(nv));
  triangles.resize(static_cast<size_t>(nt));
  TEST_ASSERT_EQUAL(
      TV_OK, tv_room_mesh(room, options, vertices.data(), nv, triangles.data(), nt, &nv, &nt));
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

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_plane_between_voxels_is_where_it_is);
  RUN_TEST(test_a_ball_is_closed_and_its_signed_volume_is_right);
  RUN_TEST(test_removing_a_map_restores_the_room_bit_for_bit);
  return UNITY_END();
}
