/* A room in static memory: the depth maps of five views, each from three pictures, are fused, and
   the surface is written as OBJ. The program draws its own pictures: a wall 2 m away with a pillar
   half a metre before it.
   usage: 17_room room.obj */
#include <math.h>
#include <stdio.h>
#include <string.h>
#include <twoview/twoview.h>

enum { WIDTH = 320, HEIGHT = 240, VIEWS = 5, MAP = 160 * 120, MAX_VERTICES = 20000 };

static _Alignas(TV_CONTEXT_ALIGNMENT) unsigned char sweep[12 << 20], memory[2 << 20];
static uint8_t pixels[VIEWS][WIDTH * HEIGHT], grey[MAP], witnesses[MAP];
static float distance[MAP], sigma[MAP];
static tv_room_vertex vertex[MAX_VERTICES];
static tv_room_triangle triangle[2 * MAX_VERTICES];

/* Random grey in tiles. */
static uint8_t grey_at(double x, double y) {
  unsigned h = (unsigned)(int)floor(x) * 2654435761u ^ (unsigned)(int)floor(y) * 2246822519u;
  h = (h ^ h >> 15) * 3266489917u;
  return (uint8_t)(h >> 24);
}

/* What the camera sees that stands `right` metres to the right of the middle. */
static void paint(uint8_t *picture, const tv_camera *camera, double right) {
  int x, y;
  for (y = 0; y < HEIGHT; ++y) {
    for (x = 0; x < WIDTH; ++x) {
      const double u = (x - camera->cx) / camera->fx, v = (y - camera->cy) / camera->fy;
      const double depth = fabs(right + 1.5 * u) < 0.25 ? 1.5 : 2;
      picture[y * WIDTH + x] = grey_at(30 * (right + depth * u), 30 * depth * v);
    }
  }
}

int main(int argc, char **argv) {
  const tv_camera camera = {TV_CAMERA_PINHOLE, WIDTH, HEIGHT, 0, 280, 280, 159.5, 119.5, {0}};
  const tv_depth_arrays arrays = {distance, sigma, witnesses, grey};
  tv_depth_view view[VIEWS] = {{{0}, 0, {1, 0, 0, 0, 1, 0, 0, 0, 1}, {0}}}, seen[3];
  tv_depth_options options;
  tv_camera map_camera;
  tv_room *room;
  tv_status status;
  int32_t num_vertices = 0, num_triangles = 0, k;
  FILE *file;
  if (argc != 2) return fprintf(stderr, "usage: 17_room room.obj\n"), 2;
  for (k = 0; k < VIEWS; ++k) {
    const tv_image image = {pixels[k], WIDTH, HEIGHT, WIDTH};
    view[k] = view[0]; /* the same rotation: none */
    view[k].image = image;
    view[k].camera = &camera;
    view[k].world_from_cam_t[0] = 0.15 * (k - VIEWS / 2);
    paint(pixels[k], &camera, view[k].world_from_cam_t[0]);
  }
  tv_depth_options_init(&options);
  options.max_pixels = MAP; /* tv_depth_size says how much memory that needs */
  options.max_views = 3;
  options.near_depth = 1;
  options.far_depth = 4;
  status = tv_depth_map_camera(&camera, &options, &map_camera);
  if (status == TV_OK) status = tv_room_init(&room, NULL, memory, sizeof memory);
  for (k = 0; k < VIEWS && status == TV_OK; ++k) {
    tv_depth_map map;
    seen[0] = view[k]; /* with its neighbours, or the two nearest at an end */
    seen[1] = view[k > 0 ? k - 1 : 2];
    seen[2] = view[k < VIEWS - 1 ? k + 1 : VIEWS - 3];
    status = tv_sweep_depth(sweep, sizeof sweep, seen, 3, &options, &arrays);
    if (status != TV_OK) break;
    tv_depth_map_init(&map);
    map.width = map.stride = map_camera.width;
    map.height = map_camera.height;
    map.camera = &map_camera;
    memcpy(map.world_from_cam_R, seen[0].world_from_cam_R, sizeof map.world_from_cam_R);
    memcpy(map.world_from_cam_t, seen[0].world_from_cam_t, sizeof map.world_from_cam_t);
    map.distance = distance;
    map.sigma = sigma;
    map.witnesses = witnesses;
    do { /* a room that is full goes on with coarser voxels, and loses nothing */
      status = tv_room_add(room, &map);
    } while (status == TV_ERR_CAPACITY && tv_room_coarsen(room) == TV_OK);
  }
  if (status == TV_OK)
    status = tv_room_mesh(room, NULL, vertex, MAX_VERTICES, &num_vertices, triangle,
                          2 * MAX_VERTICES, &num_triangles);
  if (status != TV_OK) return fprintf(stderr, "%s\n", tv_status_string(status)), 2;
  file = fopen(argv[1], "w");
  if (file == NULL) return fprintf(stderr, "cannot write %s\n", argv[1]), 2;
  for (k = 0; k < num_vertices; ++k)
    fprintf(file, "v %.4f %.4f %.4f\n", (double)vertex[k].position[0],
            (double)vertex[k].position[1], (double)vertex[k].position[2]);
  for (k = 0; k < num_triangles; ++k) /* OBJ counts from 1 */
    fprintf(file, "f %d %d %d\n", triangle[k].idx_vertex[0] + 1, triangle[k].idx_vertex[1] + 1,
            triangle[k].idx_vertex[2] + 1);
  if (fclose(file) != 0) return fprintf(stderr, "cannot write %s\n", argv[1]), 2;
  printf("%d vertices and %d triangles, none of the heap\n", num_vertices, num_triangles);
  return 0;
}
