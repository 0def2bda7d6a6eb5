/* Tests of tv_room: the statuses, the memory and the outputs that the header promises. */
#include <math.h>
#include <string.h>

#include "support/api.h"
#include "twoview/twoview.h"
#include "unity.h"

enum { WIDTH = 96, HEIGHT = 72, PIXELS = WIDTH * HEIGHT, ROOM = 3 << 20, MOST = 60000 };

static uint8_t block[ROOM + 2 * API_GUARD_BYTES + TV_CONTEXT_ALIGNMENT];
static uint8_t *memory;
static float distance[PIXELS], sigma[PIXELS];
static uint8_t witnesses[PIXELS], pixels[3 * PIXELS];
static tv_depth_map map;
static tv_camera camera;
static double *const R = map.world_from_cam_R, *const t = map.world_from_cam_t;
static tv_room *room;
static tv_room_vertex vertices[MOST];
static tv_room_triangle triangles[MOST];
static int32_t num_vertices, num_triangles;

/* A wall 1.5 in front of the camera, which the map sees whole. */
void setUp(void) {
  int i;
  memset(&camera, 0, sizeof camera);
  camera.width = WIDTH, camera.height = HEIGHT;
  camera.fx = camera.fy = 80, camera.cx = 47.5, camera.cy = 35.5;
  for (i = 0; i < PIXELS; ++i) {
    const double x = (i % WIDTH - camera.cx) / 80, y = (i / WIDTH - camera.cy) / 80;
    distance[i] = (float)(1.5 * sqrt(x * x + y * y + 1));
    sigma[i] = 0.01f;
    witnesses[i] = 1;
    pixels[3 * i] = pixels[3 * i + 1] = pixels[3 * i + 2] = 77;
  }
  tv_depth_map_init(&map);
  map.camera = &camera;
  for (i = 0; i < 9; ++i) R[i] = i % 4 == 0;
  map.width = map.stride = WIDTH, map.height = HEIGHT;
  map.distance = distance, map.sigma = sigma, map.witnesses = witnesses;
  map.pixels = pixels, map.channels = 3, map.pixel_stride_bytes = 3 * WIDTH;
  memset(block, API_PATTERN, sizeof block);
  memory = block + API_GUARD_BYTES;
  memory += TV_CONTEXT_ALIGNMENT - (uintptr_t)memory % TV_CONTEXT_ALIGNMENT;
  room = NULL;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_init(&room, NULL, memory, ROOM));
}

void tearDown(void) {}

static tv_status add(void) { return tv_room_add(room, &map); }

static tv_status mesh(const tv_room_mesh_options *options) {
  return tv_room_mesh(room, options, vertices, MOST, &num_vertices, triangles, MOST,
                      &num_triangles);
}

static void expect_maps(int32_t expected) {
  tv_room_state state;
  tv_room_state_init(&state);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_get_state(room, &state));
  TEST_ASSERT_EQUAL_INT(expected, state.num_maps);
}

/* That a map is refused with this status, and that it is by the functions that take equal
   arguments, too. */
static void expect_refusal(tv_status expected) {
  TEST_ASSERT_EQUAL_INT(expected, tv_room_add(room, &map));
  TEST_ASSERT_EQUAL_INT(expected, tv_room_remove(room, &map));
  TEST_ASSERT_EQUAL_INT(expected, tv_room_see_through(room, &map));
  expect_maps(0);
  setUp();
}

static void test_defaults_are_those_of_the_header(void) {
  tv_room_options options;
  tv_room_mesh_options of_mesh;
  tv_room_plane_options of_planes;
  tv_room_infer_options of_infer;
  tv_room_options_init(&options);
  TEST_ASSERT_EQUAL_INT(3, options.truncation_voxels);
  TEST_ASSERT_EQUAL_DOUBLE(0.03, options.voxel);
  TEST_ASSERT_EQUAL_DOUBLE(0, options.max_distance);
  tv_room_mesh_options_init(&of_mesh);
  TEST_ASSERT_EQUAL_INT(1, of_mesh.min_maps);
  TEST_ASSERT_EQUAL_INT(64, of_mesh.min_piece_triangles);
  TEST_ASSERT_EQUAL_INT(0, of_mesh.measured_only);
  tv_room_plane_options_init(&of_planes);
  TEST_ASSERT_EQUAL_DOUBLE(0.02, of_planes.gravity_sigma_rad);
  tv_room_infer_options_init(&of_infer);
  TEST_ASSERT_EQUAL_INT(3, of_infer.max_step);
  TEST_ASSERT_TRUE(of_infer.planes == NULL && of_infer.num_planes == 0);
  tv_room_options_init(NULL);
  tv_depth_map_init(NULL);
  tv_room_state_init(NULL);
  tv_room_mesh_options_init(NULL);
  tv_room_plane_options_init(NULL);
  tv_room_infer_options_init(NULL);
}

