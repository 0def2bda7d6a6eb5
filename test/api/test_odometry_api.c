/* Tests of the odometry: the statuses and outputs that odometry.h promises, its accessors, and the
   bytes of its map. It flies through a small room that support/room_scene.h draws. */
#include <math.h>
#include <stddef.h>
#include <stdlib.h>
#include <string.h>

#include "support/api.h"
#include "support/room_scene.h"
#include "twoview/odometry.h"

enum {
  GUARD = 256,
  KEYPOINTS = 160,
  KEYFRAMES = 8,
  POINTS = 500,
  MOST_FRAMES = 60,
  MEMORY = 6 << 20,
  MAP = 1 << 18,
  /* The sizes of the records of the map's bytes, and where the first point begins. */
  HEADER = 224,
  POINT = 192,
  KEYFRAME = 176,
  KEYPOINT = 16,
  REMOVED = 112
};

static tv_camera camera;
static tv_odometry_options options;
static tv_odometry_frame frame;
static tv_odometry_state state;
static tv_odometry *odometry, *other;
static _Alignas(64) uint8_t blocks[2][MEMORY];
static size_t size_bytes;
static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];
static uint8_t map[MAP], altered[MAP], again[MAP];
static size_t num_map;
static tv_map_point points[POINTS];
static tv_map_observation observations[KEYPOINTS];
static int num_flown;

static void begin(int idx, tv_odometry **made) {
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_size(&camera, &options, &size_bytes));
  TEST_ASSERT_TRUE(size_bytes + 2 * GUARD <= MEMORY);
  memset(blocks[idx], API_PATTERN, MEMORY);
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_odometry_init(made, &camera, &options, blocks[idx] + GUARD, size_bytes));
}

static tv_status give(tv_odometry *to, int n) {
  room_flight(n, pixels);
  frame.time_s = n / 30.0;
  return tv_odometry_track(to, &frame, &state);
}

/* Flies until the map has this many keyframes, or for MOST_FRAMES frames. */
static void fly(tv_odometry *to, int num_keyframes) {
  num_flown = 0;
  do {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(to, num_flown++));
  } while (state.num_keyframes < num_keyframes && num_flown < MOST_FRAMES);
  TEST_ASSERT_TRUE(state.has_pose && state.num_keyframes >= num_keyframes);
}

static void save(const tv_odometry *from, uint8_t *bytes, size_t *num) {
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save(from, bytes, MAP, num));
}

static void expect_unchanged(void) {
  size_t num;
  save(odometry, again, &num);
  TEST_ASSERT_EQUAL_UINT64(num_map, num);
  TEST_ASSERT_EQUAL_MEMORY(map, again, num);
}

void setUp(void) {
  camera = room_camera();
  tv_odometry_options_init(&options);
  options.max_keypoints = KEYPOINTS;
  options.max_keyframes = KEYFRAMES;
  options.max_points = POINTS;
  tv_odometry_frame_init(&frame);
  frame.image = api_image(pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH);
  tv_odometry_state_init(&state);
  begin(0, &odometry);
}

void tearDown(void) {}

static void test_init_functions_write_defaults_and_sizes(void) {
  tv_keyframe keyframe;
  tv_odometry_options_init(&options);
  TEST_ASSERT_EQUAL_UINT32(sizeof options, options.struct_size);
  TEST_ASSERT_EQUAL_INT(1000, options.max_keypoints);
  TEST_ASSERT_EQUAL_INT(200, options.max_keyframes);
  TEST_ASSERT_EQUAL_INT(20000, options.max_points);
  TEST_ASSERT_EQUAL_INT(10, options.window);
  TEST_ASSERT_EQUAL_INT(TV_KERNELS_AUTO, options.kernels);
  TEST_ASSERT_EQUAL_UINT32(TV_REFINE_PRINCIPAL_POINT, options.refine);
  memset(&frame, 1, sizeof frame);
  tv_odometry_frame_init(&frame);
  TEST_ASSERT_EQUAL_UINT32(sizeof frame, frame.struct_size);
  TEST_ASSERT_TRUE(frame.gap == 0 && frame.time_s == 0 && frame.attitude_sigma_rad == 0);
  memset(&state, 1, sizeof state);
  tv_odometry_state_init(&state);
  TEST_ASSERT_EQUAL_UINT32(sizeof state, state.struct_size);
  TEST_ASSERT_TRUE(state.status == 0 && state.scale_sigma == 0);
  memset(&keyframe, 1, sizeof keyframe);
  tv_keyframe_init(&keyframe);
  TEST_ASSERT_EQUAL_UINT32(sizeof keyframe, keyframe.struct_size);
  TEST_ASSERT_TRUE(keyframe.id == 0 && keyframe.num_observations == 0);
  tv_odometry_options_init_sized(NULL, 8);
  tv_odometry_frame_init_sized(NULL, 8);
  tv_odometry_state_init_sized(NULL, 8);
  tv_keyframe_init_sized(NULL, 8);
}

static void test_each_status_has_a_name(void) {
  static const char *const names[] = {"starting", "tracking", "weak", "rotation", "lost"};
  int k;
  for (k = 0; k < TV_ODOMETRY_NUM_STATUSES; ++k) {
    TEST_ASSERT_EQUAL_STRING(names[k], tv_odometry_status_string((tv_odometry_status)k));
  }
  TEST_ASSERT_EQUAL_STRING("unknown", tv_odometry_status_string((tv_odometry_status)k));
}

/* Expects the status of tv_odometry_size and of tv_odometry_init. */
static void expect_size(tv_status expected) {
  const size_t before = size_bytes = 12345;
  tv_odometry *const unmade = other = odometry;
  TEST_ASSERT_EQUAL_INT(expected, tv_odometry_size(&camera, &options, &size_bytes));
  TEST_ASSERT_EQUAL_UINT64(before, size_bytes);
  TEST_ASSERT_EQUAL_INT(expected, tv_odometry_init(&other, &camera, &options, blocks[1], MEMORY));
  TEST_ASSERT_TRUE(other == unmade);
}

static void test_size_refuses_bad_cameras_and_options(void) {
  const tv_odometry_options good = options;
  static const int32_t ranges[6][2] = {
      {100, 4096}, {8, 2000}, {500, 200000}, {3, 20}, {TV_KERNELS_AUTO, TV_KERNELS_NEON}, {0, 0}};
  /* The focal length of a flight is not refined, and there is nothing else to refine. */
  static const uint32_t masks[] = {
      TV_REFINE_FOCAL_LENGTH, TV_REFINE_FOCAL_LENGTH | TV_REFINE_PRINCIPAL_POINT, 4, UINT32_MAX};
  int k;
  for (k = 0; k < 4; ++k) options.refine = masks[k], expect_size(TV_ERR_ARGUMENT);
  options = good;
  for (k = 0; k < 6; ++k) {
    int32_t *const fields[6] = {&options.max_keypoints, &options.max_keyframes, &options.max_points,
                                &options.window,        &options.kernels,       &options.reserved};
    *fields[k] = ranges[k][0] - 1, expect_size(TV_ERR_ARGUMENT);
    *fields[k] = ranges[k][1] + 1, expect_size(TV_ERR_ARGUMENT);
    options = good;
  }
  options.struct_size = 3, expect_size(TV_ERR_STRUCT_SIZE), options = good;
  camera.width = 31, expect_size(TV_ERR_ARGUMENT);
  camera.width = 16385, expect_size(TV_ERR_ARGUMENT), camera.width = ROOM_WIDTH;
  camera.fx = 0, expect_size(TV_ERR_CAMERA), camera = room_camera();
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_size(NULL, NULL, &size_bytes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_size(&camera, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_size(&camera, NULL, &size_bytes));
}

static void test_init_refuses_bad_memory(void) {
  tv_odometry *const before = other = odometry;
  const size_t size = size_bytes;
  uint8_t *const memory = blocks[1];
#if defined(__x86_64__)
  options.kernels = TV_KERNELS_NEON;
#else
  options.kernels = TV_KERNELS_AVX2;
#endif
  TEST_ASSERT_EQUAL_INT(TV_ERR_KERNELS,
                        tv_odometry_init(&other, &camera, &options, memory, MEMORY));
  options.kernels = TV_KERNELS_AUTO;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_init(NULL, &camera, &options, memory, size));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_init(&other, NULL, &options, memory, size));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_init(&other, &camera, &options, NULL, size));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ALIGNMENT,
                        tv_odometry_init(&other, &camera, &options, memory + 8, size));
  TEST_ASSERT_EQUAL_INT(TV_ERR_MEMORY,
                        tv_odometry_init(&other, &camera, &options, memory, size - 1));
  TEST_ASSERT_TRUE(other == before);
}

