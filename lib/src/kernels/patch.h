/* The kernels pair_rows and sample_patch: bilinear samples of a rotated square. The rows of the
   image are stored in pairs, so that a single 32-bit load reads the four neighbours of a position,
   and positions at the border need no special case. The two weights of an interpolation add up to
   127, not to 128. This compensates for the truncation of the fraction, and lets a weight times a
   pixel (less 128) fit 16 bits. */

static void pair_rows(const uint8_t *row, const uint8_t *below, int32_t width, uint16_t *pairs) {
  int32_t x;
  for (x = 0; x < width; ++x) pairs[x] = (uint16_t)((row[x] | below[x] << 8) ^ 0x8080);
  pairs[width] = pairs[width - 1];
}

typedef struct sampled_image {
  const uint16_t *pairs;
  int32_t pitch, right,
      bottom; /* pitch in pixels; right and bottom are the largest positions, in 1/65536 pixel */
} sampled_image;

#if defined(TVK_AVX512)

/* byte_shares: the weights [127 - f, f] of a position's fraction f as bytes, twice. word_shares:
   the same weights as 16-bit numbers, once. */
static inline __m512i byte_shares(__m512i position) {
  const __m512i spread =
      _mm512_shuffle_epi8(_mm512_srli_epi32(position, 1),
                          _mm512_set4_epi32(0x0d0d0d0d, 0x09090909, 0x05050505, 0x01010101));
  return _mm512_xor_si512(_mm512_and_si512(spread, _mm512_set1_epi8(127)), _mm512_set1_epi16(127));
}
static inline __m512i word_shares(__m512i position) {
  const __m512i spread = _mm512_shuffle_epi8(
      _mm512_srli_epi32(position, 1),
      _mm512_set4_epi32((int)0x800d800du, (int)0x80098009u, (int)0x80058005u, (int)0x80018001u));
  return _mm512_xor_si512(_mm512_and_si512(spread, _mm512_set1_epi8(127)), _mm512_set1_epi32(127));
}

/* Whether first, first + across, first + down and first + across + down are all in 0..most. */
static int is_within(int32_t first, int32_t across, int32_t down, int32_t most) {
  const int32_t low = first + (across < 0 ? across : 0) + (down < 0 ? down : 0);
  const int32_t high = first + (across > 0 ? across : 0) + (down > 0 ? down : 0);
  return low >= 0 && high <= most;
}

/* Samples a turned patch that lies within the image: the places of all samples, then single loads
   and the sums. With the gather instruction a pair takes 1 per cent longer on Zen 4. */
static void sample_turned(const sampled_image *image, int32_t x, int32_t y, int32_t du_x,
                          int32_t du_y, int32_t num_rows, int16_t *patch) {
  const __m512i i = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
  const __m512i along_x = _mm512_mullo_epi32(i, _mm512_set1_epi32(du_x));
  const __m512i along_y = _mm512_mullo_epi32(i, _mm512_set1_epi32(du_y));
  /* TVK_ALIGNED is too little: each row is stored as one vector. */
  uint32_t offsets[TVK_PATCH_SIDE][TVK_PATCH_SIDE] __attribute__((aligned(64)));
  int32_t j, k;
  for (j = 0; j < num_rows; ++j) {
    const __m512i at_x = _mm512_add_epi32(_mm512_set1_epi32(x - j * du_y), along_x);
    const __m512i at_y = _mm512_add_epi32(_mm512_set1_epi32(y + j * du_x), along_y);
    const __m512i yx = _mm512_mask_mov_epi16(at_y, 0x55555555, _mm512_srli_epi32(at_x, 16));
    _mm512_store_si512(offsets[j],
                       _mm512_madd_epi16(yx, _mm512_set1_epi32(image->pitch << 16 | 1)));
  }
  for (j = 0; j < num_rows; ++j) {
    const __m512i at_x = _mm512_add_epi32(_mm512_set1_epi32(x - j * du_y), along_x);
    const __m512i at_y = _mm512_add_epi32(_mm512_set1_epi32(y + j * du_x), along_y);
    for (k = 0; k < TVK_PATCH_SIDE; ++k) {
      memcpy(&offsets[j][k], image->pairs + offsets[j][k], sizeof offsets[j][k]);
    }
    const __m512i columns = _mm512_maddubs_epi16(byte_shares(at_y), _mm512_load_si512(offsets[j]));
    const __m512i sums = _mm512_srai_epi32(_mm512_madd_epi16(columns, word_shares(at_x)), 8);
    _mm256_storeu_si256((__m256i *)(patch + j * TVK_PATCH_SIDE), _mm512_cvtepi32_epi16(sums));
  }
}

