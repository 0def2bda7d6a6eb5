// The lines of a room's plan, of a surface that is known exactly.
#include <unity.h>

#include <algorithm>
#include <cmath>

#include "room_model/plan.h"
#include "room_model/plan_lines.h"

using cli::PlanLine;
using cli::RoomModel;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr double kVoxel = 0.03, kWidth = 4, kDepth = 3, kWave = 0.015;

// An upright surface from (x0, y0) to (x1, y1), whose free side is to the right, from the floor
// up to a height; with waves.
void add_surface(RoomModel& model, cv::Point2d from, cv::Point2d to, double height) {
  const cv::Point2d along = (to - from) / cv::norm(to - from), normal(along.y, -along.x);
  int k = 0;
  for (double s = 0; s <= cv::norm(to - from); s += kVoxel) {
    for (double z = 0; z <= height; z += kVoxel) {
      const cv::Point2d p = from + s * along + (++k % 2 == 0 ? kWave : -kWave) * normal;
      tv_room_vertex v = {};
      v.position[0] = static_cast<float>(p.x), v.position[1] = static_cast<float>(p.y);
      v.position[2] = static_cast<float>(z);
      v.normal[0] = static_cast<float>(normal.x), v.normal[1] = static_cast<float>(normal.y);
      model.vertices.push_back(v);
    }
  }
}

void add_plane(RoomModel& model, cv::Point2d from, cv::Point2d to, bool is_wall) {
  const cv::Point2d along = (to - from) / cv::norm(to - from), normal(along.y, -along.x);
  tv_room_plane plane = {};
  plane.normal[0] = normal.x, plane.normal[1] = normal.y;
  plane.offset = normal.dot(from);
  plane.centre[0] = 0.5 * (from.x + to.x), plane.centre[1] = 0.5 * (from.y + to.y);
  plane.area = cv::norm(to - from);
  plane.sigma = kWave;
  plane.share_behind = is_wall ? 0 : 0.2;
  plane.kind = TV_ROOM_PLANE_UPRIGHT;
  model.planes.push_back(plane);
}

// Four walls: a cupboard hides the middle of the lower one, of which the right part was fused
// twice, 6 cm apart; the left one was not measured in its lowest 10 cm. At the right wall stand two
// cupboards of different depths, which the library takes for one slanted plane.
RoomModel a_room() {
  RoomModel model;
  model.voxel = kVoxel;
  model.up = {0, 0, 1};
  const auto both = [&model](cv::Point2d from, cv::Point2d to, bool is_wall) {
    add_surface(model, from, to, 2.4);
    add_plane(model, from, to, is_wall);
  };
  both({1.5, 0}, {0.02, 0}, true);
  both({kWidth, 0}, {2.5, 0}, true);
  both({kWidth, 0.06}, {2.5, 0.06}, true);
  both({0, 0.1}, {0, kDepth}, true);
  both({0, kDepth}, {kWidth, kDepth}, true);
  both({kWidth, kDepth}, {kWidth, 0}, true);
  both({2.5, 0.4}, {1.5, 0.4}, false);
  add_surface(model, {3.5, 1.5}, {3.5, 0.5}, 1.8);
  add_surface(model, {3.43, 2.6}, {3.43, 1.56}, 1.8);
  add_plane(model, {3.41, 2.6}, {3.52, 0.5}, false);
  model.free_cell = 1.5 * kVoxel;
  model.free_origin = {-1, -1};
  model.free_cells = cv::Mat::zeros(120, 140, CV_8U);
  for (int y = 0; y < 120; ++y)
    for (int x = 0; x < 140; ++x) {
      const cv::Point2d p = model.free_origin + model.free_cell * cv::Point2d(x + 0.5, y + 0.5);
      if (p.x > 0 && p.x < kWidth && p.y > 0 && p.y < kDepth)
        model.free_cells.at<uint8_t>(y, x) = 255;
    }
  return model;
}

size_t count(const std::vector<PlanLine>& lines, bool is_wall, bool is_carried) {
  return static_cast<size_t>(std::count_if(lines.begin(), lines.end(), [&](const PlanLine& line) {
    return line.is_wall == is_wall && line.is_carried == is_carried;
  }));
}