static void test_init_refuses(void) {
  tv_room_options o;
  tv_room *made = NULL;
  tv_room_options_init(&o);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_init(&made, &o, NULL, ROOM));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_init(NULL, &o, memory, ROOM));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ALIGNMENT, tv_room_init(&made, &o, memory + 8, ROOM));
  TEST_ASSERT_EQUAL_INT(TV_ERR_MEMORY, tv_room_init(&made, &o, memory, TV_ROOM_MIN_BYTES - 1));
  o.struct_size = 3;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_room_init(&made, &o, memory, ROOM));
  tv_room_options_init(&o);
  o.voxel = NAN;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_room_init(&made, &o, memory, ROOM));
  o.voxel = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_init(&made, &o, memory, ROOM));
  tv_room_options_init(&o);
  o.truncation_voxels = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_init(&made, &o, memory, ROOM));
  o.truncation_voxels = 9;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_init(&made, &o, memory, ROOM));
  tv_room_options_init(&o);
  o.max_distance = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_init(&made, &o, memory, ROOM));
  TEST_ASSERT_NULL(made);
}

static void test_a_room_stays_within_its_memory(void) {
  static const size_t sizes[] = {TV_ROOM_MIN_BYTES, TV_ROOM_MIN_BYTES + 1, 700001, ROOM};
  size_t k, i;
  for (k = 0; k < sizeof sizes / sizeof *sizes; ++k) {
    tv_room_state state;
    tv_status status;
    memset(block, API_PATTERN, sizeof block);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_init(&room, NULL, memory, sizes[k]));
    tv_room_state_init(&state);
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_get_state(room, &state));
    TEST_ASSERT_TRUE(state.cap_blocks > (int32_t)(sizes[k] / 1400) - 90);
    for (status = TV_OK, i = 0; status == TV_OK && i < 40; ++i) {
      t[2] = 0.3 * (double)i;
      status = add();
    }
    TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY, status);
    TEST_ASSERT_EQUAL_INT(TV_OK, mesh(NULL));
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_coarsen(room));
    TEST_ASSERT_EQUAL_INT(TV_OK, mesh(NULL));
    for (i = sizes[k]; memory + i < block + sizeof block; ++i) {
      TEST_ASSERT_EQUAL_UINT8(API_PATTERN, memory[i]);
    }
    for (i = 0; block + i < memory; ++i) TEST_ASSERT_EQUAL_UINT8(API_PATTERN, block[i]);
  }
}

static void test_a_map_is_refused(void) {
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_add(NULL, &map));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_add(room, NULL));
  map.camera = NULL;
  expect_refusal(TV_ERR_NULL);
  map.distance = NULL;
  expect_refusal(TV_ERR_NULL);
  map.struct_size = 2;
  expect_refusal(TV_ERR_STRUCT_SIZE);
  map.width = 0;
  expect_refusal(TV_ERR_ARGUMENT);
  map.height = 16385;
  expect_refusal(TV_ERR_ARGUMENT);
  map.stride = WIDTH - 1;
  expect_refusal(TV_ERR_ARGUMENT);
  map.inferred = 2;
  expect_refusal(TV_ERR_ARGUMENT);
  map.channels = 2;
  expect_refusal(TV_ERR_ARGUMENT);
  map.pixel_stride_bytes = 3 * WIDTH - 1;
  expect_refusal(TV_ERR_ARGUMENT);
  map.mask = pixels, map.mask_stride_bytes = WIDTH - 1;
  expect_refusal(TV_ERR_ARGUMENT);
  map.height = HEIGHT - 1;
  expect_refusal(TV_ERR_CAMERA);
  camera.fx = 0;
  expect_refusal(TV_ERR_CAMERA);
  R[0] = 2;
  expect_refusal(TV_ERR_ARGUMENT);
  R[4] = NAN;
  expect_refusal(TV_ERR_NOT_FINITE);
  t[1] = INFINITY;
  expect_refusal(TV_ERR_NOT_FINITE);
  /* Pixels may be absent, and then the rest of them is not read. */
  map.pixels = NULL, map.channels = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  map.sigma = NULL, map.witnesses = NULL;
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  map.mask = pixels, map.mask_stride_bytes = 3 * WIDTH;
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  expect_maps(3);
}

