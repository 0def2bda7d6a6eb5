/* The kernels: the inner loops over pixels, patches and descriptors.

   TVK_LIST names each kernel once; the table, the sets and the checker (test/kernel) all come from
   it. The C files are the definition: integer arithmetic, or single IEEE operations in a written
   order, so that every set gives the same bytes. A set is the same source compiled for another
   instruction set, with intrinsics only where they were measured to pay. */
#ifndef TWOVIEW_KERNELS_H
#define TWOVIEW_KERNELS_H

#include <stddef.h>
#include <stdint.h>

#define TVK_NOINLINE __attribute__((noinline))
/* Before a loop that is smaller when the compiler does not unroll it, and as fast, or seldom run.
 */
#if defined(__clang__)
#define TVK_ROLLED _Pragma("nounroll")
#else
#define TVK_ROLLED _Pragma("GCC unroll 1")
#endif

#ifdef __cplusplus
extern "C" {
#endif

typedef struct tvk_nearest {
  int32_t best, second, idx;
} tvk_nearest;

#define TVK_CIRCLE_RADIUS 3 /* of the segment test */

#define TVK_PATCH_SIDE 16  /* samples a side of a descriptor's patch, 15 gradients between them */
#define TVK_ORIENT_SIDE 12 /* the same for the orientation's patch */
#define TVK_ORIENT_BINS 32
#define TVK_DESCRIPTOR_SIZE 128

/* The columns that mutual_nearest prepares at once, and the scratch of one: as bytes, and as 16-bit
   numbers, which the sets without products of bytes take. */
#define TVK_NEAREST_PANEL 2048
#define TVK_NEAREST_COLUMN_BYTES 152
#define TVK_NEAREST_PANEL_16 768
#define TVK_NEAREST_COLUMN_16_BYTES 272
#define TVK_NEAREST_ROW_BYTES 832 /* of one of the rows that meet them at once, and of one more */
#define TVK_NEAREST_CHUNK_BYTES(num_rows) \
  ((size_t)((num_rows) < 63 ? (num_rows) + 1 : 64) * TVK_NEAREST_ROW_BYTES)
#define TVK_NEAREST_MIN(a, b) ((a) < (b) ? (a) : (b))
#define TVK_NEAREST_MAX(a, b) ((a) < (b) ? (b) : (a))
#define TVK_NEAREST_ROOM(num_columns, panel, bytes) \
  ((size_t)TVK_NEAREST_MIN(((num_columns) + 63) / 64 * 64, panel) * (bytes))
#define TVK_NEAREST_PANEL_BYTES(num_columns)                                      \
  TVK_NEAREST_MAX(                                                                \
      TVK_NEAREST_ROOM(num_columns, TVK_NEAREST_PANEL, TVK_NEAREST_COLUMN_BYTES), \
      TVK_NEAREST_ROOM(num_columns, TVK_NEAREST_PANEL_16, TVK_NEAREST_COLUMN_16_BYTES))
#define TVK_NEAREST_SCRATCH(num_rows, num_columns) \
  (TVK_NEAREST_CHUNK_BYTES(num_rows) + TVK_NEAREST_PANEL_BYTES(num_columns))

#define TVK_WIDTH 8              /* lanes of the kernels on doubles */
#define TVK_SCORE_BLOCK 32       /* matches */
#define TVK_SCORE_ONE 65536      /* what a match outside the threshold costs */
#define TVK_LARGEST_LOSS 16384.0 /* r^2 / scale^2 beyond which Cauchy's loss is level */
#define TVK_RELPOSE_MODELS 10    /* most essential matrices of a sample of five */
#define TVK_SAMPSON_SUMS 56      /* numbers that sampson_sums adds up */
#define TVK_TRANSFER_SUMS 47     /* of transfer_sums */

struct tv_point;

/* Two pinholes: x, y of camera 0, then of camera 1; x1 = R x0 + baseline direction, direction of
   length 1, and camera 1's centre at baseline center1. */
typedef struct tvk_triangulate_pair {
  double focal[4], inverse_focal[4], principal[4];
  double R[9], direction[3], center1[3], baseline;
  double parallel_sine_sq; /* rays with a smaller sine, squared, between them are parallel */
} tvk_triangulate_pair;

/* fast_score_row: rows[0..6] are the image rows y-3..y+3. Writes for each x in [0, width) the
   largest threshold at which (x, y) is a corner with `arc` (9..12) contiguous brighter or darker
   circle pixels, where that is at least `threshold` (>= 1), else 0. 0 in the 3-pixel rim.
   fast_contrasts: the score before the threshold of each of `count` pixels and its eight
   neighbours, in raster order: by how much the best arc is brighter or darker, below 0 where none
   is. Each circle lies in the image; of the last row of the nine nothing behind the circle is read.
   suppress_row: x of the scores in `cur` that are above 0 and above all eight neighbours; returns
   how many. xs has room for (width + 1) / 2. The first and last x are never kept. average_rows:
   columns of up to three rows, weights (of 256) in row_weights, to sums in [0, 65280].
   average_columns: out[x] = (sum over k < 3 of column_weights[3 x + k] * sums[first[x] + k] + 2^15)
     >> 16; where a weight is 0 the sum is not read.
   halve_row: out[x] = (a[2x] + a[2x+1] + b[2x] + b[2x+1] + 2) / 4.
   blur_row: 3x3 binomial (1 2 1)/4 in both directions, edges repeated, rounded once at the end.
   pair_rows: pairs[x] = the pixel and the one below it, in the low and the high byte, each less 128
   in two's complement; pairs[width] = pairs[width - 1]. sample_patch: num_rows rows of
   TVK_PATCH_SIDE bilinear samples of an image of pairs, width + 1 to a row, the last row paired
   with itself, and a 0 behind them; sample (i, j) lies at (x + i du_x - j du_y, y + i du_y + j
   du_x), all in 1/65536 pixel; positions are clamped to the image. In 256 / 127^2 grey level, less
   128 levels. orientation_histogram: of the gradients within 6 samples of the middle of
   TVK_ORIENT_SIDE upright rows of TVK_ORIENT_SIDE samples, Gaussian weight of sigma 2 samples:
   TVK_ORIENT_BINS directions, clockwise as seen, smoothed around the circle. gradient_histogram:
   SIFT's 4x4x8 histogram of TVK_PATCH_SIDE rows (feature/describe.h), with trilinear sharing and
   Gaussian window. quantize_descriptor: SIFT's normalisation, clipping at 0.2, and 128 bytes; root:
   RootSIFT. mutual_nearest: of_rows[i].idx is the column whose nearest is row i and that is i's
   nearest, each strictly, else -1 (and 0 for the rest); best their squared distance, second the
   smallest other distance of either, INT32_MAX where there is none. of_columns (num_columns) and
   scratch (TVK_NEAREST_SCRATCH(num_rows, num_columns) bytes, aligned to 64) are left with anything
   in them. squared_distances: of the query to rows[indices[k]]. Of matches (geometry/ray_pairs.h),
   arrays: rays (3 and 3) and slopes d ray / d pixel (6 and 6, row-major 3x2); on_plane: the rays
   end in 1 and the slopes' last rows are zero, and are not read; m: a model matrix, row-major;
   matches indices[0 .. count), or first, first + 1, .. where null: sampson_squares: squares[k] =
   r^2 of Sampson's distance, infinite where that is no number. pose_squares: the same of a pose's
   matrix E, R and t (21 numbers), infinite too where the match is behind a camera by more than
   arrays[18][k] times scale (an angle; essential.h's depth_vote). transfer_squares: the same of the
   transfer residual of a homography. sampson_sums: to sums[TVK_WIDTH n + k % TVK_WIDTH] adds match
   k's part of sum n: with slopes g of r by m's entries and the loss's weight w, upper triangle of w
   g g' (45, row by row), w g r (9), the truncated loss (r^2 / scale^2 or 1); the last is a product,
   of Cauchy's 1 + r^2 / scale^2. Of the two losses the one that is asked for is added.
   transfer_sums: the same of the transfer residual; in place of w g g' the 36 products of the upper
     triangles of w S' W S and f0 f0', S = d d / d (H f0), W the residual's weight.
   sampson_score: arrays in single precision, on the plane x0 y0 x1 y1 and the upper triangles of J
   J' (3 and 3), else all 18: the sum over blocks first_block .. first_block + num_blocks - 1 of
     min(r^2 / T^2, 1) TVK_SCORE_ONE, each truncated to an integer.
   relpose_5pt: rays[TVK_WIDTH (6 k + 3 view + c) + s] is entry c of sample s's k-th ray in a view,
   for TVK_WIDTH samples, of which the first num_samples are to be solved; the others are finite.
   Writes sample s's essential matrices, row-major, Frobenius norm 1, that have no match before one
   camera and behind the other, to essentials + 9 TVK_RELPOSE_MODELS s, and their number to
   counts[s], 0 for a degenerate sample. What lies behind them is scratch. triangulate: count
   matches of two pinholes (pixels: x and y each) by Midpoint, Linear-LS or Iterative-LS (method, a
   tv_triangulation). status -1, and zeros, for a match that is none of "ok" and "behind", or needs
   more care; returns whether there is one. */
#define TVK_PIXEL_LIST(X)                                                                          \
  X(fast_score_row, void,                                                                          \
    (const uint8_t *const rows[7], int32_t width, int32_t arc, int32_t threshold,                  \
     uint8_t *scores))                                                                             \
  X(fast_contrasts, void,                                                                          \
    (const uint8_t *const *centres, int32_t count, int64_t stride, int32_t arc,                    \
     int16_t *contrasts))                                                                          \
  X(suppress_row, int32_t,                                                                         \
    (const uint8_t *prev, const uint8_t *cur, const uint8_t *next, int32_t width, uint16_t *xs))   \
  X(average_rows, void,                                                                            \
    (const uint8_t *const rows[3], const int32_t row_weights[3], int32_t width, uint16_t *sums))   \
  X(average_columns, void,                                                                         \
    (const uint16_t *sums, const int32_t *first, const int32_t *column_weights, int32_t out_width, \
     uint8_t *out))                                                                                \
  X(halve_row, void, (const uint8_t *a, const uint8_t *b, int32_t out_width, uint8_t *out))        \
  X(blur_row, void,                                                                                \
    (const uint8_t *above, const uint8_t *row, const uint8_t *below, int32_t width, uint8_t *out)) \
  X(pair_rows, void, (const uint8_t *row, const uint8_t *below, int32_t width, uint16_t *pairs))   \
  X(sample_patch, void,                                                                            \
    (const uint16_t *pairs, int32_t width, int32_t height, int32_t x, int32_t y, int32_t du_x,     \
     int32_t du_y, int32_t num_rows, int16_t *patch))                                              \
  X(orientation_histogram, void, (const int16_t *patch, int32_t *histogram))                       \
  X(gradient_histogram, void, (const int16_t *patch, int32_t *histogram))                          \
  X(quantize_descriptor, void, (const int32_t *histogram, int32_t root, uint8_t *descriptor))      \
  X(mutual_nearest, void,                                                                          \
    (const uint8_t *rows, int32_t num_rows, const uint8_t *columns, int32_t num_columns,           \
     void *scratch, tvk_nearest *of_columns, tvk_nearest *of_rows))                                \
  X(squared_distances, void,                                                                       \
    (const uint8_t *query, const uint8_t *rows, const int32_t *indices, int32_t count,             \
     int32_t *out))

/* Those on matches, in files of their own (lanes_*.c): a set may take another set's. */
#define TVK_MATCH_LIST(X)                                                                   \
  X(sampson_squares, void,                                                                  \
    (const double *const *arrays, const int32_t *indices, int32_t first, int32_t count,     \
     int32_t on_plane, const double *m, double *squares))                                   \
  X(pose_squares, void,                                                                     \
    (const double *const *arrays, int32_t first, int32_t count, int32_t on_plane,           \
     const double *pose, double scale, double *squares))                                    \
  X(transfer_squares, void,                                                                 \
    (const double *const *arrays, const int32_t *indices, int32_t first, int32_t count,     \
     int32_t on_plane, const double *m, double *squares))                                   \
  X(sampson_sums, void,                                                                     \
    (const double *const *arrays, const int32_t *indices, int32_t first, int32_t count,     \
     int32_t on_plane, const double *m, double inverse_sq, int32_t cauchy, double *sums))   \
  X(transfer_sums, void,                                                                    \
    (const double *const *arrays, const int32_t *indices, int32_t first, int32_t count,     \
     int32_t on_plane, const double *m, double inverse_sq, int32_t cauchy, double *sums))   \
  X(sampson_score, int64_t,                                                                 \
    (const float *const *arrays, int32_t first_block, int32_t num_blocks, int32_t on_plane, \
     const float *m, float inverse_sq))                                                     \
  X(relpose_5pt, void,                                                                      \
    (const double *rays, int32_t num_samples, double *essentials, int32_t *counts))         \
  X(triangulate, int32_t,                                                                   \
    (const tvk_triangulate_pair *pair, int32_t method, const double *pixels0,               \
     const double *pixels1, int32_t count, struct tv_point *points))

#define TVK_LIST(X) TVK_PIXEL_LIST(X) TVK_MATCH_LIST(X)

typedef struct tvk_table {
  int32_t set; /* a tv_kernels */
#define TVK_MEMBER(name, result, parameters) result(*name) parameters;
  TVK_LIST(TVK_MEMBER)
#undef TVK_MEMBER
} tvk_table;

/* All tables that this CPU and this build have, n = 0, 1, .. from the C set's to the fastest, then
   null. The NEON set has two where the CPU has ARMv8.2's dot product: without it and with it. */
const tvk_table *tvk_nth(int32_t n);

/* The fastest of them of a tv_kernels number, of all for 0 (auto); null if there is none. */
const tvk_table *tvk_select(int32_t set);

#ifdef __cplusplus
}
#endif

#endif
