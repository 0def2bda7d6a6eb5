/* The kernels that describe a sampled patch: orientation histogram, SIFT histogram, and its
   normalisation to 128 bytes. D. G. Lowe, "Distinctive image features from scale-invariant
   keypoints", IJCV 2004, sections 5 and 6. No arctangent is needed: a gradient between two
   directions of a histogram is the sum of a vector along each direction, and the lengths of these
   two vectors are its shares. Arithmetic is in integers, of 16 bits where these suffice
   (docs/decisions/0003-patch-sift.md), except for the square roots and one division of the
   normalisation, which are single IEEE operations. */

#include "kernels/words.h"

/* The gradient as two differences along the diagonals of four neighbouring samples: u points to the
   lower right, v to the upper right. Sums and differences of u and v fit 16 bits. */
static inline words gradient_u(const int16_t *at) {
  return words_load(at + TVK_PATCH_SIDE + 1) - words_load(at);
}
static inline words gradient_v(const int16_t *at) {
  return words_load(at + 1) - words_load(at + TVK_PATCH_SIDE);
}

/* The gradients of the orientation: those of a grid of 11 x 11 that are within 6 samples of its
   centre, row by row, 109 in all. Three more have weight 0: two at the start of the last row, which
   is read from its first column on because nothing follows the patch, and one that fills the last
   vector. */
enum { ORIENT_ROWS = TVK_ORIENT_SIDE - 1, ORIENT_COUNT = 112 };

/* The first column of each row, and how many columns count. */
static const int8_t orientation_columns[ORIENT_ROWS][2] = {
    {2, 7}, {1, 9}, {0, 11}, {0, 11}, {0, 11}, {0, 11}, {0, 11}, {0, 11}, {0, 11}, {1, 9}, {0, 9}};

/* The Gaussian weights 65536 * 0.11 exp(-(x^2 + y^2) / (2 * 2^2)), a row in each line. The factor
   0.11 keeps every bin of a histogram below 65536. */
static const uint16_t orientation_weights[ORIENT_COUNT] = {
    103,  192,  280,  317,  280,  192,  103,                         /* */
    132,  317,  592,  861,  976,  861,  592,  317,  132,             /* */
    103,  317,  760,  1420, 2065, 2340, 2065, 1420, 760,  317,  103, /* */
    192,  592,  1420, 2652, 3859, 4372, 3859, 2652, 1420, 592,  192,  280,  861,  2065,
    3859, 5614, 6362, 5614, 3859, 2065, 861,  280,  317,  976,  2340, 4372, 6362, 7209,
    6362, 4372, 2340, 976,  317,  280,  861,  2065, 3859, 5614, 6362, 5614, 3859, 2065,
    861,  280,  192,  592,  1420, 2652, 3859, 4372, 3859, 2652, 1420, 592,  192,  103,
    317,  760,  1420, 2065, 2340, 2065, 1420, 760,  317,  103, /* */
    132,  317,  592,  861,  976,  861,  592,  317,  132,       /* */
    0,    0,    103,  192,  280,  317,  280,  192,  103,       /* */
};

typedef struct direction_shares {
  words bin;       /* number of the direction's bin, 0..31, clockwise in the image from x */
  words low, high; /* the weighted shares of `bin` and of the next bin */
} direction_shares;

/* The two bins between which each gradient (u, v) lies, and its shares in them. Reflections at 0,
   90, 45, 22.5 and 11.25 degrees bring the direction between bin 0 and bin 1. Undone on the number
   of the interval between two bins, each reflection turns over that number's last bits: which
   reflections there were is the number in Gray code. */
