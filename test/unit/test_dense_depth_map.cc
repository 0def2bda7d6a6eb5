// Tests of the depth map of several views: against a scene whose depth is known exactly, through
// each lens, with views to all sides and ahead; its standard deviations; what hides behind the
// ball.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstring>
#include <vector>

#include "support/ball_scene.h"
#include "twoview/twoview.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using ball_scene::distance_to_scene;
using ball_scene::render;
using tv::Mat3;
using tv::Vec3;

constexpr int kWidth = 320, kHeight = 240, kViews = 5;
// Enough that the larger map of a lens that bends lines outwards is not reduced.
constexpr int kMapPixels = 2 * kWidth * kHeight;

alignas(64) uint8_t memory[80 << 20];
uint8_t pixels[kViews][kWidth * kHeight];
float distances[kMapPixels], sigmas[kMapPixels];
uint8_t witnesses[kMapPixels], grey[kMapPixels];

tv_camera camera_of(int model, std::initializer_list<double> k) {
  tv_camera camera = {model, kWidth, kHeight, 0, 260, 262, 163, 117, {}};
  std::copy(k.begin(), k.end(), camera.k);
  return camera;
}

// Centres of the views in the frame of the first, and their turns about an axis.
struct Pose {
  Vec3 centre, axis;
  double angle;
};

const Pose kAround[kViews] = {{{0, 0, 0}, {0, 0, 1}, 0},
                              {{0.3, 0.02, 0}, {0, 1, 0}, -0.06},
                              {{-0.3, 0, 0.05}, {0, 1, 0}, 0.05},
                              {{0.02, 0.25, 0}, {0, 0, 1}, 0.08},
                              {{0, -0.25, -0.1}, {1, 0, 0.3}, 0.04}};
const Pose kAhead[kViews] = {{{0, 0, 0}, {0, 0, 1}, 0},
                             {{0.1, 0, 0.5}, {0, 0, 1}, 0},
                             {{0.05, 0.1, 0.3}, {0, 1, 0}, 0.03},
                             {{0, -0.1, -0.3}, {0, 0, 1}, 0.05},
                             {{-0.15, 0, -0.5}, {0, 0, 1}, 0}};

struct Figures {
  double known, median_percent, beyond_5_percent, beyond_3_sigma, median_in_sigma;
};

Figures measure(const char* name, const tv_camera& camera, const Pose* poses, int num_views) {
  tv::Random random = tv::random_seeded(11);
  tv_depth_view views[kViews];
  Mat3 world_from_first = Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()).toRotationMatrix();
  const Vec3 first_in_world(2, -1, 0.5);  // the world is another frame than that of the first view
  for (int v = 0; v < num_views; ++v) {
    const Mat3 first_from_cam =
        Eigen::AngleAxisd(poses[v].angle, poses[v].axis.normalized()).toRotationMatrix();
    const Mat3 cam_from_first = first_from_cam.transpose();
    render(camera, cam_from_first, -(cam_from_first * poses[v].centre), &random, pixels[v]);
    const Mat3 R = world_from_first * first_from_cam;
    const Vec3 t = world_from_first * poses[v].centre + first_in_world;
    views[v].image = {pixels[v], kWidth, kHeight, kWidth};
    views[v].camera = &camera;
    for (int i = 0; i < 9; ++i) views[v].world_from_cam_R[i] = R(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) views[v].world_from_cam_t[i] = t[i];
  }
  tv_depth_options options;
  tv_depth_options_init(&options);
  // Sigmas are in planes, which come in blocks of 32: 64 of them for each lens's map.
  options.near_depth = 1.8;
  options.far_depth = 9;
  options.max_views = num_views;
  options.max_pixels = kMapPixels;
  size_t bytes = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_size(&camera, &options, &bytes));
  TEST_ASSERT_TRUE(bytes <= sizeof memory);
  tv_camera map_camera;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_map_camera(&camera, &options, &map_camera));
  const int width = map_camera.width, height = map_camera.height;
  TEST_ASSERT_TRUE(width >= kWidth && height >= kHeight && width * height <= kMapPixels);
  const tv_depth_arrays arrays = {distances, sigmas, witnesses, grey};
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_sweep_depth(memory, bytes, views, num_views, &options, &arrays));
  const tv::Camera prepared = tv::prepare_camera(map_camera);
  std::vector<double> errors, in_sigma;
  int inside = 0;
  for (int y = 0; y < height; ++y) {
    for (int x = 0; x < width; ++x) {
      const int i = y * width + x;
      Vec3 ray;
      TEST_ASSERT_TRUE(tv::unproject(prepared, tv::Vec2(x, y), &ray, nullptr));
      const double truth = distance_to_scene(Vec3(0, 0, 0), ray);
      inside += grey[i] != 0;
      if (distances[i] <= 0) {
        TEST_ASSERT_TRUE(distances[i] == 0 && sigmas[i] == 0 && witnesses[i] == 0);
        continue;
      }
      TEST_ASSERT_TRUE(sigmas[i] > 0 && sigmas[i] <= 0.05f * distances[i] * 1.0001f);
      errors.push_back(std::fabs(distances[i] - truth) / truth);
      in_sigma.push_back(std::fabs(distances[i] - truth) / sigmas[i]);
    }
  }
  const auto share_above = [](const std::vector<double>& of, double limit) {
    const auto count = std::count_if(of.begin(), of.end(), [&](double e) { return e > limit; });
    return static_cast<double>(count) / static_cast<double>(of.size());
  };
  const auto median = [](std::vector<double> of) {
    std::nth_element(of.begin(), of.begin() + static_cast<ptrdiff_t>(of.size() / 2), of.end());
    return of[of.size() / 2];
  };
  const Figures f = {static_cast<double>(errors.size()) / inside, 100 * median(errors),
                     share_above(errors, 0.05), share_above(in_sigma, 3), median(in_sigma)};
  std::printf(
      "%s: %.3f known, off by %.2f %% (median), %.4f above 5 %%, %.4f above 3 sigma, "
      "median %.2f sigma\n",
      name, f.known, f.median_percent, f.beyond_5_percent, f.beyond_3_sigma, f.median_in_sigma);
  return f;
}