static void test_a_flight_stays_within_its_memory(void) {
  size_t num_first;
  fly(odometry, KEYFRAMES);
  TEST_ASSERT_TRUE(api_is_pattern(blocks[0], GUARD));
  TEST_ASSERT_TRUE(api_is_pattern(blocks[0] + GUARD + size_bytes, MEMORY - GUARD - size_bytes));
  save(odometry, map, &num_first);
  /* Reset makes it as it was made: the same flight gives the same bytes. */
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_reset(NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  save(odometry, again, &num_map);
  TEST_ASSERT_EQUAL_UINT64(HEADER, num_map);
  fly(odometry, KEYFRAMES);
  num_map = num_first;
  expect_unchanged();
}

static void test_every_kernel_set_gives_the_same_map(void) {
  fly(odometry, 4);
  save(odometry, map, &num_map);
  for (options.kernels = TV_KERNELS_C; options.kernels <= TV_KERNELS_NEON; ++options.kernels) {
    const tv_status status = tv_odometry_init(&odometry, &camera, &options, blocks[1], MEMORY);
    if (status == TV_ERR_KERNELS) continue;
    TEST_ASSERT_EQUAL_INT(TV_OK, status);
    fly(odometry, 4);
    expect_unchanged();
  }
}

/* Expects that a frame is refused, and that neither the state nor the odometry changes. */
static void expect_refused(tv_status expected) {
  const tv_odometry_state before = state;
  TEST_ASSERT_EQUAL_INT(expected, tv_odometry_track(odometry, &frame, &state));
  TEST_ASSERT_EQUAL_MEMORY(&before, &state, sizeof state);
  expect_unchanged();
}

static void test_bad_frames_are_refused(void) {
  tv_odometry_frame good;
  fly(odometry, 3);
  save(odometry, map, &num_map);
  expect_refused(TV_ERR_TIME); /* it stands */
  frame.time_s += 1;
  good = frame;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_track(NULL, &frame, &state));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_track(odometry, NULL, &state));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_track(odometry, &frame, NULL));
  frame.image.data = NULL, expect_refused(TV_ERR_NULL), frame = good;
  frame.struct_size = 2, expect_refused(TV_ERR_STRUCT_SIZE), frame = good;
  state.struct_size = 2, expect_refused(TV_ERR_STRUCT_SIZE), state.struct_size = sizeof state;
  frame.image.width -= 1, expect_refused(TV_ERR_CAMERA), frame = good;
  frame.image.height += 1, expect_refused(TV_ERR_CAMERA), frame = good;
  frame.image.stride_bytes -= 1, expect_refused(TV_ERR_STRIDE), frame = good;
  frame.image.stride_bytes = INT64_MAX, expect_refused(TV_ERR_STRIDE), frame = good;
  frame.gap = 2, expect_refused(TV_ERR_ARGUMENT), frame = good;
  frame.time_s = 0, expect_refused(TV_ERR_TIME), frame = good;
  frame.time_s = NAN, expect_refused(TV_ERR_NOT_FINITE), frame = good;
  frame.time_s = INFINITY, expect_refused(TV_ERR_NOT_FINITE), frame = good;
  frame.image.data = (const uint8_t *)&state, expect_refused(TV_ERR_OVERLAP), frame = good;
  frame.mask = good.image, frame.mask.width -= 1, expect_refused(TV_ERR_MASK), frame = good;
  frame.mask = good.image, frame.mask.stride_bytes = 3, expect_refused(TV_ERR_MASK);
  frame.mask = good.image, frame.mask.data = (const uint8_t *)&state;
  expect_refused(TV_ERR_OVERLAP), frame = good;
}

static void test_wrong_sensors_are_left_out_of_account(void) {
  frame.attitude_sigma_rad = 0.01; /* of an attitude of zeros */
  frame.height_m = NAN, frame.height_sigma_m = 0.1;
  frame.velocity_m_s[1] = INFINITY, frame.velocity_sigma_m_s = 0.1;
  fly(odometry, 3);
  save(odometry, map, &num_map);
  tv_odometry_frame_init(&frame);
  frame.image = api_image(pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  fly(odometry, 3);
  expect_unchanged();
}

/* How far the image of a point lies from the pixel at which the keyframe sees it. */
static double error_px(const tv_keyframe *k, const double X[3], const tv_map_observation *o) {
  const double *R = k->world_from_cam_R, *t = k->world_from_cam_t;
  double x[3], pixel[2];
  int c;
  for (c = 0; c < 3; ++c) {
    x[c] = R[c] * (X[0] - t[0]) + R[3 + c] * (X[1] - t[1]) + R[6 + c] * (X[2] - t[2]);
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_camera_project(&camera, x, pixel, NULL));
  return hypot(pixel[0] - (double)o->x, pixel[1] - (double)o->y);
}

static void test_the_map_holds_together(void) {
  int32_t num_points, num, k, i, counts[POINTS] = {0}, total = 0, near_ones = 0, last_id = -1;
  tv_keyframe keyframe;
  fly(odometry, KEYFRAMES);
  for (i = 0; i < 25; ++i) { /* points are removed, and their places used again */
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_points(odometry, points, POINTS, &num_points));
  TEST_ASSERT_EQUAL_INT(state.num_points, num_points);
  for (i = 0; i < num_points; ++i) {
    TEST_ASSERT_TRUE(points[i].id > (i > 0 ? points[i - 1].id : -1));
    TEST_ASSERT_TRUE(points[i].grey >= 0 && points[i].grey <= 255);
  }
  TEST_ASSERT_TRUE(points[num_points - 1].id >= num_points); /* some were removed */
  for (k = 0; k < state.num_keyframes; ++k) {
    tv_keyframe_init(&keyframe);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, k, &keyframe));
    TEST_ASSERT_TRUE(keyframe.id > last_id && keyframe.frame < num_flown);
    TEST_ASSERT_TRUE(fabs(keyframe.time_s - keyframe.frame / 30.0) < 1e-12);
    last_id = keyframe.id;
    TEST_ASSERT_EQUAL_INT(TV_OK,
                          tv_odometry_observations(odometry, k, observations, KEYPOINTS, &num));
    TEST_ASSERT_EQUAL_INT(keyframe.num_observations, num);
    for (i = 0; i < num; ++i) {
      const tv_map_observation *o = &observations[i];
      TEST_ASSERT_TRUE(o->idx_keypoint > (i > 0 ? o[-1].idx_keypoint : -1));
      TEST_ASSERT_TRUE(o->idx_keypoint < keyframe.num_keypoints);
      TEST_ASSERT_TRUE(o->idx_point >= 0 && o->idx_point < num_points && o->sigma >= 1);
      ++counts[o->idx_point], ++total;
      near_ones += error_px(&keyframe, points[o->idx_point].position, o) < 4 * (double)o->sigma;
    }
  }
  for (i = 0; i < num_points; ++i) TEST_ASSERT_EQUAL_INT(counts[i], points[i].num_observations);
  TEST_ASSERT_TRUE(total > 100 && near_ones > 0.9 * total);
}

