/* Orientation and SIFT histograms of a sampled patch, and the 128 bytes.
   D. G. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004, sections 5, 6.
   All sums are of integers, so their order does not matter; the float steps are single IEEE
   operations on one element each. */

/* atan(a) / (2 pi) * 65536 for a in [0, 1]: odd minimax polynomial, error below 0.13 units. */
#define ATAN_C1 10428.9841f
#define ATAN_C3 -3445.2039f
#define ATAN_C5 1879.1296f
#define ATAN_C7 -888.2130f
#define ATAN_C9 217.4224f

/* Direction of (dx, dy) in 1/65536 turn, clockwise as seen (y down), error below 2 units. */
static inline int32_t gradient_direction(int32_t dx, int32_t dy) {
  const int32_t ax = dx < 0 ? -dx : dx, ay = dy < 0 ? -dy : dy;
  const int32_t small = ax < ay ? ax : ay, large = ax < ay ? ay : ax;
  const float a = (float)small / (float)(large + (large == 0));
  const float s = a * a;
  const float octant = a * (ATAN_C1 + s * (ATAN_C3 + s * (ATAN_C5 + s * (ATAN_C7 + s * ATAN_C9))));
  int32_t turn = (int32_t)(octant + 0.5f);
  turn = ay > ax ? 16384 - turn : turn;
  turn = dx < 0 ? 32768 - turn : turn;
  turn = dy < 0 ? 65536 - turn : turn;
  return turn & 65535;
}

static inline int32_t gradient_magnitude(int32_t dx, int32_t dy) {
  return (int32_t)(sqrtf((float)(dx * dx + dy * dy)) + 0.5f);
}

enum { ORIENT_INNER = TVK_ORIENT_SIDE - 2 };

/* 256 exp(-(x^2 + y^2) / (2 * 2^2)) for x^2 + y^2 <= 6^2, else 0. */
static const int16_t orientation_weights[ORIENT_INNER][ORIENT_INNER] = {
  {0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0},
  {0, 0, 0, 4, 7, 10, 11, 10, 7, 4, 0, 0, 0},
  {0, 0, 5, 11, 21, 31, 35, 31, 21, 11, 5, 0, 0},
  {0, 4, 11, 27, 50, 73, 83, 73, 50, 27, 11, 4, 0},
  {0, 7, 21, 50, 94, 137, 155, 137, 94, 50, 21, 7, 0},
  {0, 10, 31, 73, 137, 199, 226, 199, 137, 73, 31, 10, 0},
  {3, 11, 35, 83, 155, 226, 256, 226, 155, 83, 35, 11, 3},
  {0, 10, 31, 73, 137, 199, 226, 199, 137, 73, 31, 10, 0},
  {0, 7, 21, 50, 94, 137, 155, 137, 94, 50, 21, 7, 0},
  {0, 4, 11, 27, 50, 73, 83, 73, 50, 27, 11, 4, 0},
  {0, 0, 5, 11, 21, 31, 35, 31, 21, 11, 5, 0, 0},
  {0, 0, 0, 4, 7, 10, 11, 10, 7, 4, 0, 0, 0},
  {0, 0, 0, 0, 0, 0, 3, 0, 0, 0, 0, 0, 0},
};

static void orientation_histogram(const int16_t *patch, int32_t *histogram) {
  int32_t x, y, magnitude[ORIENT_INNER], bin[ORIENT_INNER];
  memset(histogram, 0, TVK_ORIENT_BINS * sizeof histogram[0]);
  for (y = 0; y < ORIENT_INNER; ++y) {
    const int16_t *row = patch + (y + 1) * TVK_ORIENT_SIDE + 1;
    for (x = 0; x < ORIENT_INNER; ++x) {
      const int32_t dx = row[x + 1] - row[x - 1];
      const int32_t dy = row[x + TVK_ORIENT_SIDE] - row[x - TVK_ORIENT_SIDE];
      magnitude[x] = gradient_magnitude(dx, dy) * orientation_weights[y][x];
      bin[x] = (gradient_direction(dx, dy) * TVK_ORIENT_BINS + 32768) >> 16;
    }
    for (x = 0; x < ORIENT_INNER; ++x) {
      histogram[bin[x] == TVK_ORIENT_BINS ? 0 : bin[x]] += magnitude[x];
    }
  }
}

enum { PATCH_INNER = TVK_PATCH_SIDE - 2 };

