/* scene FILE   writes a pair of images in the format that digest.c reads. The pair is computed with
   integers only and depends on nothing outside this file, so it has the same bytes on every
   machine. golden/stages runs every stage of the library on it.

   Square faces with random grey patches stand at different distances before a wall; the camera
   moves to the right, up and forward without turning. A ray takes the grey of the patch that it
   meets first; a pixel is the average of 3 x 3 rays. */
#include <stdint.h>
#include <stdio.h>

/* WIDTH, HEIGHT and FOCAL are pixels; RAYS is the number of rays of a pixel along each axis */
enum { WIDTH = 320, HEIGHT = 240, FOCAL = 300, RAYS = 3 };
enum { METRE = 1 << 12, PATCH = METRE / 12, NUM_FACES = 27 };

typedef struct face {
  int64_t distance, left, top, right, bottom;
  uint32_t seed;
} face;

static uint32_t next_random(uint64_t *state) {
  *state = *state * 6364136223846793005u + 1442695040888963407u;
  return (uint32_t)(*state >> 33);
}

/* Ordered by distance, the nearest first; the last one is the wall. */
static void make_faces(face *faces) {
  uint64_t state = 14;
  int k;
  for (k = 0; k < NUM_FACES; ++k) {
    const int64_t distance = k == NUM_FACES - 1 ? 7 * METRE : 2 * METRE + k * METRE / 6;
    const int64_t x = ((int64_t)(next_random(&state) % 1000) - 500) * distance / 1000;
    const int64_t y = ((int64_t)(next_random(&state) % 1000) - 500) * distance * 3 / 4000;
    const int64_t side = distance / 14 + next_random(&state) % (uint32_t)(distance / 14);
    const int64_t half = k == NUM_FACES - 1 ? 2 * distance : side;
    faces[k].distance = distance;
    faces[k].left = x - half;
    faces[k].top = y - half;
    faces[k].right = x + half;
    faces[k].bottom = y + half;
    faces[k].seed = next_random(&state);
  }
}

static uint32_t grey(const face *f, int64_t x, int64_t y) {
  uint32_t value = f->seed + (uint32_t)((x - f->left) / PATCH) * 0x9E3779B1u +
                   (uint32_t)((y - f->top) / PATCH) * 0x85EBCA77u;
  value = (value ^ value >> 15) * 0x7FEB352Du;
  value = (value ^ value >> 15) * 0x846CA68Bu;
  return 20 + (value >> 16) % 216;
}

/* The grey level that a ray meets. The camera is at `eye` and looks along z; a ray's slope is a
   whole number over `scale`. */
static uint32_t ray(const face *faces, const int64_t eye[3], int64_t slope_x, int64_t slope_y) {
  const int64_t scale = 2 * RAYS * FOCAL;
  int k;
  for (k = 0;; ++k) {
    const face *const f = &faces[k];
    const int64_t depth = f->distance - eye[2];
    const int64_t x = eye[0] + depth * slope_x / scale, y = eye[1] + depth * slope_y / scale;
    if (k == NUM_FACES - 1 || (f->left <= x && x < f->right && f->top <= y && y < f->bottom)) {
      return grey(f, x, y);
    }
  }
}

static void write_image(FILE *file, const face *faces, const int64_t eye[3]) {
  int row, column, u, v;
  for (row = 0; row < HEIGHT; ++row) {
    for (column = 0; column < WIDTH; ++column) {
      uint32_t sum = RAYS * RAYS / 2;
      for (v = 0; v < RAYS; ++v) {
        for (u = 0; u < RAYS; ++u) {
          sum += ray(faces, eye, 2 * RAYS * column - RAYS * WIDTH + 2 * u + 1,
                     2 * RAYS * row - RAYS * HEIGHT + 2 * v + 1);
        }
      }
      fputc((int)(sum / (RAYS * RAYS)), file);
    }
  }
}

int main(int argc, char **argv) {
  static const int64_t eyes[2][3] = {{0, 0, 0}, {METRE / 3, -METRE / 25, METRE / 8}};
  face faces[NUM_FACES];
  FILE *const file = argc == 2 ? fopen(argv[1], "wb") : NULL;
  int v;
  if (file == NULL) {
    fprintf(stderr, "usage: scene FILE\n");
    return 2;
  }
  make_faces(faces);
  fprintf(file, "%d %d\n", WIDTH, HEIGHT);
  for (v = 0; v < 2; ++v) {
    fprintf(file, "%d %d %d.5 %d.5 0 0 0 0 0\n", FOCAL, FOCAL, WIDTH / 2 - 1, HEIGHT / 2 - 1);
  }
  for (v = 0; v < 2; ++v) write_image(file, faces, eyes[v]);
  return fclose(file) == 0 ? 0 : 1;
}