/* The pose of the room's flight at a keyframe, world_from_cam. */
static void true_pose(const tv_keyframe *keyframe, double R[9]) {
  const double yaw = 0.12 * sin(0.06 * keyframe->frame), c = cos(yaw), s = sin(yaw);
  const double turn[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
  memcpy(R, turn, sizeof turn);
}

/* The rotation vector, to first order, by which the turn between two keyframes differs from the
   true one, in the frame of the second. */
static void turn_error(const tv_keyframe *before, const tv_keyframe *after, double w[3]) {
  double R0[9], R1[9], relative[9], truth[9], error[9];
  const double *A = before->world_from_cam_R, *B = after->world_from_cam_R;
  int r, c, k;
  true_pose(before, R0), true_pose(after, R1);
  for (r = 0; r < 3; ++r) {
    for (c = 0; c < 3; ++c) {
      relative[3 * r + c] = truth[3 * r + c] = 0;
      for (k = 0; k < 3; ++k) {
        relative[3 * r + c] += B[3 * k + r] * A[3 * k + c];
        truth[3 * r + c] += R1[3 * k + r] * R0[3 * k + c];
      }
    }
  }
  for (r = 0; r < 3; ++r) {
    for (c = 0; c < 3; ++c) {
      error[3 * r + c] = 0;
      for (k = 0; k < 3; ++k) error[3 * r + c] += truth[3 * r + k] * relative[3 * c + k];
    }
  }
  w[0] = error[7], w[1] = error[2], w[2] = error[3];
}

static void test_covariances_hold_the_true_turns(void) {
  double covariance[36], w[3];
  int32_t is_known, k, r, c, num_known = 0, num_held = 0;
  tv_keyframe keyframes[KEYFRAMES];
  fly(odometry, KEYFRAMES);
  save(odometry, map, &num_map);
  for (k = 0; k < KEYFRAMES; ++k) {
    tv_keyframe_init(&keyframes[k]);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, k, &keyframes[k]));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_covariance(odometry, k, covariance, &is_known));
    if (!is_known) {
      for (r = 0; r < 36; ++r) TEST_ASSERT_TRUE(covariance[r] == 0);
      continue;
    }
    TEST_ASSERT_TRUE(k > 0);
    ++num_known;
    turn_error(&keyframes[k - 1], &keyframes[k], w);
    for (r = 0; r < 6; ++r) {
      TEST_ASSERT_TRUE(covariance[7 * r] > 0);
      for (c = 0; c < 6; ++c) TEST_ASSERT_TRUE(covariance[6 * r + c] == covariance[6 * c + r]);
    }
    /* Between a hundredth of a degree and a degree, and at most three of it in error. */
    for (r = 0; r < 3; ++r) {
      const double sigma = sqrt(covariance[7 * r]);
      TEST_ASSERT_TRUE(sigma > 2e-4 && sigma < 2e-2);
      num_held += fabs(w[r]) < 3 * sigma;
    }
  }
  TEST_ASSERT_TRUE(num_known >= KEYFRAMES - 2);
  TEST_ASSERT_TRUE(10 * num_held >= 9 * 3 * num_known);
  expect_unchanged();
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_covariance(NULL, 0, covariance, &is_known));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_covariance(odometry, 0, NULL, &is_known));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_covariance(odometry, 0, covariance, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_odometry_covariance(odometry, KEYFRAMES, covariance, &is_known));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_odometry_covariance(odometry, -1, covariance, &is_known));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_odometry_covariance(odometry, 0, covariance, (int32_t *)covariance));
}

/* A point's covariance is longest along the ray from where it was first seen. */
static void test_points_have_covariances(void) {
  int32_t num, n, k;
  fly(odometry, KEYFRAMES);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_points(odometry, points, POINTS, &num));
  for (n = 0; n < num; ++n) {
    const double *C = points[n].covariance;
    const double trace = C[0] + C[4] + C[8];
    TEST_ASSERT_TRUE(trace > 0 && C[0] > 0 && C[4] > 0 && C[8] > 0);
    for (k = 0; k < 3; ++k) TEST_ASSERT_TRUE(C[3 * k + (k + 1) % 3] == C[3 * ((k + 1) % 3) + k]);
    /* The flight looks forward: depth is known less well than place. */
    TEST_ASSERT_TRUE(C[8] > 0.2 * trace);
  }
}

static void test_the_last_frame_is_shown(void) {
  int32_t num, k, num_seen = 0;
  tv_keyframe as_keyframe;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_last_frame(odometry, NULL, 0, &num));
  TEST_ASSERT_EQUAL_INT(0, num);
  fly(odometry, 3);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_last_frame(odometry, observations, KEYPOINTS, &num));
  TEST_ASSERT_EQUAL_INT(state.num_keypoints, num);
  /* The frame is a keyframe, too. */
  tv_keyframe_init(&as_keyframe);
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_odometry_keyframe(odometry, state.num_keyframes - 1, &as_keyframe));
  TEST_ASSERT_EQUAL_INT(num_flown - 1, as_keyframe.frame);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_points(odometry, points, POINTS, &k));
  for (k = 0; k < num; ++k) {
    TEST_ASSERT_EQUAL_INT(k, observations[k].idx_keypoint);
    if (observations[k].idx_point < 0) continue;
    ++num_seen;
    TEST_ASSERT_TRUE(
        error_px(&as_keyframe, points[observations[k].idx_point].position, &observations[k]) < 20);
  }
  TEST_ASSERT_EQUAL_INT(as_keyframe.num_observations, num_seen);
  memset(pixels, 128, sizeof pixels);
  frame.time_s += 1;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, state.status);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_last_frame(odometry, observations, KEYPOINTS, &num));
  TEST_ASSERT_EQUAL_INT(0, num);
}

/* Flies until the last frame is a keyframe, which waits for its adjustment. Returns its index. */
static int32_t fly_to_a_keyframe(tv_keyframe *keyframe) {
  fly(odometry, 4);
  tv_keyframe_init(keyframe);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, state.num_keyframes - 1, keyframe));
  TEST_ASSERT_EQUAL_INT(num_flown - 1, keyframe->frame);
  return state.num_keyframes - 1;
}

/* So that no call takes the time of a new keyframe and that of its adjustment. */
static void test_a_keyframe_is_adjusted_when_the_next_frame_comes(void) {
  tv_keyframe tracked, adjusted;
  const int32_t newest = fly_to_a_keyframe(&tracked);
  tv_keyframe_init(&adjusted);
  TEST_ASSERT_EQUAL_INT(tracked.id, state.reference_id);
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown));
  TEST_ASSERT_FALSE(state.is_keyframe);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, newest, &adjusted));
  TEST_ASSERT_EQUAL_INT(tracked.id, adjusted.id);
  TEST_ASSERT_TRUE(memcmp(&tracked.world_from_cam_t, &adjusted.world_from_cam_t,
                          sizeof tracked.world_from_cam_t) != 0);
}

static void test_a_segment_is_weak_until_a_pair_of_keyframes_confirms_it(void) {
  fly(odometry, 2);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_WEAK, state.status);
  TEST_ASSERT_EQUAL_UINT32(TV_REASON_LOW_PARALLAX, state.reasons);
  for (; num_flown < MOST_FRAMES && !give(odometry, num_flown) && state.num_keyframes == 2;) {
    TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_WEAK, state.status);
    TEST_ASSERT_EQUAL_UINT32(TV_REASON_LOW_PARALLAX, state.reasons);
    ++num_flown;
  }
  TEST_ASSERT_EQUAL_INT(3, state.num_keyframes);
  while (state.status == TV_ODOMETRY_WEAK && num_flown < MOST_FRAMES) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, ++num_flown));
  }
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
}

/* Shows what a camera in the middle of the room sees that moves to the side, turned around. */
static void show_other_wall(int n) {
  const double centre[3] = {0.05 * n - 0.4, 0, 0};
  room_draw(centre, 3.14159, pixels);
  frame.time_s += 1.0 / 30;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
}

static void show_nothing(int num) {
  for (; num > 0; --num) {
    memset(pixels, 99, sizeof pixels);
    frame.time_s += 1.0 / 30;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
    TEST_ASSERT_FALSE(state.has_pose);
  }
}

/* A segment that nothing has confirmed says nothing of another one, nor this one of it. */
static void test_doubts_stay_with_their_segment(void) {
  int k;
  options.max_keyframes = 2 * KEYFRAMES;
  begin(0, &odometry);
  fly(odometry, 3);
  while (state.status != TV_ODOMETRY_TRACKING && num_flown < MOST_FRAMES) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  }
  for (k = 0; k < 4; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status); /* its newest keyframe is confirmed */
  show_nothing(12);
  for (k = 0; k < 20 && state.num_segments < 2; ++k) show_other_wall(k);
  TEST_ASSERT_EQUAL_INT(2, state.num_segments);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_WEAK, state.status);
  show_nothing(2);
  room_flight(num_flown, pixels); /* the confirmed segment again */
  frame.time_s += 1.0 / 30;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
  TEST_ASSERT_TRUE(state.relocated && state.segment == 0);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  show_nothing(2);
  show_other_wall(k - 1); /* and the other one */
  TEST_ASSERT_TRUE(state.relocated && state.segment == 1);
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_WEAK, state.status);
  TEST_ASSERT_EQUAL_UINT32(TV_REASON_LOW_PARALLAX, state.reasons);
}

/* What the velocity was in a long gap is not known. */
static void test_velocities_say_nothing_of_a_gap(void) {
  int k;
  frame.velocity_sigma_m_s = 0.01;
  fly(odometry, 3);
  for (k = 0; k < 2; ++k) { /* the camera goes to the left: without the gap, this is contrary */
    room_flight(num_flown + k, pixels);
    frame.velocity_m_s[0] = 10;
    frame.time_s += 10;
    frame.gap = k == 0;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
    TEST_ASSERT_TRUE(state.has_pose);
    TEST_ASSERT_EQUAL_INT(k == 1, (state.reasons & TV_REASON_SECOND_MOTION) != 0);
  }
}