// How many ends of lines lie within 5 cm of a point; they must lie there together.
int ends_at(const std::vector<PlanLine>& lines, const cv::Point2d& place) {
  std::vector<cv::Point2d> ends;
  for (const PlanLine& line : lines)
    for (const cv::Point2d& end : {line.a, line.b})
      if (cv::norm(end - place) < 0.05) ends.push_back(end);
  for (const cv::Point2d& end : ends) TEST_ASSERT_TRUE(cv::norm(end - ends[0]) < 1e-9);
  return static_cast<int>(ends.size());
}

void test_one_wall_is_one_line_and_walls_meet_at_corners() {
  const std::vector<PlanLine> lines = cli::plan_lines(a_room());
  TEST_ASSERT_EQUAL(5, count(lines, true, false));  // the lower one is seen in two parts
  TEST_ASSERT_EQUAL(1, count(lines, true, true));   // and goes on behind the cupboard
  const cv::Point2d corners[] = {{0, 0}, {0, kDepth}, {kWidth, kDepth}, {kWidth, 0.03}};
  for (const cv::Point2d& corner : corners) TEST_ASSERT_EQUAL(2, ends_at(lines, corner));
  for (const PlanLine& line : lines) {
    if (!line.is_carried) continue;
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 2.5, line.a.x);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1.5, line.b.x);
  }
}

void test_fronts_of_different_depth_are_lines_along_the_walls() {
  const std::vector<PlanLine> lines = cli::plan_lines(a_room());
  TEST_ASSERT_EQUAL(3, count(lines, false, false));
  double found = 0;
  for (const PlanLine& line : lines) {
    if (line.is_wall || line.normal().x > -0.5) continue;
    TEST_ASSERT_DOUBLE_WITHIN(1e-9, line.a.x, line.b.x);
    TEST_ASSERT_DOUBLE_WITHIN(0.01, line.a.y > 1.52 ? 3.43 : 3.5, line.a.x);
    TEST_ASSERT_DOUBLE_WITHIN(0.05, 1.8, line.high - line.low);
    found += line.a.y - line.b.y;
  }
  TEST_ASSERT_DOUBLE_WITHIN(0.15, 2.04, found);
}

void test_a_wall_that_was_looked_through_has_a_gap() {
  RoomModel model = a_room();
  model.free_cells.setTo(255);
  const std::vector<PlanLine> lines = cli::plan_lines(model);
  TEST_ASSERT_EQUAL(0, count(lines, true, true));
}

void test_a_model_without_planes_has_no_walls() {
  RoomModel model = a_room();
  model.planes.clear();
  TEST_ASSERT_EQUAL(0, count(cli::plan_lines(model), true, false));
  model.vertices.clear();
  TEST_ASSERT_EQUAL(0, cli::plan_lines(model).size());
}

// A leg stands in the middle of the floor; beside it, and at the edges of the floor's holes,
// normals are wrong at one height.
void test_what_stands_is_drawn_and_wrong_normals_are_not() {
  RoomModel model;
  model.voxel = kVoxel;
  model.up = {0, 0, 1};
  model.free_cells = cv::Mat::zeros(20, 20, CV_8U);
  const auto add = [&model](double x, double y, double z) {
    tv_room_vertex v = {};
    v.position[0] = static_cast<float>(x), v.position[1] = static_cast<float>(y);
    v.position[2] = static_cast<float>(z), v.normal[0] = 1;
    model.vertices.push_back(v);
  };
  for (double z = 0.015; z < 0.4; z += kVoxel) add(2.01, 1.01, z);
  for (double x = 0.1; x < 1.9; x += 0.01) add(x, 0.5, 0.01);
  const cli::RoomPlan plan = cli::plan_of(cli::RoomScene{}, model);
  TEST_ASSERT_EQUAL(1, plan.upright.size());
  TEST_ASSERT_TRUE(plan.upright[0].contains({2.01, 1.01}));
}

}  // namespace

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_one_wall_is_one_line_and_walls_meet_at_corners);
  RUN_TEST(test_fronts_of_different_depth_are_lines_along_the_walls);
  RUN_TEST(test_a_wall_that_was_looked_through_has_a_gap);
  RUN_TEST(test_a_model_without_planes_has_no_walls);
  RUN_TEST(test_what_stands_is_drawn_and_wrong_normals_are_not);
  return UNITY_END();
}
