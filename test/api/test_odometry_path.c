/* The path of a flight (twoview/path.h): the poses of its frames in the last state of the map, and
   frames that are found afterwards, in the room that support/room_scene.h draws. */
#include <math.h>
#include <string.h>

#include "support/api.h"
#include "support/room_scene.h"
#include "twoview/odometry.h"
#include "twoview/path.h"

enum { FRAMES = 70, MEMORY = 24 << 20 };

static _Alignas(64) uint8_t memory[MEMORY];
static tv_odometry *odometry;
static tv_odometry_state states[FRAMES];
static tv_path_frame frames[FRAMES];
static tv_path_pose poses[FRAMES];
static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];
static tv_image image;

/* Flies, and keeps what is known of each frame. */
static void fly(int num_frames) {
  int n;
  for (n = 0; n < num_frames; ++n) {
    tv_odometry_frame frame;
    tv_odometry_frame_init(&frame);
    room_flight(n, pixels);
    frame.image = image;
    frame.time_s = n / 30.0;
    tv_odometry_state_init(&states[n]);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &states[n]));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_record(&states[n], frame.time_s, &frames[n]));
  }
}

static int locate(int num_frames, int idx, int picture) {
  int32_t is_found = -1;
  room_flight(picture, pixels);
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_path_locate(odometry, frames, num_frames, idx, &image, NULL, &is_found));
  return is_found;
}

/* The camera's true centre at picture n, as room_flight has it. */
static void true_centre(int n, double centre[3]) {
  centre[0] = 0.9 * sin(0.07 * n) - 0.3;
  centre[1] = 0.15 * sin(0.11 * n);
  centre[2] = 0.3 * sin(0.05 * n);
}

static double distance(const double a[3], const double b[3]) {
  return sqrt((a[0] - b[0]) * (a[0] - b[0]) + (a[1] - b[1]) * (a[1] - b[1]) +
              (a[2] - b[2]) * (a[2] - b[2]));
}

/* The error of the way from frame m to frame n, as a share of the true way from frame 20 to frame
   40, which gives the unit. */
static double error_of_way(int m, int n) {
  double a[3], b[3], from[3], to[3];
  true_centre(20, a);
  true_centre(40, b);
  true_centre(m, from);
  true_centre(n, to);
  return fabs(distance(poses[m].world_from_cam_t, poses[n].world_from_cam_t) /
                  distance(poses[20].world_from_cam_t, poses[40].world_from_cam_t) -
              distance(from, to) / distance(a, b));
}

void setUp(void) {
  const tv_camera camera = room_camera();
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  image = api_image(pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&odometry, &camera, &options, memory, MEMORY));
}

void tearDown(void) {}

static void test_a_record_has_the_pose_of_the_state(void) {
  int n, num_known = 0;
  fly(40);
  for (n = 0; n < 40; ++n) {
    TEST_ASSERT_EQUAL_INT(n, frames[n].frame);
    TEST_ASSERT_EQUAL_DOUBLE(n / 30.0, frames[n].time_s);
    TEST_ASSERT_EQUAL_INT(states[n].has_pose ? TV_PATH_TRACKED : TV_PATH_UNKNOWN, frames[n].origin);
    TEST_ASSERT_EQUAL_INT(states[n].reference_id, frames[n].reference_id);
    TEST_ASSERT_EQUAL_MEMORY(states[n].reference_from_cam_R, frames[n].reference_from_cam_R, 72);
    TEST_ASSERT_EQUAL_MEMORY(states[n].reference_from_cam_t, frames[n].reference_from_cam_t, 24);
    num_known += states[n].has_pose;
  }
  TEST_ASSERT_TRUE(num_known > 0 && num_known < 40);
  states[39].status = TV_ODOMETRY_ROTATION;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_record(&states[39], 0, frames));
  TEST_ASSERT_EQUAL_INT(TV_PATH_TURNED, frames[0].origin);
}

static void test_the_path_is_that_of_the_map_as_it_is_now(void) {
  int n, num_moved = 0, num_begun = 0;
  fly(FRAMES);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_poses(odometry, frames, FRAMES, poses));
  for (n = 0; n < FRAMES; ++n) {
    double R[9], t[3];
    int32_t segment;
    if (!states[n].has_pose) {
      num_begun += poses[n].origin == TV_PATH_TRACKED;
      continue;
    }
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_odometry_pose_of(odometry, frames[n].reference_id, frames[n].reference_from_cam_R,
                                   frames[n].reference_from_cam_t, R, t, &segment));
    TEST_ASSERT_EQUAL_INT(TV_PATH_TRACKED, poses[n].origin);
    TEST_ASSERT_EQUAL_INT(segment, poses[n].segment);
    TEST_ASSERT_EQUAL_MEMORY(R, poses[n].world_from_cam_R, sizeof R);
    TEST_ASSERT_EQUAL_MEMORY(t, poses[n].world_from_cam_t, sizeof t);
    num_moved += memcmp(t, states[n].world_from_cam_t, sizeof t) != 0;
  }
  TEST_ASSERT_TRUE(num_moved > 0);
  TEST_ASSERT_EQUAL_INT(1, num_begun); /* the first of the two frames that began the map */
}

static void test_a_frame_without_a_pose_says_so(void) {
  fly(5);
  frames[4].frame = 1000; /* no keyframe's */
  frames[4].origin = TV_PATH_UNKNOWN;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_poses(odometry, frames + 4, 1, poses));
  TEST_ASSERT_EQUAL_INT(TV_PATH_UNKNOWN, poses[0].origin);
  TEST_ASSERT_EQUAL_INT(-1, poses[0].segment);
  frames[4].origin = TV_PATH_TRACKED; /* its keyframe is gone, with all of its segment */
  frames[4].reference_id = 1000;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_poses(odometry, frames + 4, 1, poses));
  TEST_ASSERT_EQUAL_INT(TV_PATH_UNKNOWN, poses[0].origin);
}