void expect(const Figures& f, double least_known) {
  TEST_ASSERT_TRUE(f.known >= least_known);
  TEST_ASSERT_TRUE(f.median_percent <= 0.6);
  TEST_ASSERT_TRUE(f.beyond_5_percent <= 0.02);
  TEST_ASSERT_TRUE(f.beyond_3_sigma <= 0.06);
  TEST_ASSERT_TRUE(f.median_in_sigma >= 0.3 && f.median_in_sigma <= 1.0);
}

void test_depths_are_the_scenes_through_every_lens(void) {
  expect(measure("pinhole", camera_of(TV_CAMERA_PINHOLE, {}), kAround, 5), 0.9);
  expect(measure("Brown-Conrady",
                 camera_of(TV_CAMERA_BROWN_CONRADY, {-0.28, 0.07, 0.001, -0.001, 0}), kAround, 5),
         0.9);
  expect(measure("Kannala-Brandt", camera_of(TV_CAMERA_KANNALA_BRANDT, {-0.03, 0.01, 0, 0}),
                 kAround, 5),
         0.9);
}

// What the image shows at its edges and in its corners, the map shows, too: to within eight of its
// pixels, since the optical axis lies in its middle. A pinhole keeps its focal length. A fisheye's
// map has at least half the focal length, so that its middle stays sharp.
void test_the_map_shows_what_a_bent_lens_shows(void) {
  const tv_camera lenses[] = {
      camera_of(TV_CAMERA_PINHOLE, {}),
      camera_of(TV_CAMERA_BROWN_CONRADY, {-0.28, 0.07, 0.001, -0.001, 0}),
      camera_of(TV_CAMERA_BROWN_CONRADY, {0.08, -0.12, 0, 0, 0}),
      camera_of(TV_CAMERA_KANNALA_BRANDT, {-0.03, 0.01, 0, 0}),
  };
  tv_depth_options options;
  tv_depth_options_init(&options);
  options.max_pixels = kWidth * kHeight;  // as many as the image has
  for (const tv_camera& lens : lenses) {
    tv_camera map;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_map_camera(&lens, &options, &map));
    TEST_ASSERT_TRUE(map.fx == map.fy && map.fx > 0.7 * lens.fx && map.fx <= 261);
    TEST_ASSERT_TRUE(map.fx == 261 || lens.model != TV_CAMERA_PINHOLE);
    const tv::Camera prepared = tv::prepare_camera(lens), of_map = tv::prepare_camera(map);
    const double right = lens.width - 1, low = lens.height - 1;
    for (int k = 0; k < 9; ++k) {
      const tv::Vec2 edge(k % 3 == 0   ? 0
                          : k % 3 == 1 ? lens.cx
                                       : right,
                          k / 3 == 0   ? 0
                          : k / 3 == 1 ? lens.cy
                                       : low);
      Vec3 ray;
      tv::Vec2 pixel;
      TEST_ASSERT_TRUE(tv::unproject(prepared, edge, &ray, nullptr));
      TEST_ASSERT_TRUE(tv::project(of_map, ray, &pixel, nullptr));
      TEST_ASSERT_TRUE(pixel[0] >= -8 && pixel[0] <= map.width + 7);
      TEST_ASSERT_TRUE(pixel[1] >= -8 && pixel[1] <= map.height + 7);
    }
  }
  tv_camera fisheye = camera_of(TV_CAMERA_KANNALA_BRANDT, {0, 0, 0, 0}), map;
  fisheye.fx = fisheye.fy = 100;  // 183 degrees across
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_map_camera(&fisheye, &options, &map));
  TEST_ASSERT_TRUE(map.fx == 50);
}