static direction_shares share_directions(words u, words v, words weights) {
  const words au = words_max(u, -u), av = words_max(v, -v);
  const words left = u<words_of(0), up = v> words_of(0), steep = av > au;
  words big = words_max(au, av), small = words_min(au, av), interval, is_odd, a, b, swapped;
  const words root_half = words_of((int16_t)46341);
  /* The cosine and sine of 22.5 degrees, times 65536. */
  const words cosine = words_of((int16_t)60547), sine = words_of(25080);
  const words big45 = words_scale(big + small, root_half);
  const words small45 = words_scale(big - small, root_half);
  const words over22 = small45 < small;
  words big22, small22, over11;
  direction_shares shares;
  big = words_max(big, big45);
  small = words_min(small, small45);
  big22 = words_scale(big, cosine) + words_scale(small, sine);
  small22 = words_positive(words_scale(big, sine) - words_scale(small, cosine));
  over11 = small22 < small;
  big = words_max(big, big22);
  small = words_min(small, small22);
  interval = (up & words_of(31)) ^ (left & words_of(15)) ^ (steep & words_of(7)) ^
             (over22 & words_of(3)) ^ (over11 & words_of(1));
  is_odd = over11 ^ over22 ^ steep ^ left ^ up; /* the reflected gradient's bin 0 is the next one */
  /* The shares are big - small cot(11.25 deg) and small / sin(11.25 deg). */
  b = words_of(5) * small;
  a = words_positive(big - b - words_scale(small, words_of(1796)));
  b = b + words_scale(small, words_of(8258));
  a = words_scale(a, weights);
  b = words_scale(b, weights);
  /* So far bins are counted from the direction u, which is 45 degrees, or four bins, from x. */
  shares.bin = (interval + words_of(4)) & words_of(TVK_ORIENT_BINS - 1);
  swapped = (a ^ b) & is_odd;
  shares.low = a ^ swapped;
  shares.high = b ^ swapped;
  return shares;
}

#if defined(TVK_AVX2) || defined(TVK_AVX512)
/* The values before and after each of those around the circle. */
static inline void circle_neighbours(const __m256i circle[4], __m256i before[4], __m256i after[4]) {
  int32_t k;
  for (k = 0; k < 4; ++k) {
    const __m256i last = circle[(k + 3) & 3], first = circle[(k + 1) & 3];
    before[k] = _mm256_alignr_epi8(circle[k], _mm256_permute2x128_si256(last, circle[k], 0x21), 12);
    after[k] = _mm256_alignr_epi8(_mm256_permute2x128_si256(circle[k], first, 0x21), circle[k], 4);
  }
}
#endif

/* The histogram smoothed by (1 4 6 4 1) around the circle, not divided by 16. sums[k] is the sum of
   the shares of bin k in itself (low 16 bits) and in the next one (high 16 bits). smooth[1 + k] is
   bin k, repeated around the circle. */
static void smooth_circle(const uint32_t sums[TVK_ORIENT_BINS], int32_t *smooth) {
#if defined(TVK_AVX2) || defined(TVK_AVX512)
  __m256i circle[4], before[4], after[4];
  int32_t k, pass;
  for (k = 0; k < 4; ++k) circle[k] = _mm256_loadu_si256((const __m256i *)(sums + 8 * k));
  circle_neighbours(circle, before, after);
  for (k = 0; k < 4; ++k) {
    circle[k] = _mm256_add_epi32(_mm256_and_si256(circle[k], _mm256_set1_epi32(65535)),
                                 _mm256_srli_epi32(before[k], 16));
  }
  for (pass = 0; pass < 2; ++pass) { /* (1 2 1) twice */
    circle_neighbours(circle, before, after);
    for (k = 0; k < 4; ++k) {
      circle[k] = _mm256_add_epi32(_mm256_add_epi32(before[k], after[k]),
                                   _mm256_add_epi32(circle[k], circle[k]));
    }
  }
  for (k = 0; k < 4; ++k) _mm256_storeu_si256((__m256i *)(smooth + 1 + 8 * k), circle[k]);
#else
  int32_t around[TVK_ORIENT_BINS + 4], k; /* around[2 + k] is bin k */
  TVK_ROLLED
  for (k = 0; k < TVK_ORIENT_BINS; ++k) {
    around[2 + k] = (int32_t)((sums[k] & 65535) + (sums[(k - 1) & (TVK_ORIENT_BINS - 1)] >> 16));
  }
  memcpy(around, around + TVK_ORIENT_BINS, 2 * sizeof around[0]);
  memcpy(around + 2 + TVK_ORIENT_BINS, around + 2, 2 * sizeof around[0]);
  TVK_ROLLED
  for (k = 0; k < TVK_ORIENT_BINS; ++k) {
    const int32_t *const a = around + k;
    smooth[1 + k] = a[0] + a[4] + 4 * (a[1] + a[3]) + 6 * a[2];
  }
#endif
  smooth[0] = smooth[TVK_ORIENT_BINS];
  smooth[TVK_ORIENT_BINS + 1] = smooth[1];
}

/* The two highest bins as orientation_histogram returns them. A bin's key orders by value, which is
   below 2^22, then by falling number; a bin above its neighbours has a key above 0. */