/* Samples an upright patch and returns 1 if a single load of 32 pairs holds each of its rows, which
   is three times as fast as gathering them. Else returns 0. */
static int sample_upright(const sampled_image *image, int32_t x, int32_t y, int32_t step,
                          int32_t num_rows, int16_t *patch) {
  const __m512i i = _mm512_set_epi32(15, 14, 13, 12, 11, 10, 9, 8, 7, 6, 5, 4, 3, 2, 1, 0);
  const int32_t first = x >> 16, last = x + (TVK_PATCH_SIDE - 1) * step;
  if (x < 0 || step < 0 || last > image->right || (last >> 16) - first > 30 ||
      first + 32 > image->pitch) {
    return 0;
  }
  const __m512i all_x = _mm512_add_epi32(_mm512_set1_epi32(x & 65535),
                                         _mm512_mullo_epi32(i, _mm512_set1_epi32(step)));
  const __m512i left = _mm512_srli_epi32(all_x, 16);
  const __m512i both =
      _mm512_or_si512(left, _mm512_slli_epi32(_mm512_add_epi32(left, _mm512_set1_epi32(1)), 16));
  const __m512i shares = word_shares(all_x);
  int32_t j;
  for (j = 0; j < num_rows; ++j, y += step) {
    const int32_t low = y < 0 ? 0 : y, sy = low < image->bottom ? low : image->bottom;
    const uint16_t *const row = image->pairs + (sy >> 16) * image->pitch + first;
    const __m512i quads = _mm512_permutexvar_epi16(both, _mm512_loadu_si512(row));
    const __m512i columns = _mm512_maddubs_epi16(byte_shares(_mm512_set1_epi32(sy)), quads);
    const __m512i sums = _mm512_srai_epi32(_mm512_madd_epi16(columns, shares), 8);
    _mm256_storeu_si256((__m256i *)(patch + j * TVK_PATCH_SIDE), _mm512_cvtepi32_epi16(sums));
  }
  return 1;
}

#elif defined(TVK_AVX2)

static inline __m256i byte_shares(__m256i position) {
  const __m256i spread =
      _mm256_shuffle_epi8(_mm256_srli_epi32(position, 1),
                          _mm256_setr_epi32(0x01010101, 0x05050505, 0x09090909, 0x0d0d0d0d,
                                            0x01010101, 0x05050505, 0x09090909, 0x0d0d0d0d));
  return _mm256_xor_si256(_mm256_and_si256(spread, _mm256_set1_epi8(127)), _mm256_set1_epi16(127));
}
static inline __m256i word_shares(__m256i position) {
  const __m256i fraction = _mm256_and_si256(_mm256_srli_epi32(position, 9), _mm256_set1_epi32(127));
  const __m256i spread = _mm256_or_si256(fraction, _mm256_slli_epi32(fraction, 16));
  return _mm256_xor_si256(spread, _mm256_set1_epi32(127));
}

/* Eight samples at the positions (x, y), in 1/65536 pixel, as 32-bit numbers. */
static inline __m256i sample_eight(const sampled_image *image, __m256i x, __m256i y) {
  const __m256i zero = _mm256_setzero_si256();
  const __m256i sx = _mm256_min_epi32(_mm256_max_epi32(x, zero), _mm256_set1_epi32(image->right));
  const __m256i sy = _mm256_min_epi32(_mm256_max_epi32(y, zero), _mm256_set1_epi32(image->bottom));
  const __m256i yx = _mm256_blend_epi16(sy, _mm256_srli_epi32(sx, 16), 0x55);
  const __m256i offset = _mm256_madd_epi16(yx, _mm256_set1_epi32(image->pitch << 16 | 1));
  const __m256i quads = _mm256_i32gather_epi32((const int *)image->pairs, offset, 2);
  const __m256i columns = _mm256_maddubs_epi16(byte_shares(sy), quads);
  return _mm256_srai_epi32(_mm256_madd_epi16(columns, word_shares(sx)), 8);
}