// Along the optical axis there is no parallax, so that fewer pixels are known.
void test_depths_are_the_scenes_where_the_camera_moves_ahead(void) {
  const Figures f = measure("ahead", camera_of(TV_CAMERA_PINHOLE, {}), kAhead, 5);
  TEST_ASSERT_TRUE(f.known >= 0.6);
  TEST_ASSERT_TRUE(f.median_percent <= 1);
  TEST_ASSERT_TRUE(f.beyond_5_percent <= 0.04);
}

void test_two_views_are_enough(void) {
  const Figures f = measure("two views", camera_of(TV_CAMERA_PINHOLE, {}), kAround, 2);
  TEST_ASSERT_TRUE(f.known >= 0.75);
  TEST_ASSERT_TRUE(f.median_percent <= 0.8);
  TEST_ASSERT_TRUE(f.beyond_5_percent <= 0.03);
}

// What the ball hides from most views is found from its surroundings, and is wrong more often.
void test_few_witnesses_are_a_warning(void) {
  measure("witnesses", camera_of(TV_CAMERA_PINHOLE, {}), kAround, 5);
  tv_camera map_camera;
  const tv_camera camera = camera_of(TV_CAMERA_PINHOLE, {});
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_map_camera(&camera, nullptr, &map_camera));
  const tv::Camera map = tv::prepare_camera(map_camera);
  int all[2] = {}, wrong[2] = {};
  for (int i = 0; i < kWidth * kHeight; ++i) {
    Vec3 ray;
    if (distances[i] <= 0 || !tv::unproject(map, tv::Vec2(i % kWidth, i / kWidth), &ray, nullptr))
      continue;
    const double truth = distance_to_scene(Vec3(0, 0, 0), ray);
    const int has_witnesses = witnesses[i] >= 2;
    ++all[has_witnesses];
    wrong[has_witnesses] += std::fabs(distances[i] - truth) > 0.05 * truth;
  }
  std::printf("wrong by 5 %%: %d of %d with two witnesses, %d of %d with fewer\n", wrong[1], all[1],
              wrong[0], all[0]);
  TEST_ASSERT_GREATER_THAN_INT(20 * all[0], all[1]);
  TEST_ASSERT_LESS_OR_EQUAL_INT(all[1] / 100, wrong[1]);
  // At least five times as often.
  TEST_ASSERT_GREATER_THAN_INT(5 * wrong[1] * (all[0] / 10), wrong[0] * (all[1] / 10));
}

// Exchanged partners are the same evidence.
void test_the_order_of_the_other_views_does_not_matter(void) {
  static float first[kWidth * kHeight];  // of a pinhole, whose map is as large as its picture
  const tv_camera camera = camera_of(TV_CAMERA_PINHOLE, {});
  measure("in order", camera, kAround, 5);
  std::memcpy(first, distances, sizeof first);
  // The same pictures in another order: render() draws its noise view by view, so they are
  // exchanged after it.
  const int order[kViews] = {0, 3, 1, 4, 2};
  static uint8_t copies[kViews][kWidth * kHeight];
  std::memcpy(copies, pixels, sizeof copies);
  tv_depth_view views[kViews];
  for (int v = 0; v < kViews; ++v) {
    const Pose& pose = kAround[order[v]];
    const Mat3 R = Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()).toRotationMatrix() *
                   Eigen::AngleAxisd(pose.angle, pose.axis.normalized()).toRotationMatrix();
    const Vec3 t =
        Eigen::AngleAxisd(0.4, Vec3(1, 2, 3).normalized()).toRotationMatrix() * pose.centre +
        Vec3(2, -1, 0.5);
    views[v].image = {copies[order[v]], kWidth, kHeight, kWidth};
    views[v].camera = &camera;
    for (int i = 0; i < 9; ++i) views[v].world_from_cam_R[i] = R(i / 3, i % 3);
    for (int i = 0; i < 3; ++i) views[v].world_from_cam_t[i] = t[i];
  }
  tv_depth_options options;
  tv_depth_options_init(&options);
  options.near_depth = 1.8;
  options.far_depth = 9;
  size_t bytes = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_depth_size(&camera, &options, &bytes));
  const tv_depth_arrays arrays = {distances, sigmas, witnesses, nullptr};
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_sweep_depth(memory, bytes, views, kViews, &options, &arrays));
  TEST_ASSERT_EQUAL_MEMORY(first, distances, sizeof first);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_depths_are_the_scenes_through_every_lens);
  RUN_TEST(test_the_map_shows_what_a_bent_lens_shows);
  RUN_TEST(test_depths_are_the_scenes_where_the_camera_moves_ahead);
  RUN_TEST(test_two_views_are_enough);
  RUN_TEST(test_few_witnesses_are_a_warning);
  RUN_TEST(test_the_order_of_the_other_views_does_not_matter);
  return UNITY_END();
}