static void find_peaks(const int32_t *smooth, int32_t peaks[2]) {
  int32_t keys[TVK_ORIENT_BINS], best = 0, second = 0, k;
  TVK_ROLLED
  for (k = 0; k < TVK_ORIENT_BINS; ++k) {
    keys[k] = smooth[1 + k] * TVK_ORIENT_BINS + TVK_ORIENT_BINS - 1 - k;
    best = keys[k] > best ? keys[k] : best;
  }
  TVK_ROLLED
  for (k = 0; k < TVK_ORIENT_BINS; ++k) {
    const int32_t above_left = smooth[1 + k] > smooth[k] ? keys[k] : 0;
    const int32_t above_both = smooth[1 + k] > smooth[2 + k] ? above_left : 0;
    const int32_t other = keys[k] < best ? above_both : 0;
    second = other > second ? other : second;
  }
  peaks[0] = TVK_ORIENT_BINS - 1 - (best & (TVK_ORIENT_BINS - 1));
  peaks[1] = second == 0 ? -1 : TVK_ORIENT_BINS - 1 - (second & (TVK_ORIENT_BINS - 1));
}

static void orientation_histogram(const int16_t *patch, int32_t *smooth, int32_t peaks[2]) {
  /* A single addition adds both shares of a gradient, 16 bits each. Neighbouring samples add to
     different tables, so that no addition waits for the one before. */
  uint32_t tables[4][TVK_ORIENT_BINS] TVK_ALIGNED;
  /* What a row writes after its last gradient, the next row writes over. */
  int16_t u[ORIENT_COUNT + TVK_PATCH_SIDE] TVK_ALIGNED,
      v[ORIENT_COUNT + TVK_PATCH_SIDE] TVK_ALIGNED;
  uint16_t bin[ORIENT_COUNT] TVK_ALIGNED;
  uint32_t both[ORIENT_COUNT] TVK_ALIGNED, sums[TVK_ORIENT_BINS];
  int32_t x, y, count = 0;
  memset(tables, 0, sizeof tables);
  for (y = 0; y < ORIENT_ROWS; ++y) {
    const int16_t *at = patch + y * TVK_PATCH_SIDE + orientation_columns[y][0];
    for (x = 0; x < TVK_PATCH_SIDE; x += TVK_WORDS) {
      words_store(u + count + x, gradient_u(at + x));
      words_store(v + count + x, gradient_v(at + x));
    }
    count += orientation_columns[y][1];
  }
  for (x = 0; x < ORIENT_COUNT; x += TVK_WORDS) {
    const direction_shares shares =
        share_directions(words_load(u + x), words_load(v + x), words_load(orientation_weights + x));
    words_store(bin + x, shares.bin);
    words_zip(shares.low, shares.high, both + x);
  }
  for (x = 0; x < ORIENT_COUNT; x += 4) {
    for (y = 0; y < 4; ++y) tables[y][bin[x + y]] += both[x + y];
  }
  TVK_ROLLED
  for (x = 0; x < TVK_ORIENT_BINS; ++x) {
    sums[x] = tables[0][x] + tables[1][x] + tables[2][x] + tables[3][x];
  }
  smooth_circle(sums, smooth);
  find_peaks(smooth, peaks);
}

enum { PATCH_GRADIENTS = TVK_PATCH_SIDE - 1, CELL_SAMPLES = 6 };

/* The weights of the 4x4 cells, a product of one along y and one along x. Along an axis, cell c =
   0..3 gets the gradients k = 3 c + i, i = 0..5, of the fifteen, with weight exp(-p^2 / 8) max(0, 1
   - |p + 1.5 - c|), where p = 0.28 (k - 7) is the distance from the centre in cells. row_weights
   are these times 0.56 * 65536, and for the odd directions also times sqrt(1/2), so that sums fit
   16 bits; column_weights are these times 16384. */
static const uint16_t row_weights[2][4][CELL_SAMPLES] = {
    {
        {12261, 21148, 25853, 19452, 11425, 2117},
        {11922, 22177, 33172, 28347, 18350, 7995},
        {7995, 18350, 28347, 33172, 22177, 11922},
        {2117, 11425, 19452, 25853, 21148, 12261},
    },
    {
        {8670, 14954, 18281, 13755, 8078, 1497},
        {8430, 15682, 23456, 20044, 12975, 5654},
        {5654, 12975, 20044, 23456, 15682, 8430},
        {1497, 8078, 13755, 18281, 14954, 8670},
    }};