static void test_frames_from_before_the_start_are_found_where_they_were(void) {
  int n, num_found = 0;
  fly(FRAMES);
  tv_odometry_finish(odometry);
  for (n = 0; frames[n].origin == TV_PATH_UNKNOWN; ++n) num_found += locate(FRAMES, n, n);
  TEST_ASSERT_TRUE(n > 1);
  TEST_ASSERT_EQUAL_INT(n, num_found);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_poses(odometry, frames, FRAMES, poses));
  while (--n >= 0) {
    TEST_ASSERT_EQUAL_INT(TV_PATH_LOCATED, poses[n].origin);
    TEST_ASSERT_TRUE(error_of_way(n, 40) < 0.05);
  }
}

/* Pictures that look like those of another place: the camera cannot have been there. */
static void test_a_frame_is_not_found_where_the_camera_cannot_have_flown(void) {
  fly(FRAMES);
  tv_odometry_finish(odometry);
  frames[50].origin = TV_PATH_UNKNOWN;
  frames[50].reference_id = -1;
  TEST_ASSERT_EQUAL_INT(0, locate(FRAMES, 50, 20));
  TEST_ASSERT_EQUAL_INT(TV_PATH_UNKNOWN, frames[50].origin);
  TEST_ASSERT_EQUAL_INT(1, locate(FRAMES, 50, 50));
  TEST_ASSERT_EQUAL_INT(TV_PATH_LOCATED, frames[50].origin);
  /* Nor is a blank picture found anywhere. */
  frames[30].origin = TV_PATH_UNKNOWN;
  memset(pixels, 99, sizeof pixels);
  {
    int32_t is_found = -1;
    TEST_ASSERT_EQUAL_INT(TV_OK,
                          tv_path_locate(odometry, frames, FRAMES, 30, &image, NULL, &is_found));
    TEST_ASSERT_EQUAL_INT(0, is_found);
  }
}

static void test_bad_arguments_change_nothing(void) {
  static _Alignas(8) uint8_t shared[ROOM_WIDTH * ROOM_HEIGHT]; /* a picture, and a record in it */
  tv_image mask = image;
  tv_path_frame before[20];
  tv_odometry_state bad;
  int32_t is_found = 7;
  fly(20);
  memcpy(before, frames, sizeof before);
  bad = states[19];
  bad.struct_size = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_path_record(NULL, 0, frames));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_path_record(&states[19], 0, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_path_record(&bad, 0, frames));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_path_record(&states[19], (double)NAN, frames));
  TEST_ASSERT_EQUAL_INT(
      TV_ERR_OVERLAP,
      tv_path_record(&states[19], 0, (tv_path_frame *)(void *)states[19].reference_from_cam_R));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_path_poses(odometry, NULL, 0, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_path_poses(NULL, frames, 20, poses));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_path_poses(odometry, NULL, 20, poses));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_path_poses(odometry, frames, 20, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_path_poses(odometry, frames, -1, poses));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_path_poses(odometry, frames, 20, (tv_path_pose *)(void *)&frames[3]));
#define LOCATE(o, array, num, idx, picture, found) \
  tv_path_locate((o), (array), (num), (idx), (picture), NULL, (found))
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, LOCATE(NULL, frames, 20, 0, &image, &is_found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, LOCATE(odometry, NULL, 20, 0, &image, &is_found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, LOCATE(odometry, frames, 20, 0, NULL, &is_found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, LOCATE(odometry, frames, 20, 0, &image, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, LOCATE(odometry, frames, 20, 20, &image, &is_found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, LOCATE(odometry, frames, 20, -1, &image, &is_found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        LOCATE(odometry, frames, 20, 0, &image, &frames[4].reference_id));
  image.width -= 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, LOCATE(odometry, frames, 20, 0, &image, &is_found));
  image.width += 1;
  image.height = -image.height; /* a picture that has no bytes overlaps nothing */
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, LOCATE(odometry, frames, 20, 0, &image, &is_found));
  image.height = -image.height;
  memcpy(shared, frames, sizeof frames[0]);
  mask.data = shared;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_path_locate(odometry, (tv_path_frame *)(void *)shared, 1,
                                                       0, &image, &mask, &is_found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_path_locate(odometry, (tv_path_frame *)(void *)shared, 1,
                                                       0, &mask, NULL, &is_found));
  image.data = NULL;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, LOCATE(odometry, frames, 20, 0, &image, &is_found));
  image.data = pixels;
  frames[7].frame = frames[6].frame;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_path_poses(odometry, frames, 20, poses));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, LOCATE(odometry, frames, 20, 0, &image, &is_found));
  frames[7] = before[7];
  TEST_ASSERT_EQUAL_INT(7, is_found);
  TEST_ASSERT_EQUAL_MEMORY(before, frames, sizeof before);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_a_record_has_the_pose_of_the_state);
  RUN_TEST(test_the_path_is_that_of_the_map_as_it_is_now);
  RUN_TEST(test_a_frame_without_a_pose_says_so);
  RUN_TEST(test_frames_from_before_the_start_are_found_where_they_were);
  RUN_TEST(test_a_frame_is_not_found_where_the_camera_cannot_have_flown);
  RUN_TEST(test_bad_arguments_change_nothing);
  return UNITY_END();
}