/* A stream that restarts with its clock: the map goes on, the time that passed is not known, and
   from there on times rise again. */
static void test_a_clock_may_begin_anew_with_a_gap(void) {
  const double step_s = 1.0 / 30;
  double before_s;
  int k;
  fly(odometry, 3);
  before_s = frame.time_s;
  for (k = 0; k < 6; ++k) {
    room_flight(num_flown + k, pixels);
    frame.time_s = k == 0 ? 0 : frame.time_s + step_s;
    frame.gap = k == 0;
    frame.velocity_m_s[0] = 10, frame.velocity_sigma_m_s = 0.01; /* of this way: contrary */
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
    TEST_ASSERT_TRUE(state.has_pose && state.segment == 0 && !state.relocated);
    TEST_ASSERT_EQUAL_INT(k > 0, (state.reasons & TV_REASON_SECOND_MOTION) != 0);
  }
  TEST_ASSERT_TRUE(frame.time_s < before_s);
  frame.gap = 0, frame.time_s -= step_s;
  TEST_ASSERT_EQUAL_INT(TV_ERR_TIME, tv_odometry_track(odometry, &frame, &state));
}

/* Walls look alike: a lost frame is not found where its attitude contradicts the map. */
static void test_a_lost_frame_is_found_where_its_attitude_allows(void) {
  static const double level[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0},
                      turned[9] = {-1, 0, 0, 0, 0, 1, 0, 1, 0};
  int k;
  memcpy(frame.world_from_cam, level, sizeof level);
  frame.attitude_sigma_rad = 0.05;
  fly(odometry, 3);
  while (state.status != TV_ODOMETRY_TRACKING && num_flown < MOST_FRAMES) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  }
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  for (k = 0; k < 4; ++k) {
    if (k < 2) {
      memset(pixels, 99, sizeof pixels); /* two blank pictures */
    } else {
      room_flight(num_flown, pixels);
    }
    memcpy(frame.world_from_cam, k == 2 ? turned : level, sizeof level);
    frame.time_s += 1.0 / 30;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
    TEST_ASSERT_EQUAL_INT(k == 3, state.has_pose);
    TEST_ASSERT_EQUAL_INT(k == 3, state.relocated);
  }
}

/* The picture is grey but for a window in its middle, this many eighths of it wide and high. */
static void show_window(int columns, int rows) {
  int x, y;
  for (y = 0; y < ROOM_HEIGHT; ++y) {
    for (x = 0; x < ROOM_WIDTH; ++x) {
      const int is_shown = 8 * abs(2 * x - ROOM_WIDTH) < columns * ROOM_WIDTH &&
                           8 * abs(2 * y - ROOM_HEIGHT) < rows * ROOM_HEIGHT;
      if (!is_shown) pixels[y * ROOM_WIDTH + x] = 99;
    }
  }
}

/* Posters look alike: a lost frame is not found by a part of it that leaves its pose in doubt. */
static void test_a_lost_frame_is_found_where_its_pose_is_beyond_doubt(void) {
  int k;
  options.max_keypoints = 500;
  options.max_points = 2000;
  begin(0, &odometry);
  fly(odometry, 3);
  while (state.status != TV_ODOMETRY_TRACKING && num_flown < MOST_FRAMES) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  }
  for (k = 0; k < 4; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_TRACKING, state.status);
  for (k = 0; k < 4; ++k) {
    room_flight(num_flown - 1, pixels); /* the last frame again */
    if (k < 2) show_window(0, 0);
    if (k == 2) show_window(3, 4); /* 43 points fit */
    frame.time_s += 1.0 / 30;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
    TEST_ASSERT_EQUAL_INT(k == 3, state.has_pose);
    TEST_ASSERT_EQUAL_INT(k == 3, state.relocated);
  }
}

static void test_finish_adjusts_the_newest_keyframe(void) {
  tv_keyframe tracked, adjusted;
  tv_odometry_state after;
  int32_t newest;
  tv_keyframe_init(&adjusted);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_finish(NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry)); /* without a map */
  newest = fly_to_a_keyframe(&tracked);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, newest, &adjusted));
  TEST_ASSERT_TRUE(memcmp(&tracked.world_from_cam_t, &adjusted.world_from_cam_t,
                          sizeof tracked.world_from_cam_t) != 0);
  /* Nothing is left, and the next frame finds the map as it would have made it. */
  tracked = adjusted;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_finish(odometry));
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown));
  TEST_ASSERT_TRUE(state.has_pose);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, newest, &adjusted));
  TEST_ASSERT_EQUAL_MEMORY(&tracked.world_from_cam_t, &adjusted.world_from_cam_t,
                           sizeof tracked.world_from_cam_t);
  after = state;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  fly_to_a_keyframe(&tracked);
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown));
  TEST_ASSERT_EQUAL_INT(after.status, state.status);
  TEST_ASSERT_EQUAL_UINT32(after.reasons, state.reasons);
  TEST_ASSERT_EQUAL_MEMORY(&after.world_from_cam_t, &state.world_from_cam_t,
                           sizeof after.world_from_cam_t);
}

static void test_accessors_refuse_bad_arguments(void) {
  tv_keyframe keyframe;
  int32_t num = 0, k;
  fly(odometry, 3);
  save(odometry, map, &num_map);
  tv_keyframe_init(&keyframe);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_keyframe(NULL, 0, &keyframe));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_keyframe(odometry, 0, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_odometry_keyframe(odometry, -1, &keyframe));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_odometry_keyframe(odometry, state.num_keyframes, &keyframe));
  keyframe.struct_size = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_odometry_keyframe(odometry, 0, &keyframe));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_points(NULL, points, POINTS, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_points(odometry, NULL, 1, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_points(odometry, points, POINTS, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_odometry_points(odometry, points, -1, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_odometry_points(odometry, points, POINTS, &points[3].id));
  TEST_ASSERT_EQUAL_INT(0, num);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_odometry_points(odometry, points, state.num_points - 1, &num));
  TEST_ASSERT_EQUAL_INT(state.num_points, num);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_points(odometry, points, num, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_odometry_observations(odometry, -1, NULL, 0, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT,
                        tv_odometry_observations(odometry, state.num_keyframes, NULL, 0, &num));
  for (k = 0; k < 2; ++k) { /* the two functions with the same rules */
#define OBSERVE(o, array, cap, n)                           \
  (k == 0 ? tv_odometry_observations((o), 0, array, cap, n) \
          : tv_odometry_last_frame((o), array, cap, n))
    TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, OBSERVE(NULL, observations, KEYPOINTS, &num));
    TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, OBSERVE(odometry, NULL, 1, &num));
    TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, OBSERVE(odometry, observations, KEYPOINTS, NULL));
    TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, OBSERVE(odometry, observations, -1, &num));
    TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                          OBSERVE(odometry, observations, KEYPOINTS, &observations[2].reserved));
    num = 0;
    TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, OBSERVE(odometry, observations, 3, &num));
    TEST_ASSERT_TRUE(num > 3);
    TEST_ASSERT_EQUAL_INT(TV_OK, OBSERVE(odometry, observations, num, &num));
  }
  expect_unchanged();
}

static void test_poses_are_found_again_from_their_keyframes(void) {
  static tv_odometry_state states[MOST_FRAMES + 20];
  double R[9], t[3];
  int32_t segment, k, i, removed = 0;
  tv_keyframe first;
  for (k = 0; k < MOST_FRAMES + 20; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, k));
    states[k] = state;
    if (!state.has_pose) continue;
    TEST_ASSERT_EQUAL_INT(
        TV_OK, tv_odometry_pose_of(odometry, state.reference_id, state.reference_from_cam_R,
                                   state.reference_from_cam_t, R, t, &segment));
    TEST_ASSERT_EQUAL_INT(state.segment, segment);
    for (i = 0; i < 9; ++i) TEST_ASSERT_TRUE(fabs(R[i] - state.world_from_cam_R[i]) < 1e-9);
    for (i = 0; i < 3; ++i) TEST_ASSERT_TRUE(fabs(t[i] - state.world_from_cam_t[i]) < 1e-9);
  }
  for (k = 0; k < MOST_FRAMES + 20; ++k) { /* also where the keyframe is gone */
    const tv_odometry_state *s = &states[k];
    if (!s->has_pose) continue;
    TEST_ASSERT_EQUAL_INT(TV_OK,
                          tv_odometry_pose_of(odometry, s->reference_id, s->reference_from_cam_R,
                                              s->reference_from_cam_t, R, t, NULL));
    for (i = 0; i < 3; ++i) TEST_ASSERT_TRUE(fabs(t[i] - s->world_from_cam_t[i]) < 0.3);
    for (i = 0; i < state.num_keyframes; ++i) {
      tv_keyframe_init(&first);
      tv_odometry_keyframe(odometry, i, &first);
      if (first.id == s->reference_id) break;
    }
    removed += i == state.num_keyframes;
  }
  TEST_ASSERT_TRUE(removed > 0);