static void test_what_is_not_in_the_room_is_not_removed(void) {
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_remove(room, &map));
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  expect_maps(2);
  t[0] = 0.01;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_remove(room, &map));
  t[0] = 0;
  pixels[5] = 3;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_remove(room, &map));
  pixels[5] = 77;
  map.inferred = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_remove(room, &map));
  map.inferred = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_remove(room, &map));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_remove(room, &map));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_remove(room, &map));
  expect_maps(0);
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(NULL));
  TEST_ASSERT_EQUAL_INT(0, num_vertices);
}

/* As many maps as a room holds, of one pixel: no sum overflows, and all of them are removed. */
static void test_a_room_holds_its_limit_of_maps(void) {
  int32_t k;
  for (k = 0; k < PIXELS; ++k) {
    if (k / WIDTH < 30 || k / WIDTH > 40 || k % WIDTH < 40 || k % WIDTH > 50) distance[k] = 0;
    pixels[3 * k] = 255;
  }
  for (k = 0; k < TV_ROOM_MAX_MAPS; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS, add());
  expect_maps(TV_ROOM_MAX_MAPS);
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(NULL));
  TEST_ASSERT_TRUE(num_vertices > 20);
  for (k = 0; k < num_vertices; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_ROOM_MAX_MAPS, vertices[k].num_maps);
    TEST_ASSERT_FLOAT_WITHIN(0.001f, 1.5f, vertices[k].position[2]);
    TEST_ASSERT_EQUAL_UINT8(255, vertices[k].rgb[0]);
    TEST_ASSERT_EQUAL_UINT8(77, vertices[k].rgb[1]);
  }
  for (k = 0; k < TV_ROOM_MAX_MAPS; ++k) {
    TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_remove(room, &map));
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(NULL));
  TEST_ASSERT_EQUAL_INT(0, num_vertices);
}

static void test_prune_refuses(void) {
  int32_t freed = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_prune(NULL, 2, &freed));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_prune(room, 0, &freed));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_prune(room, 256, &freed));
  TEST_ASSERT_EQUAL_INT(-1, freed);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_prune(room, 255, &freed));
  TEST_ASSERT_EQUAL_INT(0, freed);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_prune(room, 1, NULL));
}

static void test_a_room_is_coarsened_sixteen_times(void) {
  int k;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_coarsen(NULL));
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  for (k = 0; k < 16; ++k) TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_coarsen(room));
  TEST_ASSERT_EQUAL_INT(TV_ERR_LIMITS, tv_room_coarsen(room));
  expect_maps(1);
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_remove(room, &map));
}

static void test_a_state_is_written_as_far_as_its_size(void) {
  tv_room_state state;
  memset(&state, API_PATTERN, sizeof state);
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_get_state(NULL, &state));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_get_state(room, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_room_get_state(room, &state));
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  state.struct_size = 16;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_get_state(room, &state));
  TEST_ASSERT_EQUAL_INT(1, state.num_maps);
  TEST_ASSERT_EQUAL_UINT8(API_PATTERN, *(const uint8_t *)&state.voxel);
  tv_room_state_init(&state);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_get_state(room, &state));
  TEST_ASSERT_EQUAL_DOUBLE(0.03, state.voxel);
  TEST_ASSERT_TRUE(state.min[2] > 1.2 && state.min[2] <= 1.5 - 0.09);
  TEST_ASSERT_TRUE(state.max[2] >= 1.5 + 0.09 && state.max[2] < 1.8);
  TEST_ASSERT_TRUE(state.min[0] < -0.8 && state.max[0] > 0.8);
}