static void sample_row(const sampled_image *image, int32_t x, int32_t y, int32_t du_x, int32_t du_y,
                       int16_t *out) {
  const __m256i i = _mm256_setr_epi32(0, 1, 2, 3, 4, 5, 6, 7);
  const __m256i near_x =
      _mm256_add_epi32(_mm256_set1_epi32(x), _mm256_mullo_epi32(i, _mm256_set1_epi32(du_x)));
  const __m256i near_y =
      _mm256_add_epi32(_mm256_set1_epi32(y), _mm256_mullo_epi32(i, _mm256_set1_epi32(du_y)));
  const __m256i far_x = _mm256_add_epi32(near_x, _mm256_set1_epi32(8 * du_x));
  const __m256i far_y = _mm256_add_epi32(near_y, _mm256_set1_epi32(8 * du_y));
  const __m256i packed =
      _mm256_packs_epi32(sample_eight(image, near_x, near_y), sample_eight(image, far_x, far_y));
  _mm256_storeu_si256((__m256i *)out, _mm256_permute4x64_epi64(packed, 0xd8));
}

#else

static inline int32_t clamp_i32(int32_t value, int32_t low, int32_t high) {
  const int32_t raised = value < low ? low : value;
  return raised < high ? raised : high;
}

/* The work is in three loops, so that compilers can vectorise all of it except the loads. */
static void sample_row(const sampled_image *image, int32_t x, int32_t y, int32_t du_x, int32_t du_y,
                       int16_t *out) {
  int32_t offset[TVK_PATCH_SIDE];
  int16_t fx[TVK_PATCH_SIDE], fy[TVK_PATCH_SIDE];
  uint16_t left[TVK_PATCH_SIDE], right[TVK_PATCH_SIDE];
  int32_t i;
  for (i = 0; i < TVK_PATCH_SIDE; ++i) {
    const int32_t sx = clamp_i32(x + i * du_x, 0, image->right);
    const int32_t sy = clamp_i32(y + i * du_y, 0, image->bottom);
    offset[i] = (sy >> 16) * image->pitch + (sx >> 16);
    fx[i] = (int16_t)((sx >> 9) & 127);
    fy[i] = (int16_t)((sy >> 9) & 127);
  }
  for (i = 0; i < TVK_PATCH_SIDE; ++i) {
    left[i] = image->pairs[offset[i]];
    right[i] = image->pairs[offset[i] + 1];
  }
  for (i = 0; i < TVK_PATCH_SIDE; ++i) {
    const int16_t a = (int16_t)((int16_t)(left[i] << 8) >> 8), c = (int16_t)((int16_t)left[i] >> 8);
    const int16_t b = (int16_t)((int16_t)(right[i] << 8) >> 8),
                  d = (int16_t)((int16_t)right[i] >> 8);
    const int16_t gx = (int16_t)(127 - fx[i]), gy = (int16_t)(127 - fy[i]);
    const int16_t at_left = (int16_t)(gy * a + fy[i] * c), at_right = (int16_t)(gy * b + fy[i] * d);
    out[i] = (int16_t)((gx * at_left + fx[i] * at_right) >> 8);
  }
}

#endif

#if defined(TVK_AVX512)
/* Of the AVX2 set, for patches that reach beyond the image. */
extern void tvk_sample_patch_avx2(const uint16_t *pairs, int32_t width, int32_t height, int32_t x,
                                  int32_t y, int32_t du_x, int32_t du_y, int32_t num_rows,
                                  int16_t *patch);
#endif

static void sample_patch(const uint16_t *pairs, int32_t width, int32_t height, int32_t x, int32_t y,
                         int32_t du_x, int32_t du_y, int32_t num_rows, int16_t *patch) {
  const sampled_image image = {pairs, width + 1, (width - 1) << 16, (height - 1) << 16};
  patch[num_rows * TVK_PATCH_SIDE] = 0;
#if defined(TVK_AVX512)
  const int32_t across = TVK_PATCH_SIDE - 1, down = num_rows - 1;
  if (du_y == 0 && sample_upright(&image, x, y, du_x, num_rows, patch)) return;
  if (is_within(x, across * du_x, -down * du_y, image.right) &&
      is_within(y, across * du_y, down * du_x, image.bottom)) {
    sample_turned(&image, x, y, du_x, du_y, num_rows, patch);
  } else {
    tvk_sample_patch_avx2(pairs, width, height, x, y, du_x, du_y, num_rows, patch);
  }
#else
  int32_t j;
  for (j = 0; j < num_rows; ++j) {
    sample_row(&image, x - j * du_y, y + j * du_x, du_x, du_y, patch + j * TVK_PATCH_SIDE);
  }
#endif
}
