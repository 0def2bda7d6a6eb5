/* Reads the PNG files that the tests need (8 bits a sample, not interlaced, no palette) into
   8-bit luma, so that tests of the C library need no image library. By RFC 1950, RFC 1951 and
   the PNG specification; checksums are not verified, so use it only for files that ship with the
   tests. */
#ifndef TEST_SUPPORT_PNG_H
#define TEST_SUPPORT_PNG_H

#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>

typedef struct png_bits {
  const uint8_t *bytes;
  size_t size, at;
  uint32_t hold;
  int count, failed;
} png_bits;

static inline uint32_t png_take(png_bits *in, int count) {
  uint32_t value;
  while (in->count < count) {
    if (in->at >= in->size) {
      in->failed = 1;
      return 0;
    }
    in->hold |= (uint32_t)in->bytes[in->at++] << in->count;
    in->count += 8;
  }
  value = in->hold & ((1u << count) - 1u);
  in->hold >>= count;
  in->count -= count;
  return value;
}

/* A canonical prefix code: how many codes have each length, and their symbols in order. */
typedef struct png_code {
  uint16_t counts[16], symbols[288];
} png_code;

static inline void png_make_code(const uint8_t *lengths, int num_symbols, png_code *code) {
  int k, starts[16];
  memset(code->counts, 0, sizeof code->counts);
  for (k = 0; k < num_symbols; ++k) ++code->counts[lengths[k]];
  code->counts[0] = 0;
  starts[0] = starts[1] = 0;
  for (k = 2; k < 16; ++k) starts[k] = starts[k - 1] + code->counts[k - 1];
  for (k = 0; k < num_symbols; ++k) {
    if (lengths[k] != 0) code->symbols[starts[lengths[k]]++] = (uint16_t)k;
  }
}

static inline int png_symbol(png_bits *in, const png_code *code) {
  int value = 0, first = 0, index = 0, length;
  for (length = 1; length < 16 && !in->failed; ++length) {
    value |= (int)png_take(in, 1);
    if (value - first < code->counts[length]) return code->symbols[index + value - first];
    index += code->counts[length];
    first = (first + code->counts[length]) << 1;
    value <<= 1;
  }
  in->failed = 1;
  return 256;
}

static inline void png_read_codes(png_bits *in, int kind, png_code *literals, png_code *distances) {
  static const uint8_t order[19] = {16, 17, 18, 0, 8,  7, 9,  6, 10, 5,
                                    11, 4,  12, 3, 13, 2, 14, 1, 15};
  uint8_t lengths[288 + 32] = {0};
  int num_literals = 288, num_distances = 30, k = 0;
  if (kind == 1) {
    for (k = 0; k < 288; ++k) lengths[k] = k < 144 ? 8 : k < 256 ? 9 : k < 280 ? 7 : 8;
    for (k = 288; k < 288 + 30; ++k) lengths[k] = 5;
  } else {
    png_code code;
    uint8_t code_lengths[19] = {0};
    int num_codes;
    num_literals = (int)png_take(in, 5) + 257;
    num_distances = (int)png_take(in, 5) + 1;
    num_codes = (int)png_take(in, 4) + 4;
    for (k = 0; k < num_codes; ++k) code_lengths[order[k]] = (uint8_t)png_take(in, 3);
    png_make_code(code_lengths, 19, &code);
    for (k = 0; k < num_literals + num_distances && !in->failed;) {
      const int symbol = png_symbol(in, &code);
      int repeat = 1;
      uint8_t length = (uint8_t)symbol;
      if (symbol >= 16) {
        length = symbol == 16 && k > 0 ? lengths[k - 1] : 0;
        repeat = symbol == 16   ? 3 + (int)png_take(in, 2)
                 : symbol == 17 ? 3 + (int)png_take(in, 3)
                                : 11 + (int)png_take(in, 7);
      }
      for (; repeat > 0 && k < num_literals + num_distances; --repeat) lengths[k++] = length;
    }
  }
  png_make_code(lengths, num_literals, literals);
  png_make_code(lengths + num_literals, num_distances, distances);
}

/* Decompresses (inflate) into out. Returns 1 if the result has exactly out_size bytes, else 0. */
static inline int png_inflate(const uint8_t *bytes, size_t size, uint8_t *out, size_t out_size) {
  static const uint16_t bases[29] = {3,  4,  5,  6,   7,   8,   9,   10,  11, 13,
                                     15, 17, 19, 23,  27,  31,  35,  43,  51, 59,
                                     67, 83, 99, 115, 131, 163, 195, 227, 258};
  static const uint8_t extras[29] = {0, 0, 0, 0, 0, 0, 0, 0, 1, 1, 1, 1, 2, 2, 2,
                                     2, 3, 3, 3, 3, 4, 4, 4, 4, 5, 5, 5, 5, 0};
  static const uint16_t distance_bases[30] = {
      1,   2,   3,   4,   5,   7,    9,    13,   17,   25,   33,   49,   65,    97,    129,
      193, 257, 385, 513, 769, 1025, 1537, 2049, 3073, 4097, 6145, 8193, 12289, 16385, 24577};
  png_bits in = {bytes, size, 2, 0, 0, 0}; /* skips 2 bytes of zlib header */
  size_t at = 0;
  int last = 0;
  while (!last && !in.failed) {
    int kind;
    last = (int)png_take(&in, 1);
    kind = (int)png_take(&in, 2);
    if (kind == 0) {
      uint32_t count;
      in.hold = 0;
      in.count = 0;
      count = png_take(&in, 16);
      png_take(&in, 16);
      if (count > in.size - in.at || count > out_size - at) return 0;
      memcpy(out + at, in.bytes + in.at, count);
      in.at += count;
      at += count;
    } else {
      png_code literals, distances;
      if (kind == 3) return 0;
      png_read_codes(&in, kind, &literals, &distances);
      while (!in.failed) {
        const int symbol = png_symbol(&in, &literals);
        size_t length, distance;
        int slot;
        if (symbol == 256) break;
        if (symbol < 256) {
          if (at >= out_size) return 0;
          out[at++] = (uint8_t)symbol;
          continue;
        }
        if (symbol > 285) return 0;
        length = bases[symbol - 257] + png_take(&in, extras[symbol - 257]);
        slot = png_symbol(&in, &distances);
        if (slot > 29) return 0;
        distance = distance_bases[slot] + png_take(&in, slot < 2 ? 0 : slot / 2 - 1);
        if (distance > at || length > out_size - at) return 0;
        for (; length > 0; --length, ++at) out[at] = out[at - distance];
      }
    }
  }
  return !in.failed && at == out_size;
}