static void expect_mesh_refusal(tv_status expected, const tv_room_mesh_options *options) {
  static tv_room_vertex untouched[MOST];
  memset(untouched, API_PATTERN, sizeof untouched);
  memset(vertices, API_PATTERN, sizeof vertices);
  num_vertices = -7;
  TEST_ASSERT_EQUAL_INT(expected, mesh(options));
  TEST_ASSERT_EQUAL_INT(-7, num_vertices);
  TEST_ASSERT_EQUAL_MEMORY(untouched, vertices, sizeof vertices);
}

static void test_a_mesh_is_refused(void) {
  tv_room_mesh_options o;
  int32_t n;
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_mesh(NULL, NULL, NULL, 0, &n, NULL, 0, &n));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_mesh(room, NULL, NULL, 1, &n, NULL, 0, &n));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_mesh(room, NULL, NULL, 0, &n, NULL, 1, &n));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_mesh(room, NULL, NULL, 0, NULL, NULL, 0, &n));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_mesh(room, NULL, NULL, 0, &n, NULL, 0, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, tv_room_mesh(room, NULL, NULL, 0, &n, NULL, 0, &n));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_room_mesh(room, NULL, (tv_room_vertex *)(void *)memory, MOST,
                                     &num_vertices, triangles, MOST, &num_triangles));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_mesh(room, NULL, vertices, -1, &num_vertices,
                                                      triangles, MOST, &num_triangles));
  tv_room_mesh_options_init(&o);
  o.struct_size = 1;
  expect_mesh_refusal(TV_ERR_STRUCT_SIZE, &o);
  tv_room_mesh_options_init(&o);
  o.min_maps = 256;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  tv_room_mesh_options_init(&o);
  o.min_piece_triangles = -1;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  tv_room_mesh_options_init(&o);
  o.measured_only = 2;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  tv_room_mesh_options_init(&o);
  o.min[1] = 1;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  tv_room_mesh_options_init(&o);
  o.max[1] = NAN;
  expect_mesh_refusal(TV_ERR_NOT_FINITE, &o);
  tv_room_mesh_options_init(&o);
  o.max_sigma = -1;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  o.max_sigma = INFINITY;
  expect_mesh_refusal(TV_ERR_NOT_FINITE, &o);
  tv_room_mesh_options_init(&o);
  o.reserved = 1;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
}

static void test_the_planes_of_a_mesh_are_checked(void) {
  static tv_room_plane planes[TV_ROOM_MAX_PLANES + 1];
  tv_room_mesh_options o;
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  tv_room_mesh_options_init(&o);
  o.num_planes = 1;
  expect_mesh_refusal(TV_ERR_NULL, &o);
  o.planes = planes;
  o.num_planes = -1;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  o.num_planes = TV_ROOM_MAX_PLANES + 1;
  expect_mesh_refusal(TV_ERR_ARGUMENT, &o);
  o.num_planes = 2;
  planes[1].normal[2] = NAN;
  expect_mesh_refusal(TV_ERR_NOT_FINITE, &o);
  planes[1].normal[2] = 0;
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(&o));
  o.planes = (const tv_room_plane *)(const void *)vertices;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, mesh(&o));
}

/* A program of the release before knows the options up to the box only. */
static void test_shorter_mesh_options_mean_no_planes(void) {
  tv_room_mesh_options o;
  tv_room_mesh_options_init_sized(&o, 64);
  memset((uint8_t *)&o + 64, API_PATTERN, sizeof o - 64);
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(&o));
  TEST_ASSERT_TRUE(num_vertices > 2000);
}

static void test_a_mesh_says_how_much_room_it_needs(void) {
  int32_t most_vertices, most_triangles;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_room_mesh(room, NULL, NULL, 0, &num_vertices, NULL, 0, &num_triangles));
  TEST_ASSERT_EQUAL_INT(0, num_vertices);
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_room_mesh(room, NULL, NULL, 0, &num_vertices, NULL, 0, &num_triangles));
  most_vertices = num_vertices, most_triangles = num_triangles;
  TEST_ASSERT_TRUE(most_vertices > 2000 && most_vertices < MOST);
  TEST_ASSERT_EQUAL_INT(TV_ERR_CAPACITY,
                        tv_room_mesh(room, NULL, vertices, most_vertices - 1, &num_vertices,
                                     triangles, most_triangles, &num_triangles));
  memset(vertices, API_PATTERN, sizeof vertices);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_mesh(room, NULL, vertices, most_vertices, &num_vertices,
                                            triangles, most_triangles, &num_triangles));
  TEST_ASSERT_TRUE(num_vertices <= most_vertices && num_triangles <= most_triangles);
  TEST_ASSERT_EQUAL_UINT8(API_PATTERN, *(const uint8_t *)&vertices[most_vertices]);
}