/* Share of sample u = 0..19 in each of the four cells along an axis: with p = (u - 9.5) / 4 cells from
   the middle, 256 exp(-p^2 / 8) max(0, 1 - |p + 1.5 - cell|). */
static const int16_t cell_weights[PATCH_INNER][4] = {
  {16, 0, 0, 0},
  {55, 0, 0, 0},
  {103, 0, 0, 0},
  {161, 0, 0, 0},
  {177, 25, 0, 0},
  {137, 82, 0, 0},
  {87, 145, 0, 0},
  {30, 213, 0, 0},
  {0, 220, 31, 0},
  {0, 160, 96, 0},
  {0, 96, 160, 0},
  {0, 31, 220, 0},
  {0, 0, 213, 30},
  {0, 0, 145, 87},
  {0, 0, 82, 137},
  {0, 0, 25, 177},
  {0, 0, 0, 161},
  {0, 0, 0, 103},
  {0, 0, 0, 55},
  {0, 0, 0, 16},
};

/* first_cell[u] and the next one are the only cells with a share. */
static const int8_t first_cell[PATCH_INNER] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1,
                                               1, 1, 2, 2, 2, 2, 2, 2, 2, 2};

/* Adds one row of samples to the 4 x 8 sums of its cells along x. UBC order turns counter-clockwise. */
static void gradient_row(const int16_t *row, int32_t *cells) {
  int32_t x, magnitude[PATCH_INNER], direction[PATCH_INNER];
  for (x = 0; x < PATCH_INNER; ++x) {
    const int32_t dx = row[x + 1] - row[x - 1];
    const int32_t dy = row[x - TVK_PATCH_SIDE] - row[x + TVK_PATCH_SIDE];
    magnitude[x] = gradient_magnitude(dx, dy);
    direction[x] = gradient_direction(dx, dy);
  }
  for (x = 0; x < PATCH_INNER; ++x) {
    const int32_t bin = direction[x] >> 13, share = (direction[x] >> 5) & 255;
    const int32_t upper = (magnitude[x] * share + 128) >> 8, lower = magnitude[x] - upper;
    const int32_t next = (bin + 1) & 7, cell = first_cell[x];
    const int32_t w0 = cell_weights[x][cell], w1 = cell_weights[x][cell + 1];
    int32_t *near = cells + cell * 8, *far = near + 8;
    near[bin] += w0 * lower;
    near[next] += w0 * upper;
    far[bin] += w1 * lower;
    far[next] += w1 * upper;
  }
}

static void gradient_histogram(const int16_t *patch, int32_t *histogram) {
  int32_t x, y, k;
  memset(histogram, 0, TVK_DESCRIPTOR_SIZE * sizeof histogram[0]);
  for (y = 0; y < PATCH_INNER; ++y) {
    int32_t cells[4 * 8];
    memset(cells, 0, sizeof cells);
    gradient_row(patch + (y + 1) * TVK_PATCH_SIDE + 1, cells);
    for (k = 0; k < 2; ++k) {
      const int32_t cell_y = first_cell[y] + k, w = cell_weights[y][cell_y];
      int32_t *out = histogram + cell_y * 32;
      for (x = 0; x < 32; ++x) out[x] += w * ((cells[x] + 128) >> 8);
    }
  }
}

static inline uint8_t descriptor_byte(float value) {
  const int32_t rounded = (int32_t)(value + 0.5f);
  return (uint8_t)(rounded < 255 ? rounded : 255);
}

static float descriptor_norm(const int32_t *values) {
  int64_t sum = 0;
  int32_t k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += (int64_t)values[k] * values[k];
  return sqrtf((float)sum);
}

static void quantize_descriptor(const int32_t *histogram, int32_t root, uint8_t *descriptor) {
  int32_t clipped[TVK_DESCRIPTOR_SIZE];
  const int32_t limit = (int32_t)(0.2f * descriptor_norm(histogram));
  int64_t l1 = 0;
  float scale;
  int32_t k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
    clipped[k] = histogram[k] < limit ? histogram[k] : limit;
    l1 += clipped[k];
  }
  if (l1 == 0) {
    memset(descriptor, 0, TVK_DESCRIPTOR_SIZE);
    return;
  }
  if (root) {
    scale = 1.0f / (float)l1;
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
      descriptor[k] = descriptor_byte(512.0f * sqrtf((float)clipped[k] * scale));
    }
  } else {
    scale = 512.0f / descriptor_norm(clipped);
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
      descriptor[k] = descriptor_byte((float)clipped[k] * scale);
    }
  }
}