static inline int png_paeth(int a, int b, int c) {
  const int pa = abs(b - c), pb = abs(a - c), pc = abs(a + b - 2 * c);
  return pa <= pb && pa <= pc ? a : pb <= pc ? b : c;
}

/* Undoes the row filters in place; rows of 1 + row_bytes. */
static inline void png_unfilter(uint8_t *rows, int height, int row_bytes, int pixel_bytes) {
  int x, y;
  for (y = 0; y < height; ++y) {
    uint8_t *row = rows + (size_t)y * (size_t)(row_bytes + 1) + 1;
    const uint8_t *above = row - (row_bytes + 1);
    for (x = 0; x < row_bytes; ++x) {
      const int a = x >= pixel_bytes ? row[x - pixel_bytes] : 0, b = y > 0 ? above[x] : 0;
      const int c = x >= pixel_bytes && y > 0 ? above[x - pixel_bytes] : 0;
      const int add[5] = {0, a, b, (a + b) / 2, png_paeth(a, b, c)};
      row[x] = (uint8_t)(row[x] + add[row[-1] % 5]);
    }
  }
}

static inline uint32_t png_u32(const uint8_t *b) {
  return (uint32_t)b[0] << 24 | (uint32_t)b[1] << 16 | (uint32_t)b[2] << 8 | b[3];
}

static inline uint8_t *png_read_file(const char *path, size_t *size) {
  FILE *file = fopen(path, "rb");
  uint8_t *bytes = NULL;
  long end;
  if (file == NULL) return NULL;
  fseek(file, 0, SEEK_END);
  end = ftell(file);
  rewind(file);
  if (end > 0) bytes = (uint8_t *)malloc((size_t)end);
  if (bytes != NULL) *size = fread(bytes, 1, (size_t)end, file);
  fclose(file);
  return bytes;
}

/* Joins the IDAT chunks at the front of `bytes`; returns their size. */
static inline size_t png_join_data(uint8_t *bytes, size_t size) {
  size_t at = 8, joined = 0;
  while (size >= 12 && at <= size - 12) {
    const uint32_t length = png_u32(bytes + at);
    if (length > size - at - 12) break;
    if (memcmp(bytes + at + 4, "IDAT", 4) == 0) {
      memmove(bytes + joined, bytes + at + 8, length);
      joined += length;
    }
    at += 12 + (size_t)length;
  }
  return joined;
}

/* Returns the image as 8-bit luma, which the caller frees, or null if it cannot be read. */
static inline uint8_t *png_load_luma(const char *path, int32_t *width, int32_t *height) {
  size_t size = 0, joined, k, count;
  int channels, row_bytes;
  uint8_t *rows, *luma, *bytes = png_read_file(path, &size);
  if (bytes == NULL) return NULL;
  if (size < 33 || memcmp(bytes + 1, "PNG", 3) != 0 || bytes[24] != 8 || bytes[25] == 3 ||
      bytes[28] != 0) {
    free(bytes);
    return NULL;
  }
  *width = (int32_t)png_u32(bytes + 16);
  *height = (int32_t)png_u32(bytes + 20);
  channels = (bytes[25] & 2 ? 3 : 1) + (bytes[25] & 4 ? 1 : 0);
  row_bytes = *width * channels;
  joined = png_join_data(bytes, size);
  count = (size_t)*width * (size_t)*height;
  rows = (uint8_t *)malloc((size_t)(row_bytes + 1) * (size_t)*height);
  luma = (uint8_t *)malloc(count);
  if (rows == NULL || luma == NULL ||
      !png_inflate(bytes, joined, rows, (size_t)(row_bytes + 1) * (size_t)*height)) {
    free(luma);
    luma = NULL;
  } else {
    png_unfilter(rows, *height, row_bytes, channels);
    for (k = 0; k < count; ++k) {
      const size_t w = (size_t)*width;
      const uint8_t *p = rows + k / w * (size_t)(row_bytes + 1) + 1 + k % w * (size_t)channels;
      luma[k] = channels < 3 ? p[0] : (uint8_t)((77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8);
    }
  }
  free(rows);
  free(bytes);
  return luma;
}

#endif