static void test_a_mesh_of_few_views_is_left_out_when_wanted(void) {
  tv_room_mesh_options o;
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  tv_room_mesh_options_init(&o);
  o.min_maps = 2;
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(&o));
  TEST_ASSERT_EQUAL_INT(0, num_vertices);
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_OK, mesh(&o));
  TEST_ASSERT_TRUE(num_vertices > 2000);
}

static void test_planes_are_refused_and_found(void) {
  static tv_room_plane planes[TV_ROOM_MAX_PLANES];
  tv_room_plane_options o;
  int32_t num = -7;
  tv_room_plane_options_init(&o);
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_find_planes(NULL, &o, planes, 4, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_find_planes(room, &o, NULL, 4, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_find_planes(room, &o, planes, 4, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_find_planes(room, &o, planes, -1, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_find_planes(room, &o, planes, 65, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        tv_room_find_planes(room, &o, (tv_room_plane *)(void *)memory, 4, &num));
  o.gravity_sigma_rad = 0;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_find_planes(room, &o, planes, 4, &num));
  tv_room_plane_options_init(&o);
  o.min_area = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_find_planes(room, &o, planes, 4, &num));
  tv_room_plane_options_init(&o);
  o.min_maps_behind = -1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_find_planes(room, &o, planes, 4, &num));
  o.min_maps_behind = 256;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_find_planes(room, &o, planes, 4, &num));
  tv_room_plane_options_init(&o);
  o.gravity[1] = INFINITY;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, tv_room_find_planes(room, &o, planes, 4, &num));
  tv_room_plane_options_init(&o);
  o.struct_size = 2;
  TEST_ASSERT_EQUAL_INT(TV_ERR_STRUCT_SIZE, tv_room_find_planes(room, &o, planes, 4, &num));
  TEST_ASSERT_EQUAL_INT(-7, num);
  tv_room_plane_options_init(&o);
  o.gravity[1] = 1e-300; /* of any length */
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_find_planes(room, &o, planes, 4, &num));
  TEST_ASSERT_EQUAL_INT(1, num);
  TEST_ASSERT_EQUAL_INT(TV_ROOM_PLANE_UPRIGHT, planes[0].kind);
  TEST_ASSERT_DOUBLE_WITHIN(0.002, -1.5, planes[0].offset);
  TEST_ASSERT_DOUBLE_WITHIN(0.25, 2.4, planes[0].area);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_find_planes(room, NULL, planes, 4, &num));
  TEST_ASSERT_EQUAL_INT(TV_ROOM_PLANE_OTHER, planes[0].kind);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_find_planes(room, NULL, NULL, 0, &num));
  TEST_ASSERT_EQUAL_INT(0, num);
}

/* The middle of the wall has no distance; its texture ends around there. */
static void test_inference_is_refused_and_fills_the_wall(void) {
  static uint8_t scratch[1 << 16];
  static tv_room_plane plane;
  static float out[PIXELS], out_sigma[PIXELS];
  uint8_t *aligned = scratch + TV_CONTEXT_ALIGNMENT - (uintptr_t)scratch % TV_CONTEXT_ALIGNMENT;
  tv_room_infer_options o;
  size_t bytes = 0;
  int32_t num = -7, i;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, tv_room_infer_size(WIDTH, HEIGHT, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_infer_size(0, HEIGHT, &bytes));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, tv_room_infer_size(WIDTH, 16385, &bytes));
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_infer_size(WIDTH, HEIGHT, &bytes));
  TEST_ASSERT_TRUE(bytes <= sizeof scratch - TV_CONTEXT_ALIGNMENT);
  for (i = 0; i < PIXELS; ++i) {
    const int x = i % WIDTH, y = i / WIDTH;
    if (x >= 16 && x < 80 && y >= 16 && y < 56) {
      distance[i] = 0;
    } else if (x < 12 || x >= 84 || y < 12 || y >= 60) {
      memset(pixels + 3 * i, (x ^ y) % 4 * 60, 3);
    }
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, add());
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_room_find_planes(room, NULL, &plane, 1, &num));
  TEST_ASSERT_EQUAL_INT(1, num);
  tv_room_infer_options_init(&o);
  num = -7;