#define POSE_OF(id, R_in, R_out, t_out) \
  tv_odometry_pose_of(odometry, (id), R_in, state.reference_from_cam_t, R_out, t_out, &segment)
  k = state.reference_id;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, POSE_OF(-1, state.reference_from_cam_R, R, t));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, POSE_OF(100000, state.reference_from_cam_R, R, t));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, POSE_OF(k, NULL, R, t));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, POSE_OF(k, state.reference_from_cam_R, NULL, t));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, POSE_OF(k, state.reference_from_cam_R, R, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, POSE_OF(k, R, R, t));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, POSE_OF(k, state.reference_from_cam_R, R, R + 6));
}

static void test_a_frame_is_located_without_changing_the_map(void) {
  tv_image image = frame.image;
  tv_odometry_state found;
  fly(odometry, 5);
  save(odometry, map, &num_map);
  room_flight(num_flown - 4, pixels);
  tv_odometry_state_init(&found);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, NULL, -1, &found));
  TEST_ASSERT_TRUE(found.has_pose);
  TEST_ASSERT_TRUE(found.has_pose && found.reference_id >= 0);
  expect_unchanged();
  memset(pixels, 0, sizeof pixels);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, NULL, 0, &found));
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, found.status);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_locate(NULL, &image, NULL, 0, &found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_locate(odometry, NULL, NULL, 0, &found));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_locate(odometry, &image, NULL, 0, NULL));
  image.data = (const uint8_t *)&found;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_odometry_locate(odometry, &image, NULL, 0, &found));
  image.data = pixels, image.width = 16;
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, tv_odometry_locate(odometry, &image, NULL, 0, &found));
  image = frame.image, image.stride_bytes = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRIDE, tv_odometry_locate(odometry, &image, NULL, 0, &found));
  found.struct_size = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE,
                        tv_odometry_locate(odometry, &frame.image, NULL, 0, &found));
}

/* Neither before the map begins nor later. */
static void test_frames_go_on_as_if_none_had_been_located(void) {
  tv_odometry_state found;
  size_t num;
  int k;
  fly(odometry, 4);
  save(odometry, map, &num_map);
  begin(1, &other);
  tv_odometry_state_init(&found);
  for (k = 0; k < num_flown; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(other, k));
    room_flight(k / 2, pixels);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(other, &frame.image, NULL, -1, &found));
    TEST_ASSERT_EQUAL_INT(state.num_keyframes, found.num_keyframes);
    TEST_ASSERT_EQUAL_INT(state.num_frames, found.num_frames);
  }
  save(other, again, &num);
  TEST_ASSERT_EQUAL_UINT64(num_map, num);
  TEST_ASSERT_EQUAL_MEMORY(map, again, num);
}

static uint64_t count_calls(void *user) { return ++*(uint64_t *)user; }

static void test_the_camera_is_reported(void) {
  tv_camera used;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_camera(odometry, &used));
  TEST_ASSERT_EQUAL_MEMORY(&camera, &used, sizeof used);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_camera(NULL, &used));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_camera(odometry, NULL));
}

/* A mask that leaves the right part of the picture out, from this column on. */
static uint8_t used_pixels[ROOM_WIDTH * ROOM_HEIGHT];
static void make_mask(int edge, tv_image *mask) {
  int k;
  for (k = 0; k < ROOM_WIDTH * ROOM_HEIGHT; ++k) used_pixels[k] = k % ROOM_WIDTH < edge;
  *mask = api_image(used_pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH);
}

static void test_no_keypoint_is_taken_where_the_mask_is_0(void) {
  const int edge = 270;
  int32_t num, k, n;
  make_mask(edge, &frame.mask);
  for (n = 0; n < 12 || (!state.has_pose && n < MOST_FRAMES); ++n) {
    TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, n));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_last_frame(odometry, observations, KEYPOINTS, &num));
    TEST_ASSERT_EQUAL_INT32(KEYPOINTS, num);
    for (k = 0; k < num; ++k) TEST_ASSERT_TRUE(observations[k].x < edge + 0.5f);
  }
  TEST_ASSERT_TRUE(state.has_pose);
}

static void test_a_located_frame_has_no_keypoint_where_the_mask_is_0(void) {
  tv_image image, mask;
  tv_odometry_state found, masked;
  fly(odometry, 5);
  save(odometry, map, &num_map);
  image = frame.image;
  room_flight(num_flown - 4, pixels);
  tv_odometry_state_init(&found);
  tv_odometry_state_init(&masked);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, NULL, -1, &found));
  TEST_ASSERT_TRUE(found.has_pose);
  make_mask(ROOM_WIDTH, &mask);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, &mask, -1, &masked));
  TEST_ASSERT_EQUAL_MEMORY(&found, &masked, sizeof found);
  mask.data = NULL, mask.width = 1; /* not read */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, &mask, -1, &masked));
  TEST_ASSERT_EQUAL_MEMORY(&found, &masked, sizeof found);
  make_mask(2 * ROOM_WIDTH / 3, &mask);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, &mask, -1, &masked));
  TEST_ASSERT_TRUE(masked.has_pose);
  TEST_ASSERT_LESS_THAN_INT(found.num_inliers, masked.num_inliers);
  make_mask(0, &mask);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_locate(odometry, &image, &mask, -1, &masked));
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_LOST, masked.status);
  expect_unchanged();
  mask.width -= 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_MASK, tv_odometry_locate(odometry, &image, &mask, -1, &masked));
  mask = image, mask.data = (const uint8_t *)&masked;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_odometry_locate(odometry, &image, &mask, -1, &masked));
}

static void test_a_mask_without_0_and_the_frame_of_an_older_header_change_nothing(void) {
  size_t num;
  fly(odometry, 4);
  save(odometry, map, &num_map);
  make_mask(ROOM_WIDTH, &frame.mask);
  begin(1, &other);
  fly(other, 4);
  save(other, again, &num);
  TEST_ASSERT_EQUAL_UINT64(num_map, num);
  TEST_ASSERT_EQUAL_MEMORY(map, again, num);
  frame.mask.data = NULL, frame.mask.stride_bytes = 1; /* not read */
  frame.struct_size = offsetof(tv_odometry_frame, mask);
  begin(1, &other);
  fly(other, 4);
  save(other, again, &num);
  TEST_ASSERT_EQUAL_UINT64(num_map, num);
  TEST_ASSERT_EQUAL_MEMORY(map, again, num);
}

static void test_what_stands_still_is_reported_as_a_mask(void) {
  int k;
  fly(odometry, 4);
  TEST_ASSERT_TRUE(state.still_share == 0);
  memset(used_pixels, 7, sizeof used_pixels);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_still_mask(odometry, used_pixels, sizeof used_pixels));
  for (k = 0; k < ROOM_WIDTH * ROOM_HEIGHT; ++k) TEST_ASSERT_EQUAL_UINT8(255, used_pixels[k]);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_odometry_still_mask(odometry, used_pixels, sizeof used_pixels - 1));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_still_mask(odometry, NULL, sizeof used_pixels));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_still_mask(NULL, used_pixels, sizeof used_pixels));
}

static void test_the_clock_is_read(void) {
  uint64_t calls = 0, before, times[TV_NUM_STAGES];
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_set_clock(NULL, count_calls, &calls));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_set_clock(odometry, count_calls, &calls));
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, 0));
  TEST_ASSERT_TRUE(calls > 0);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_take_times(odometry, times, TV_NUM_STAGES));
  TEST_ASSERT_TRUE(times[TV_STAGE_DETECT] > 0 && times[TV_STAGE_DESCRIBE] > 0);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_take_times(NULL, times, TV_NUM_STAGES));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_take_times(odometry, NULL, TV_NUM_STAGES));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_odometry_take_times(odometry, times, -1));
  before = calls;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_set_clock(odometry, NULL, NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, 1));
  TEST_ASSERT_EQUAL_UINT64(before, calls);
}

