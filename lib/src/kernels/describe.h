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

/* Each gradient is shared between the two directions, 10 degrees apart, that it lies between. */
static void orientation_histogram(const int16_t *patch, int32_t *histogram) {
  int32_t x, y, magnitude[ORIENT_INNER], direction[ORIENT_INNER];
  memset(histogram, 0, TVK_ORIENT_BINS * sizeof histogram[0]);
  for (y = 0; y < ORIENT_INNER; ++y) {
    const int16_t *row = patch + (y + 1) * TVK_ORIENT_SIDE + 1;
    for (x = 0; x < ORIENT_INNER; ++x) {
      const int32_t dx = row[x + 1] - row[x - 1];
      const int32_t dy = row[x + TVK_ORIENT_SIDE] - row[x - TVK_ORIENT_SIDE];
      magnitude[x] = (gradient_magnitude(dx, dy) * orientation_weights[y][x] + 128) >> 8;
      direction[x] = (gradient_direction(dx, dy) * TVK_ORIENT_BINS) >> 8; /* 1/256 of a bin */
    }
    for (x = 0; x < ORIENT_INNER; ++x) {
      const int32_t bin = direction[x] >> 8, share = direction[x] & 255;
      const int32_t next = bin + 1 == TVK_ORIENT_BINS ? 0 : bin + 1;
      histogram[bin] += magnitude[x] * (256 - share);
      histogram[next] += magnitude[x] * share;
    }
  }
}

enum { PATCH_INNER = TVK_PATCH_SIDE - 2, CELL_SAMPLES = 8 };

/* Along an axis cell c = 0..3 is fed by samples u = 4 c + i, i = 0..7 of the twenty, with the share
   256 exp(-p^2 / 8) max(0, 1 - |p + 1.5 - c|), where p = (u - 9.5) / 4 cells from the middle. */
static const int16_t cell_weights[4][CELL_SAMPLES] = {
    {16, 55, 103, 161, 177, 137, 87, 30},
    {25, 82, 145, 213, 220, 160, 96, 31},
    {31, 96, 160, 220, 213, 145, 82, 25},
    {30, 87, 137, 177, 161, 103, 55, 16},
};

/* The gradients lie flat, TVK_PATCH_SIDE to a row, so that one long loop runs over all of them; the
   two at the end of each row straddle its border and are never read. */
enum { PATCH_FLAT = PATCH_INNER * TVK_PATCH_SIDE };

static void patch_gradients(const int16_t *patch, int16_t *magnitude, int16_t *direction) {
  int32_t k;
  for (k = 0; k < PATCH_FLAT - 2; ++k) {
    const int16_t *at = patch + TVK_PATCH_SIDE + 1 + k;
    const int32_t dx = at[1] - at[-1];
    const int32_t dy = at[-TVK_PATCH_SIDE] - at[TVK_PATCH_SIDE]; /* UBC order: counter-clockwise */
    magnitude[k] = (int16_t)gradient_magnitude(dx, dy);
    direction[k] = (int16_t)(gradient_direction(dx, dy) >> 5);
  }
}

/* What each gradient gives to direction `bin` of eight: a tent, 256 units wide to each side. */
static void share_of_direction(const int16_t *magnitude, const int16_t *direction, int32_t bin,
                               int16_t *share) {
  int32_t k;
  for (k = 0; k < PATCH_FLAT - 2; ++k) {
    const int16_t turned = (int16_t)(((direction[k] - 256 * bin + 1024) & 2047) - 1024);
    const int16_t away = (int16_t)(turned < 0 ? -turned : turned);
    const int16_t tent = (int16_t)(away < 256 ? 256 - away : 0);
    share[k] = (int16_t)((magnitude[k] * (tent < 255 ? tent : 255)) >> 8);
  }
}

/* Sums over the rows of each cell; columns[x][cell_y * 8 + bin]. */
static void pool_rows(const int16_t *share, int32_t bin, int16_t columns[PATCH_INNER][32]) {
  int32_t cell, i, x;
  for (cell = 0; cell < 4; ++cell) {
    const int16_t *rows = share + 4 * cell * TVK_PATCH_SIDE;
    int32_t sums[PATCH_INNER];
    for (x = 0; x < PATCH_INNER; ++x) sums[x] = 128;
    for (i = 0; i < CELL_SAMPLES; ++i) {
      for (x = 0; x < PATCH_INNER; ++x) {
        sums[x] += cell_weights[cell][i] * rows[i * TVK_PATCH_SIDE + x];
      }
    }
    for (x = 0; x < PATCH_INNER; ++x) columns[x][cell * 8 + bin] = (int16_t)(sums[x] >> 8);
  }
}

static void gradient_histogram(const int16_t *patch, int32_t *histogram) {
  int16_t magnitude[PATCH_FLAT], direction[PATCH_FLAT], share[PATCH_FLAT];
  int16_t columns[PATCH_INNER][32];
  int32_t bin, cell, i, k;
  patch_gradients(patch, magnitude, direction);
  for (bin = 0; bin < 8; ++bin) {
    share_of_direction(magnitude, direction, bin, share);
    pool_rows(share, bin, columns);
  }
  for (cell = 0; cell < 4; ++cell) {
    int32_t sums[32] = {0};
    for (i = 0; i < CELL_SAMPLES; ++i) {
      for (k = 0; k < 32; ++k) sums[k] += cell_weights[cell][i] * columns[4 * cell + i][k];
    }
    for (k = 0; k < 32; ++k) histogram[((k / 8) * 4 + cell) * 8 + k % 8] = sums[k];
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