#define INFER(room_, map_, planes_, count_, memory_, bytes_, out_, num_) \
  (o.planes = (planes_), o.num_planes = (count_),                        \
   tv_room_infer(room_, memory_, bytes_, map_, &o, out_, out_sigma, num_))
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, INFER(NULL, &map, &plane, 1, aligned, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, INFER(room, NULL, &plane, 1, aligned, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, INFER(room, &map, NULL, 1, aligned, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, INFER(room, &map, &plane, 1, NULL, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, INFER(room, &map, &plane, 1, aligned, bytes, NULL, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_NULL, INFER(room, &map, &plane, 1, aligned, bytes, out, NULL));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, INFER(room, &map, &plane, -1, aligned, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_ALIGNMENT,
                        INFER(room, &map, &plane, 1, aligned + 8, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_MEMORY, INFER(room, &map, &plane, 1, aligned, bytes - 1, out, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        INFER(room, &map, &plane, 1, aligned, bytes, out_sigma, &num));
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP,
                        INFER(room, &map, &plane, 1, aligned, bytes, distance, &num));
  map.mask = (const uint8_t *)out, map.mask_stride_bytes = WIDTH;
  TEST_ASSERT_EQUAL_INT(TV_ERR_OVERLAP, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  map.mask = NULL, map.inferred = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  map.inferred = 0, map.pixels = NULL;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  map.pixels = pixels, o.max_step = 256;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  o.max_step = 3, o.reserved = 1;
  TEST_ASSERT_EQUAL_INT(TV_ERR_ARGUMENT, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  tv_room_infer_options_init(&o);
  plane.sigma = NAN;
  TEST_ASSERT_EQUAL_INT(TV_ERR_NOT_FINITE, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  plane.sigma = 0.001;
  TEST_ASSERT_EQUAL_INT(-7, num);
  TEST_ASSERT_EQUAL_INT(TV_OK, INFER(room, &map, &plane, 1, aligned, bytes, out, &num));
  TEST_ASSERT_TRUE(num > 2000);
  for (i = 0; i < PIXELS; ++i) {
    const double x = (i % WIDTH - camera.cx) / 80, y = (i / WIDTH - camera.cy) / 80;
    TEST_ASSERT_TRUE(out[i] == 0 || distance[i] == 0);
    if (out[i] != 0) {
      TEST_ASSERT_FLOAT_WITHIN(0.005f, (float)(1.5 * sqrt(x * x + y * y + 1)), out[i]);
    }
  }
  TEST_ASSERT_EQUAL_INT(TV_OK, INFER(room, &map, NULL, 0, aligned, bytes, out, &num));
  TEST_ASSERT_EQUAL_INT(0, num);
  num = -7;
  TEST_ASSERT_EQUAL_INT(TV_OK,
                        tv_room_infer(room, aligned, bytes, &map, NULL, out, out_sigma, &num));
  TEST_ASSERT_EQUAL_INT(0, num);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_defaults_are_those_of_the_header);
  RUN_TEST(test_init_refuses);
  RUN_TEST(test_a_room_stays_within_its_memory);
  RUN_TEST(test_a_map_is_refused);
  RUN_TEST(test_what_is_not_in_the_room_is_not_removed);
  RUN_TEST(test_a_room_holds_its_limit_of_maps);
  RUN_TEST(test_prune_refuses);
  RUN_TEST(test_a_room_is_coarsened_sixteen_times);
  RUN_TEST(test_a_state_is_written_as_far_as_its_size);
  RUN_TEST(test_a_mesh_is_refused);
  RUN_TEST(test_the_planes_of_a_mesh_are_checked);
  RUN_TEST(test_shorter_mesh_options_mean_no_planes);
  RUN_TEST(test_a_mesh_says_how_much_room_it_needs);
  RUN_TEST(test_a_mesh_of_few_views_is_left_out_when_wanted);
  RUN_TEST(test_planes_are_refused_and_found);
  RUN_TEST(test_inference_is_refused_and_fills_the_wall);
  return UNITY_END();
}