static uint64_t number_at(const uint8_t *bytes, int width) {
  uint64_t n = 0;
  while (width > 0) n = n << 8 | bytes[--width];
  return n;
}

static double double_at(const uint8_t *bytes) {
  const uint64_t bits = number_at(bytes, 8);
  double x;
  memcpy(&x, &bits, sizeof x);
  return x;
}

/* CRC-32 by its definition, bit by bit. */
static uint32_t crc_of(const uint8_t *bytes, size_t num) {
  uint32_t crc = 0xffffffffu;
  int bit;
  while (num-- > 0) {
    crc ^= *bytes++;
    for (bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ ((crc & 1) ? 0xedb88320u : 0);
  }
  return ~crc;
}

/* Reads some of the map's bytes at the offsets of docs/formats.md. */
static void test_the_bytes_are_as_documented(void) {
  const uint8_t *p = map + HEADER;
  tv_keyframe keyframe;
  int32_t num, k, c;
  size_t size;
  fly(odometry, KEYFRAMES);
  for (k = 0; k < 20; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown++));
  save(odometry, map, &num_map);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save_size(odometry, &size));
  TEST_ASSERT_EQUAL_UINT64(size, num_map);
  TEST_ASSERT_EQUAL_MEMORY("TVMAP\r\n\x1a", map, 8);
  TEST_ASSERT_EQUAL_UINT64(2, number_at(map + 8, 4));
  TEST_ASSERT_EQUAL_UINT64(crc_of(map + 16, num_map - 16), number_at(map + 12, 4));
  TEST_ASSERT_EQUAL_UINT64(num_map, number_at(map + 16, 8));
  TEST_ASSERT_EQUAL_UINT64(ROOM_WIDTH, number_at(map + 28, 4));
  TEST_ASSERT_TRUE(double_at(map + 40) == camera.fx && double_at(map + 64) == camera.cy);
  TEST_ASSERT_EQUAL_UINT64(state.num_points, number_at(map + 136, 4));
  TEST_ASSERT_EQUAL_UINT64(state.num_keyframes, number_at(map + 140, 4));
  TEST_ASSERT_EQUAL_UINT64(state.num_frames, number_at(map + 156, 4));
  TEST_ASSERT_TRUE(double_at(map + 208) == camera.cx && double_at(map + 216) == camera.cy);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_points(odometry, points, POINTS, &num));
  for (k = 0; k < num; ++k, p += POINT) {
    TEST_ASSERT_EQUAL_UINT64(points[k].id, number_at(p + 24, 4));
    TEST_ASSERT_EQUAL_UINT64(points[k].grey, number_at(p + 44, 4));
    for (c = 0; c < 3; ++c) TEST_ASSERT_TRUE(double_at(p + 8 * c) == points[k].position[c]);
  }
  for (k = 0; k < state.num_keyframes; ++k) {
    const uint8_t *keypoint = p + KEYFRAME;
    int32_t i;
    tv_keyframe_init(&keyframe);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(odometry, k, &keyframe));
    TEST_ASSERT_EQUAL_UINT64(keyframe.id, number_at(p, 4));
    TEST_ASSERT_EQUAL_UINT64(keyframe.num_keypoints, number_at(p + 12, 4));
    TEST_ASSERT_TRUE(double_at(p + 16) == keyframe.time_s);
    TEST_ASSERT_TRUE(double_at(p + 32) == keyframe.world_from_cam_R[3]); /* its transpose */
    TEST_ASSERT_EQUAL_INT(TV_OK,
                          tv_odometry_observations(odometry, k, observations, KEYPOINTS, &num));
    for (i = 0, c = 0; i < keyframe.num_keypoints; ++i, keypoint += KEYPOINT) {
      const int32_t point = (int32_t)(uint32_t)number_at(keypoint + 12, 4);
      if (point == -1) continue;
      TEST_ASSERT_EQUAL_INT(observations[c].idx_keypoint, i);
      TEST_ASSERT_EQUAL_INT(observations[c++].idx_point, point);
    }
    TEST_ASSERT_EQUAL_INT(num, c);
    p = keypoint;
  }
  TEST_ASSERT_TRUE(number_at(map + 144, 4) > 0);
  TEST_ASSERT_EQUAL_PTR(map + num_map, p + REMOVED * number_at(map + 144, 4));
}

static void test_a_loaded_map_is_the_same_and_is_found_again(void) {
  size_t num_again;
  fly(odometry, KEYFRAMES);
  save(odometry, map, &num_map);
  begin(1, &other);
  TEST_ASSERT_EQUAL_INT(TV_OK, give(other, 3));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_load(other, map, num_map));
  save(other, again, &num_again);
  TEST_ASSERT_EQUAL_UINT64(num_map, num_again);
  TEST_ASSERT_EQUAL_MEMORY(map, again, num_map);
  room_flight(num_flown - 2, pixels);
  frame.time_s = -7; /* times may begin anew */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(other, &frame, &state));
  TEST_ASSERT_TRUE(state.has_pose);
  TEST_ASSERT_EQUAL_INT(1, state.relocated);
  TEST_ASSERT_EQUAL_INT(num_flown + 1, state.num_frames);
  for (num_again = 0; num_again < 20; ++num_again) { /* and the flight goes on */
    room_flight(num_flown - 2 + (int)num_again, pixels);
    frame.time_s += 0.03;
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(other, &frame, &state));
    TEST_ASSERT_TRUE(state.has_pose);
  }
  /* An empty map is one, too. */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  save(odometry, map, &num_map);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_load(other, map, num_map));
  TEST_ASSERT_EQUAL_INT(TV_OK, give(other, 0));
  TEST_ASSERT_EQUAL_INT(TV_ODOMETRY_STARTING, state.status);
}

/* Writes a length and a checksum that are right to the altered bytes. */
static void put_seal(size_t num) {
  uint32_t crc;
  int k;
  for (k = 0; k < 8; ++k) altered[16 + k] = (uint8_t)((uint64_t)num >> (8 * k));
  crc = crc_of(altered + 16, num - 16);
  for (k = 0; k < 4; ++k) altered[12 + k] = (uint8_t)(crc >> (8 * k));
}

static void put(size_t at, uint64_t number, int width) {
  for (; width > 0; --width, ++at, number >>= 8) altered[at] = (uint8_t)number;
}

/* The turn from the map's axes to those of the truth, of a keyframe of a flight that began at frame
   `first` of the room's and has the numbers from `number` on. It is the same for all keyframes of a
   segment. */
static double turn_to_truth(const tv_odometry *of, int32_t idx, int32_t number, int first) {
  tv_keyframe keyframe;
  double yaw;
  tv_keyframe_init(&keyframe);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(of, idx, &keyframe));
  yaw = 0.12 * sin(0.06 * (keyframe.frame - number + first));
  return atan2(keyframe.world_from_cam_R[2], keyframe.world_from_cam_R[0]) - yaw;
}

static void test_a_map_that_is_added_joins_where_it_is_seen_again(void) {
  enum { FIRST = 6 }; /* frame of the room's flight at which the second one begins */
  int32_t num_joined = -1, num_first, k, i, num;
  size_t num_two, num_all, size;
  tv_keyframe keyframe;
  fly(odometry, KEYFRAMES);
  num_first = state.num_frames;
  save(odometry, map, &num_map);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  for (k = FIRST; k < FIRST + 40; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, k));
  save(odometry, altered, &num_two);
  TEST_ASSERT_TRUE(state.num_keyframes >= 4);
  num = state.num_keyframes;

  options.max_keyframes = 3 * KEYFRAMES;
  options.max_points = 3 * POINTS;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_size(&camera, &options, &size));
  begin(1, &other);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, map, num_map, &num_joined));
  TEST_ASSERT_EQUAL_INT(0, num_joined); /* there was nothing to meet: as if it were loaded */
  save(other, again, &num_all);
  TEST_ASSERT_EQUAL_UINT64(num_map, num_all);
  TEST_ASSERT_EQUAL_MEMORY(map, again, num_map);

  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, altered, num_two, &num_joined));
  TEST_ASSERT_EQUAL_INT(1, num_joined);
  tv_keyframe_init(&keyframe);
  for (k = 0; k < KEYFRAMES + num; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_keyframe(other, k, &keyframe));
    TEST_ASSERT_EQUAL_INT(0, keyframe.segment);
    TEST_ASSERT_TRUE(k < KEYFRAMES || keyframe.frame >= num_first);
    /* All of one segment: one turn, to half a degree. */
    TEST_ASSERT_DOUBLE_WITHIN(
        0.01, turn_to_truth(other, 0, 0, 0),
        turn_to_truth(other, k, k < KEYFRAMES ? 0 : num_first, k < KEYFRAMES ? 0 : FIRST));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_observations(other, k, observations, KEYPOINTS, &i));
    TEST_ASSERT_EQUAL_INT(keyframe.num_observations, i);
  }
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_odometry_keyframe(other, k, &keyframe));
  /* What was joined is a map like others, in which frames are found. */
  save(other, again, &num_all);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_load(other, again, num_all));
  TEST_ASSERT_EQUAL_INT(TV_OK, give(other, FIRST + 30));
  TEST_ASSERT_TRUE(state.has_pose && state.segment == 0);
}