static const int16_t column_weights[4][8] = {
    {5474, 9441, 11541, 8684, 5100, 945, 0, 0},
    {5322, 9901, 14809, 12655, 8192, 3569, 0, 0},
    {3569, 8192, 12655, 14809, 9901, 5322, 0, 0},
    {945, 5100, 8684, 11541, 9441, 5474, 0, 0},
};

/* Splits each gradient into its shares in the eight directions, counter-clockwise in the image from
   x: the part along an axis, times sqrt(1/2), and the part along a diagonal. A share is below 2^14.
 */
static inline void share_gradients(const int16_t *at, words shares[8]) {
  const words u = gradient_u(at), v = gradient_v(at);
  const words pu = words_positive(u), nu = pu - u, au = pu + nu;
  const words pv = words_positive(v), nv = pv - v, av = pv + nv;
  shares[0] = words_min(pu, pv);
  shares[1] = words_excess(pv, au);
  shares[2] = words_min(nu, pv);
  shares[3] = words_excess(nu, av);
  shares[4] = words_min(nu, nv);
  shares[5] = words_excess(nv, au);
  shares[6] = words_min(pu, nv);
  shares[7] = words_excess(pu, av);
}

/* shares[d] is the row of shares in direction d, summed over the one or two patches; a sum fits 15
   bits. */
static void share_row(const int16_t *row, int32_t num_patches, int16_t shares[8][TVK_PATCH_SIDE]) {
  int32_t x, bin;
  for (x = 0; x < TVK_PATCH_SIDE; x += TVK_WORDS) {
    words sums[8], more[8];
    share_gradients(row + x, sums);
    if (num_patches == 2) {
      share_gradients(row + x + TVK_PATCH_SIDE * TVK_PATCH_SIDE, more);
      for (bin = 0; bin < 8; ++bin) sums[bin] += more[bin];
    }
    for (bin = 0; bin < 8; ++bin) words_store(shares[bin] + x, sums[bin]);
  }
}

/* Sums the shares over the rows of a cell, for each column and direction. The weights are divided
   by 2^halvings. */
static void pool_rows(int16_t (*rows)[8][TVK_PATCH_SIDE], int32_t cell, int32_t halvings,
                      int16_t *pooled) {
  int32_t bin, x, i;
  for (x = 0; x < TVK_PATCH_SIDE; x += TVK_WORDS) {
    words sums[8];
    for (bin = 0; bin < 8; ++bin) sums[bin] = words_of(0);
    for (i = 0; i < CELL_SAMPLES; ++i) {
      const words even = words_of((int16_t)(row_weights[0][cell][i] >> halvings));
      const words odd = words_of((int16_t)(row_weights[1][cell][i] >> halvings));
      for (bin = 0; bin < 8; bin += 2) {
        sums[bin] += words_scale(words_load(rows[i][bin] + x), even);
        sums[bin + 1] += words_scale(words_load(rows[i][bin + 1] + x), odd);
      }
    }
    for (bin = 0; bin < 8; ++bin) words_store(pooled + bin * TVK_PATCH_SIDE + x, sums[bin]);
  }
}

/* Sums the pooled rows over the columns of a cell, for the eight directions. Two columns more than
   the cell has are read, with weight 0. */
static void pool_columns(const int16_t *columns, const int16_t *weights, int32_t *sums) {
#if defined(TVK_AVX2) || defined(TVK_AVX512)
  const __m256i w = _mm256_broadcastsi128_si256(_mm_loadu_si128((const __m128i *)weights));
  __m256i product[4];
  int32_t bin;
  for (bin = 0; bin < 4; ++bin) {
    const int16_t *near_row = columns + bin * TVK_PATCH_SIDE,
                  *far_row = near_row + 4 * TVK_PATCH_SIDE;
    const __m256i both =
        _mm256_inserti128_si256(_mm256_castsi128_si256(_mm_loadu_si128((const __m128i *)near_row)),
                                _mm_loadu_si128((const __m128i *)far_row), 1);
    product[bin] = _mm256_madd_epi16(both, w);
  }
  _mm256_storeu_si256((__m256i *)sums, sums_of_halves(product));
#else
  int32_t bin, i;
  for (bin = 0; bin < 8; ++bin) {
    int32_t sum = 0;
    for (i = 0; i < CELL_SAMPLES; ++i) sum += columns[bin * TVK_PATCH_SIDE + i] * weights[i];
    sums[bin] = sum;
  }
#endif
}