/* As of another job: what is not written before it is read is an index far outside. */
static void test_what_the_memory_held_does_not_matter(void) {
  static uint8_t joined[MAP];
  int32_t num_joined = 0, k;
  size_t num_two, num, num_all = 0;
  uint32_t noise = 1;
  int n;
  fly(odometry, KEYFRAMES);
  save(odometry, map, &num_map);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_reset(odometry));
  for (k = 6; k < 46; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, k));
  save(odometry, altered, &num_two);
  options.max_keyframes = 3 * KEYFRAMES;
  options.max_points = 3 * POINTS;
  for (n = 0; n < 2; ++n) { /* zeros, then noise */
    for (k = 0; k < MEMORY; ++k) {
      noise = noise * 1664525u + 1013904223u;
      blocks[1][k] = n == 0 ? 0 : (uint8_t)(noise >> 24);
    }
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&other, &camera, &options, blocks[1], MEMORY));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, map, num_map, &num_joined));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, altered, num_two, &num_joined));
    TEST_ASSERT_EQUAL_INT(1, num_joined);
    save(other, n == 0 ? joined : again, &num);
    if (n == 0) num_all = num;
    TEST_ASSERT_EQUAL_UINT64(num_all, num);
    TEST_ASSERT_TRUE(n == 0 || memcmp(joined, again, num) == 0);
  }
}

static void test_a_map_that_meets_nothing_is_a_segment_of_its_own(void) {
  int32_t num_joined = -1;
  size_t k, num, keyframe;
  fly(odometry, 3);
  save(odometry, altered, &num);
  for (k = HEADER; k < HEADER + POINT * number_at(altered + 136, 4); k += POINT) {
    memset(altered + k + POINT - TV_DESCRIPTOR_BYTES, (int)(k % 200), TV_DESCRIPTOR_BYTES);
  }
  keyframe = HEADER + POINT * number_at(altered + 136, 4);
  TEST_ASSERT_EQUAL_INT(0, number_at(altered + keyframe + 4, 4));
  put_seal(num);
  options.max_keyframes = 2 * KEYFRAMES;
  begin(1, &other);
  TEST_ASSERT_EQUAL_INT(TV_OK, give(other, 0));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, altered, num, &num_joined));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, altered, num, &num_joined));
  TEST_ASSERT_EQUAL_INT(0, num_joined);
  save(other, again, &k);
  TEST_ASSERT_EQUAL_INT(2, number_at(again + 160, 4));
  TEST_ASSERT_EQUAL_INT(6, number_at(again + 140, 4));
}

/* The metre belongs to the segment that it was measured in. */
static void test_a_map_that_is_added_brings_its_own_scale(void) {
  static const uint64_t hundred = 0x4059000000000000u, percent = 0x3f847ae147ae147bu;
  int32_t num_joined;
  size_t k, num, num_all;
  int metric, n;
  fly(odometry, 3);
  save(odometry, map, &num);
  options.max_keyframes = 2 * KEYFRAMES;
  for (metric = 0; metric < 2; ++metric) { /* the first map, or the one that is added */
    const int last = metric == 1 ? TV_SCALE_VELOCITY : TV_SCALE_UNIT;
    begin(1, &other);
    for (n = 0; n < 2; ++n) {
      memcpy(altered, map, num);
      if (n == metric) {
        put(176, TV_SCALE_VELOCITY, 4), put(180, TV_SCALE_VELOCITY, 4);
        put(184, hundred, 8), put(192, hundred, 8), put(200, percent, 8);
      }
      for (k = HEADER; n == 1 && k < HEADER + POINT * number_at(map + 136, 4); k += POINT) {
        memset(altered + k + POINT - TV_DESCRIPTOR_BYTES, (int)(k % 200), TV_DESCRIPTOR_BYTES);
      }
      put_seal(num);
      TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_add(other, altered, num, &num_joined));
      TEST_ASSERT_EQUAL_INT(0, num_joined);
    }
    save(other, again, &num_all); /* tells the scale of the last segment */
    TEST_ASSERT_EQUAL_INT(last, number_at(again + 176, 4));
    TEST_ASSERT_EQUAL_INT(TV_OK, give(other, num_flown - 1));
    TEST_ASSERT_TRUE(state.has_pose && state.segment == 0);
    TEST_ASSERT_EQUAL_INT(metric == 0 ? TV_SCALE_VELOCITY : TV_SCALE_UNIT, state.scale_source);
    save(other, again, &num_all);
    TEST_ASSERT_EQUAL_INT(last, number_at(again + 176, 4));
  }
}

static void test_add_refuses_what_load_refuses(void) {
  int32_t num_joined = 7;
  size_t num, k;
  fly(odometry, KEYFRAMES);
  save(odometry, map, &num_map);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_add(NULL, map, num_map, &num_joined));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_add(odometry, NULL, num_map, &num_joined));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_add(odometry, map, num_map, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_odometry_add(odometry, map, num_map, (int32_t *)(map + 64)));
  /* As many keyframes again as the map may have. */
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS, tv_odometry_add(odometry, map, num_map, &num_joined));
  memcpy(altered, map, num_map);
  for (k = 0; k < num_map; k += 97) {
    altered[k] ^= 5;
    TEST_ASSERT_EQUAL_INT(TV_ERR_MAP, tv_odometry_add(odometry, altered, num_map, &num_joined));
    altered[k] = map[k];
    TEST_ASSERT_EQUAL_INT(TV_ERR_MAP, tv_odometry_add(odometry, altered, k, &num_joined));
  }
  camera.fx += 1e-9;
  begin(1, &other);
  save(other, altered, &num);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAMERA, tv_odometry_add(odometry, altered, num, &num_joined));
  TEST_ASSERT_EQUAL_INT(7, num_joined);
  expect_unchanged();
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown));
  TEST_ASSERT_TRUE(state.has_pose);
}

static void test_save_refuses_bad_arguments(void) {
  size_t num = 0, needed;
  fly(odometry, 2);
  save(odometry, map, &needed);
  memset(again, API_PATTERN, sizeof again);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_save_size(NULL, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_save_size(odometry, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_save(NULL, again, MAP, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_save(odometry, NULL, 1, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_save(odometry, again, MAP, NULL));
  TEST_ASSERT_EQUAL_UINT64(0, num);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, tv_odometry_save(odometry, again, needed - 1, &num));
  TEST_ASSERT_EQUAL_UINT64(needed, num);
  num = 4;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_odometry_save(odometry, (uint8_t *)&num, 8, &num));
  TEST_ASSERT_TRUE(api_is_pattern(again, sizeof again));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_save(odometry, again, needed, &num));
  TEST_ASSERT_TRUE(api_is_pattern(again + needed, sizeof again - needed));
}

static void expect_load(tv_status expected, size_t num) {
  TEST_ASSERT_EQUAL_INT(expected, tv_odometry_load(odometry, altered, num));
}

/* A smaller map, so that each of its bytes can be altered. */
static void fly_little(void) {
  options.max_keypoints = 120;
  begin(0, &odometry);
  fly(odometry, 2);
  save(odometry, map, &num_map);
  memcpy(altered, map, num_map);
}

static void test_a_map_that_is_cut_or_altered_at_any_byte_is_refused(void) {
  size_t k;
  fly_little();
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_load(NULL, map, num_map));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_odometry_load(odometry, NULL, num_map));
  for (k = 0; k < num_map; ++k) {
    altered[k] ^= (uint8_t)(1 + k % 255);
    expect_load(TV_ERR_MAP, num_map);
    altered[k] = map[k];
    expect_load(TV_ERR_MAP, k);
  }
  altered[num_map] = 0;
  expect_load(TV_ERR_MAP, num_map + 1);
  expect_unchanged();
  /* The odometry goes on as if nothing had been. */
  TEST_ASSERT_EQUAL_INT(TV_OK, give(odometry, num_flown));
  TEST_ASSERT_TRUE(state.has_pose);
}

/* Expects the status for the altered bytes with a length and a checksum that are right. */
static void expect_sealed(tv_status expected, size_t num) {
  put_seal(num);
  expect_load(expected, num);
  memcpy(altered, map, num_map);
  if (expected != TV_OK) expect_unchanged();
}

static void test_a_map_of_wrong_content_is_refused(void) {
  static const uint64_t nan = 0x7ff8000000000000u, huge = 0x7fe0000000000000u;
  size_t keyframe, keypoint, k;
  fly_little();
  keyframe = HEADER + POINT * number_at(map + 136, 4);
  keypoint = keyframe + KEYFRAME;
  expect_sealed(TV_OK, num_map);
  put(8, 1, 4), expect_sealed(TV_ERR_MAP, num_map);    /* the version */
  put(36, 1, 4), expect_sealed(TV_ERR_MAP, num_map);   /* the camera's reserved field */
  put(40, nan, 8), expect_sealed(TV_ERR_MAP, num_map); /* fx */
  put(172, 2, 4), expect_sealed(TV_ERR_MAP, num_map);  /* upright or not */
  put(172, 1, 4), expect_sealed(TV_ERR_MAP, num_map);  /* where no keyframe knows what is down */
  for (k = 136; k < 172; k += 4) {                     /* the counts */
    put(k, 0xffffffffu, 4), expect_sealed(TV_ERR_MAP, num_map);
  }
  put(176, 4, 4), expect_sealed(TV_ERR_MAP, num_map); /* the scale */
  put(184, 0x3ff0000000000000u, 8), put(192, 0, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(192, nan, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(180, 1, 4), put(184, huge, 8), put(192, 1, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(208, nan, 8), expect_sealed(TV_ERR_MAP, num_map); /* the principal point */
  put(216, huge, 8), expect_sealed(TV_ERR_MAP, num_map);
  for (k = 136; k < 148; k += 4) { /* one more or one less than there are */
    put(k, number_at(map + k, 4) + 1, 4), expect_sealed(TV_ERR_MAP, num_map);
    put(k, number_at(map + k, 4) - 1, 4), expect_sealed(TV_ERR_MAP, num_map);
  }
  put(148, 1, 4), expect_sealed(TV_ERR_MAP, num_map); /* the next ids */
  put(152, 1, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(160, 0, 4), expect_sealed(TV_ERR_MAP, num_map); /* the segments */
  /* Points: position, id as of the next, segment, counts, keyframe, grey, sigma, seen_from. */
  put(HEADER + 8, nan, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 16, huge, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 24, number_at(map + HEADER + POINT + 24, 4), 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 28, 1, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 32, 0x80000000u, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 36, 0x3fffffffu, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 40, 1000, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 44, 256, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 48, 0xbf800000u, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(HEADER + 52, 0x7f800000u, 4), expect_sealed(TV_ERR_MAP, num_map);
  /* Keyframes: id, segment, frame, keypoints, time, R, t, sigma, scale. */
  put(keyframe, 1, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 4, 1, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 8, 1000, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 12, 0xffffffffu, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 12, 0x3fffffffu, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 16, nan, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 24, 0x3fe0000000000000u, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 96, nan, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 144, 0xbff0000000000000u, 8), expect_sealed(TV_ERR_MAP, num_map);
  /* Who knows what is down, in a map that is not upright. */
  put(keyframe + 144, 0x3ff0000000000000u, 8), expect_sealed(TV_ERR_MAP, num_map);
  put(keyframe + 168, 0, 8), expect_sealed(TV_ERR_MAP, num_map);
  /* Keypoints: x, size, a point that does not exist. */
  put(keypoint, 0x7fc00000u, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keypoint + 8, 0, 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keypoint + 12, number_at(map + 136, 4), 4), expect_sealed(TV_ERR_MAP, num_map);
  put(keypoint + 12, 0xfffffffeu, 4), expect_sealed(TV_ERR_MAP, num_map);
  /* A removed keyframe whose id is that of what replaced it. */
  put(144, 1, 4);
  memset(altered + num_map, 0, REMOVED);
  expect_sealed(TV_ERR_MAP, num_map + REMOVED);
  altered[num_map] = 0;
  expect_sealed(TV_ERR_MAP, num_map + 1); /* a byte too many */
}

static void test_a_map_of_another_camera_or_too_large_is_refused(void) {
  size_t num;
  fly(odometry, 3);
  save(odometry, altered, &num);
  camera.fx += 1e-9;
  begin(0, &odometry);
  save(odometry, map, &num_map);
  expect_load(TV_ERR_CAMERA, num);
  expect_unchanged();
  camera = room_camera();
  camera.k[0] = 7; /* which a pinhole ignores */
  options.max_keypoints = KEYPOINTS - 1;
  begin(0, &odometry);
  save(odometry, map, &num_map);
  expect_load(TV_ERR_LIMITS, num);
  expect_unchanged();
  options.max_keypoints = KEYPOINTS + 100;
  begin(0, &odometry);
  expect_load(TV_OK, num);
  save(odometry, map, &num_map);
  TEST_ASSERT_EQUAL_UINT64(num, num_map);
  TEST_ASSERT_EQUAL_MEMORY(altered, map, num);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_init_functions_write_defaults_and_sizes);
  RUN_TEST(test_each_status_has_a_name);
  RUN_TEST(test_size_refuses_bad_cameras_and_options);
  RUN_TEST(test_init_refuses_bad_memory);
  RUN_TEST(test_a_flight_stays_within_its_memory);
  RUN_TEST(test_every_kernel_set_gives_the_same_map);
  RUN_TEST(test_bad_frames_are_refused);
  RUN_TEST(test_wrong_sensors_are_left_out_of_account);
  RUN_TEST(test_the_map_holds_together);
  RUN_TEST(test_covariances_hold_the_true_turns);
  RUN_TEST(test_points_have_covariances);
  RUN_TEST(test_the_last_frame_is_shown);
  RUN_TEST(test_a_keyframe_is_adjusted_when_the_next_frame_comes);
  RUN_TEST(test_a_segment_is_weak_until_a_pair_of_keyframes_confirms_it);
  RUN_TEST(test_doubts_stay_with_their_segment);
  RUN_TEST(test_velocities_say_nothing_of_a_gap);
  RUN_TEST(test_a_clock_may_begin_anew_with_a_gap);
  RUN_TEST(test_a_lost_frame_is_found_where_its_attitude_allows);
  RUN_TEST(test_a_lost_frame_is_found_where_its_pose_is_beyond_doubt);
  RUN_TEST(test_finish_adjusts_the_newest_keyframe);
  RUN_TEST(test_accessors_refuse_bad_arguments);
  RUN_TEST(test_poses_are_found_again_from_their_keyframes);
  RUN_TEST(test_a_frame_is_located_without_changing_the_map);
  RUN_TEST(test_frames_go_on_as_if_none_had_been_located);
  RUN_TEST(test_the_camera_is_reported);
  RUN_TEST(test_no_keypoint_is_taken_where_the_mask_is_0);
  RUN_TEST(test_a_located_frame_has_no_keypoint_where_the_mask_is_0);
  RUN_TEST(test_a_mask_without_0_and_the_frame_of_an_older_header_change_nothing);
  RUN_TEST(test_what_stands_still_is_reported_as_a_mask);
  RUN_TEST(test_the_clock_is_read);
  RUN_TEST(test_the_bytes_are_as_documented);
  RUN_TEST(test_a_loaded_map_is_the_same_and_is_found_again);
  RUN_TEST(test_a_map_that_is_added_joins_where_it_is_seen_again);
  RUN_TEST(test_what_the_memory_held_does_not_matter);
  RUN_TEST(test_a_map_that_meets_nothing_is_a_segment_of_its_own);
  RUN_TEST(test_a_map_that_is_added_brings_its_own_scale);
  RUN_TEST(test_add_refuses_what_load_refuses);
  RUN_TEST(test_save_refuses_bad_arguments);
  RUN_TEST(test_a_map_that_is_cut_or_altered_at_any_byte_is_refused);
  RUN_TEST(test_a_map_of_wrong_content_is_refused);
  RUN_TEST(test_a_map_of_another_camera_or_too_large_is_refused);
  return UNITY_END();
}