static void gradient_histogram(const int16_t *patches, int32_t num_patches, int32_t *histogram) {
  int16_t rows[PATCH_GRADIENTS][8][TVK_PATCH_SIDE] TVK_ALIGNED;
  /* pool_columns reads two elements after the last column of cells. */
  int16_t pooled[4 * 8 * TVK_PATCH_SIDE + 2] TVK_ALIGNED;
  int32_t x, y;
  for (y = 0; y < PATCH_GRADIENTS; ++y) {
    share_row(patches + y * TVK_PATCH_SIDE, num_patches, rows[y]);
  }
  for (y = 0; y < 4; ++y) {
    pool_rows(rows + 3 * y, y, num_patches - 1, pooled + y * 8 * TVK_PATCH_SIDE);
  }
  memset(pooled + 4 * 8 * TVK_PATCH_SIDE, 0, 2 * sizeof pooled[0]);
  for (y = 0; y < 4; ++y) {
    const int16_t *columns = pooled + y * 8 * TVK_PATCH_SIDE;
    for (x = 0; x < 4; ++x)
      pool_columns(columns + 3 * x, column_weights[x], histogram + (4 * y + x) * 8);
  }
}

/* Shifts the values down to 12 bits, so that the sum of their squares fits 31 bits. */
static void normalise_histogram(const int32_t *histogram, int16_t *values) {
  int32_t any = 0, shift, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) any |= histogram[k];
  shift = any > 4095 ? 20 - __builtin_clz((uint32_t)any) : 0;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) values[k] = (int16_t)(histogram[k] >> shift);
}

static int32_t sum_of_squares(const int16_t *values) {
  int32_t sum = 0, k;
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) sum += values[k] * values[k];
  return sum;
}

/* Clips the values at the limit and returns their sum. A lane adds up to 16 values below 4096. */
static int32_t clip_values(int16_t *values, int16_t limit) {
  uint16_t lanes[TVK_WORDS];
  unsigned_words sums = {0};
  int32_t l1 = 0, k;
  TVK_ROLLED
  for (k = 0; k < TVK_DESCRIPTOR_SIZE; k += TVK_WORDS) {
    const words clipped = words_min(words_load(values + k), words_of(limit));
    words_store(values + k, clipped);
    sums += (unsigned_words)clipped;
  }
  words_store(lanes, (words)sums);
  TVK_ROLLED
  for (k = 0; k < TVK_WORDS; ++k) l1 += lanes[k];
  return l1;
}

/* Writes the bytes of clipped values whose sum is l1. */
static void write_descriptor(const int16_t *values, int32_t l1, int32_t root, uint8_t *descriptor) {
  int32_t k;
  if (l1 == 0) {
    memset(descriptor, 0, TVK_DESCRIPTOR_SIZE);
  } else if (root) {
    /* The integer is 512^2 times the share of the L1 norm. The square root of an integer is never
       so close to n + 1/2 that its rounding could differ between CPUs. */
    const uint32_t scale = (1u << 31) / (uint32_t)l1;
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
      const int32_t square = (int32_t)(((uint32_t)values[k] * scale) >> 13);
      const int32_t byte = (int32_t)(sqrtf((float)square) + 0.5f);
      descriptor[k] = (uint8_t)(byte < 255 ? byte : 255);
    }
  } else {
    const uint32_t scale = (uint32_t)(512.0f * 65536.0f / sqrtf((float)sum_of_squares(values)));
    for (k = 0; k < TVK_DESCRIPTOR_SIZE; ++k) {
      const uint32_t byte = ((uint32_t)values[k] * scale + 32768) >> 16;
      descriptor[k] = (uint8_t)(byte < 255 ? byte : 255);
    }
  }
}

/* Step by step for all: the steps of one descriptor wait for each other, and those of several
   overlap. */
static void quantize_descriptors(const int32_t *histograms, int32_t count, int32_t root,
                                 uint8_t *descriptors) {
  int16_t values[TVK_QUANTIZED][TVK_DESCRIPTOR_SIZE];
  int32_t sums[TVK_QUANTIZED], n;
  for (n = 0; n < count; ++n) {
    normalise_histogram(histograms + n * TVK_DESCRIPTOR_SIZE, values[n]);
    sums[n] = sum_of_squares(values[n]);
  }
  for (n = 0; n < count; ++n) {
    sums[n] = clip_values(values[n], (int16_t)(0.2f * sqrtf((float)sums[n])));
  }
  for (n = 0; n < count; ++n) {
    write_descriptor(values[n], sums[n], root, descriptors + n * TVK_DESCRIPTOR_SIZE);
  }
}
