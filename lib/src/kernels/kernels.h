/* The kernels: the inner loops over pixels, patches, descriptors and matches.

   The lists of TVK_PARTS name each kernel once. The function tables, the declarations and the
   checker (test/kernel) all come from them. The C files are the definition: they use integer
   arithmetic, or single IEEE operations in a written order, so that every set gives the same bytes.
   A set is the same source compiled for another instruction set, with intrinsics only where they
   were measured to be faster. */
#ifndef TWOVIEW_KERNELS_H
#define TWOVIEW_KERNELS_H

#include <stddef.h>
#include <stdint.h>

#define TVK_NOINLINE __attribute__((noinline))
/* Put before a loop that should not be unrolled: it is smaller, and as fast or seldom run. */
#if defined(__clang__)
#define TVK_ROLLED _Pragma("nounroll")
#else
#define TVK_ROLLED _Pragma("GCC unroll 1")
#endif

#ifdef __cplusplus
extern "C" {
#endif

/* Descriptors in an order: order[rank] is the index of one. */
typedef struct tvk_descriptors {
  const uint8_t *bytes;
  const uint16_t *order;
  int32_t num;
} tvk_descriptors;

#define TVK_NEAREST_LIST 7       /* groups in a list */
#define TVK_NEAREST_GROUP 4      /* columns of a group */
#define TVK_NEAREST_NONE 8388607 /* above every squared distance */

/* The groups nearest to a descriptor, in ascending order, each by its nearest member: twice its
   squared distance, TVK_NEAREST_NONE or more for unused entries, and its rank. A key that is odd is
   a bound for its bin: no group of the bin that is not listed is nearer. The groups of bins without
   an odd key that are not listed are not nearer than the last entry. */
typedef struct tvk_nearest {
  int32_t keys[TVK_NEAREST_LIST];
  uint16_t ranks[TVK_NEAREST_LIST];
} tvk_nearest;

/* The lists of 16 columns, an entry of each list after another: of the ranks r, r + 4, r + 8 ..,
   where r = 64 n + k and k < 4, in number 4 n + k. */
typedef struct tvk_nearest_lists {
  struct {
    int32_t keys[16];
    uint16_t ranks[16];
  } entries[TVK_NEAREST_LIST];
} tvk_nearest_lists;
#define TVK_NEAREST_LISTS(num_columns) (((num_columns) + 63) / 64 * 4)
/* Which of the tvk_nearest_lists, and which list of it, is that of the column of a rank. */
#define TVK_NEAREST_NUMBER(rank) (((rank) >> 6) * 4 + ((rank)&3))
#define TVK_NEAREST_LANE(rank) (((rank)&63) >> 2)

/* Group g of rows holds the ranks g n .. g n + n - 1, where n = row_group, and is in the bin g %
   row_bins. Groups of columns likewise, with TVK_NEAREST_GROUP and column_bins. */
typedef struct tvk_nearest_shape {
  int32_t row_group, row_bins, column_bins;
} tvk_nearest_shape;

#define TVK_CIRCLE_RADIUS 3   /* radius of the segment test's circle, in pixels */
#define TVK_HESSIAN_REACH 6   /* how far from its centre hessian_determinants reads, in pixels */
#define TVK_HESSIAN_PLACES 56 /* numbers that hessian_determinants writes for a centre */

#define TVK_PATCH_SIDE 16  /* samples along each side of a descriptor's patch: 15 gradients */
#define TVK_ORIENT_SIDE 12 /* samples along each side of the orientation's patch */
#define TVK_ORIENT_BINS 32
#define TVK_DESCRIPTOR_SIZE 128
#define TVK_QUANTIZED 8 /* descriptors that quantize_descriptors writes at a time, at most */

#define TVK_WINDOW_SIDE 8 /* samples along each side of a window of least-squares matching */
#define TVK_WINDOW_SAMPLES 64
#define TVK_WINDOW_CHANNELS 8
#define TVK_WINDOW_PRODUCTS 40
#define TVK_WINDOW_SUMS 9

/* Scratch of nearest_groups. It prepares up to TVK_NEAREST_PANEL columns at once, each of
   TVK_NEAREST_COLUMN_BYTES. The sets without products of bytes store 16-bit numbers and use the two
   _16 constants instead. */
#define TVK_NEAREST_PANEL 2048
#define TVK_NEAREST_COLUMN_BYTES 148
#define TVK_NEAREST_PANEL_16 512
#define TVK_NEAREST_COLUMN_16_BYTES 272
#define TVK_NEAREST_ROW_BYTES 832 /* scratch of one row; a chunk needs one row more */
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

#define TVK_MIX_ROWS 4           /* the rows that mix_rows adds up */
#define TVK_WIDTH 8              /* numbers side by side in the arrays of the kernels on doubles */
#define TVK_SCORE_BLOCK 32       /* matches in a block of sampson_score */
#define TVK_SCORE_ONE 65536      /* the cost of a match outside the threshold */
#define TVK_LARGEST_LOSS 16384.0 /* r^2 / scale^2 from which on Cauchy's loss is constant */
#define TVK_RELPOSE_MODELS 10    /* the most essential matrices that a sample of five has */
#define TVK_SAMPSON_SUMS 56      /* the number of sums of sampson_sums */
#define TVK_TRANSFER_SUMS 47     /* the number of sums of transfer_sums */

/* The pixels that average_columns reads for each new column, and their weights, which are at most
   255 and add up to 256. The arrays are filled for a multiple of 16 columns. */
typedef struct tvk_columns {
  int32_t *first;       /* for each eight columns, the pixel from which they pick */
  uint16_t *picks;      /* 0xff00 + which of the 16 pixels from there on is the column's first */
  uint16_t *weights[3]; /* of the column's first pixel and of the next two */
} tvk_columns;

struct tv_point;

/* A pair of pinhole cameras. focal, inverse_focal and principal hold x, y of camera 0, then x, y of
   camera 1, in pixels (inverse_focal: 1 / pixel). A point x0 of camera 0 is R x0 + baseline
   direction in camera 1, with |direction| = 1, and the centre of camera 1 is baseline center1 in
   camera 0. */
typedef struct tvk_triangulate_pair {
  double focal[4], inverse_focal[4], principal[4];
  double R[9], direction[3], center1[3], baseline;
  double
      parallel_sine_sq; /* rays are parallel if the squared sine of their angle is at most this */
} tvk_triangulate_pair;

/* The contract of each kernel.

   fast_score_row: rows[0..6] are the image rows y - 3 .. y + 3. Writes scores[x] for each x in [0,
   width): the largest threshold at which (x, y) is a corner, that is, has `arc` (9..12) contiguous
   brighter or darker pixels on its circle. Writes 0 where this is below `threshold` (>= 1), and in
   the 3 pixels at each end of the row.

   hessian_determinants: the determinant of the Hessian of the smoothed image at the 7 x 7 pixels
   around each of two centres, which may be equal: determinants[TVK_HESSIAN_PLACES n + 8 y + x], y
   and x in 0..6; those with x = 7 are unspecified. The 13 x 13 pixels around a centre
   (TVK_HESSIAN_REACH) are read, and no others. Smoothed: by (1 4
   6 4 1) along x and along y, divided by 16 and rounded. In units of these values the second
   derivatives are the products of (1 -2 1) along their axis and (1 2 1) across it, and the mixed
   one is that of (-1 0 1) along both.

   suppress_row: writes to xs, in ascending order, each x whose score in `cur` is above 0 and above
   the scores of all eight neighbours, and returns their number. The first and the last x are never
   written. xs has room for (width + 1) / 2.

   average_columns: sums[x] = the sum over k < 3 of weights[k][x] * row[first[x / 8] + (picks[x] &
   15) + k]. Up to 18 pixels from row[first[x / 8]] on are read. sums has room for out_width rounded
   up to a multiple of 16; the sums from out_width on are unspecified.

   average_rows: out[x] = (the sum of three rows, weighted by row_weights, + 2^15) >> 16. The
   weights are at most 255 and add up to 256, the rows are at most 65280, and width is at least 16.

   squeeze_row: out[u] = 256 times the mean of a row over the interval from begin + u step to begin
   + (u + 1) step, in 1 / 65536 of a pixel from the left edge of the row, rounded. A pixel's value
   holds over its whole width, the first and the last pixel's also beyond the row. step is in
   [65536, 4 * 65536], begin and all ends of intervals are within 2^47. sums: scratch for `width`
   numbers, which are unspecified afterwards.

   mix_rows: out[x] = (the sum of TVK_MIX_ROWS rows, weighted by `weights`, + 2^15) >> 16. The
   weights are in [0, 256] and add up to 256, and the rows are at most 65280.

   halve_row: out[x] = (a[2x] + a[2x+1] + b[2x] + b[2x+1] + 2) / 4.

   blur_row: the 3x3 binomial filter (1 2 1)/4 in both directions. Edge pixels are repeated, and the
   result is rounded once.

   pair_rows: pairs[x] = row[x] in the low byte and below[x] in the high byte, each less 128 in
   two's complement. pairs[width] = pairs[width - 1].

   sample_patch: writes num_rows rows of TVK_PATCH_SIDE bilinear samples, and one 0 after them. The
   image is one of pairs, width + 1 to a row, the last row paired with itself. Sample (i, j) lies at
   (x + i du_x - j du_y, y + i du_y + j du_x), all in 1/65536 pixel; positions are clamped to the
   image. A sample is the grey level less 128, in units of 256 / 127^2 grey level.

   orientation_histogram: `patch` is TVK_ORIENT_SIDE rows of an upright patch, of which
   TVK_ORIENT_SIDE samples each count. Writes the histogram of the gradients within 6 samples of the
   centre, with a Gaussian weight of sigma 2 samples, in TVK_ORIENT_BINS directions, clockwise in
   the image from x, smoothed around the circle: bin k to histogram[1 + k], and to histogram[0] and
   histogram[TVK_ORIENT_BINS + 1] the last and the first bin. Writes to peaks[0] the highest bin,
   and to peaks[1] the highest of the other bins that are above both neighbours, or -1 if there is
   none. Of equal bins the first is taken.

   gradient_histogram: SIFT's 4x4x8 histogram, with Gaussian weights, of a patch of TVK_PATCH_SIDE
   rows, or the mean of the histograms of num_patches = 2 patches that follow each other. One number
   is read after the last patch, and has no effect. A gradient is shared bilinearly between cells,
   and between two directions by decomposition (kernels/describe.h).

   quantize_descriptors: writes the 128 bytes of each of 1 to TVK_QUANTIZED histograms by SIFT's
   normalisation with clipping at 0.2, or by RootSIFT's if `root` is not 0.

   window_template: samples the window that stays, TVK_WINDOW_SIDE samples on a side and one more
   around it, and writes its channels and their products. Sample (i, j) of the 10 x 10 lies at (x +
   i step, y + j step), in 1/65536 pixel, and is 127^2 / 1024 (grey level - 127.5), rounded down.
   The channels of the inner 8 x 8 samples S are, with the slopes gx and gy (the next sample less
   the one before), u = 2 i - 7 and v = 2 j - 7: the constant 4096, S, gx, gy, gx u / 8, gx v / 8,
   gy u / 8 and gy v / 8. channels[64 p + 8 j + i] is channel p times the Gaussian weight of sigma
   2.6 samples, rounded. products holds for p = 0 .. 7 and q = 0 .. p the sum of the weighted
   channel p times channel q, row by row, then that of the weighted constant times S, then three
   zeros. step is 1 to 1.5 pixels. Every sample lies at least a pixel within the image, which is at
   least 16 pixels wide.

   window_sums: samples the window that moves, (i, j) at (x + i map[0] + j map[1], y + i map[2] + j
   map[3]), in the same units, and writes to sums[p] the sum of the weighted channel p times the
   samples, and to sums[8] the weighted sum of their squares. Every sample lies at least a pixel
   within the image, and the products of `stride` and their vertical distances fit 32 bits.

   nearest_groups: of_rows[i] lists the groups of columns that are nearest to row i, an index, and
   of_columns, of TVK_NEAREST_LISTS(columns->num), the groups of rows that are nearest to each
   column. The groups and bins are returned; they depend on the set. scratch has
   TVK_NEAREST_SCRATCH(rows->num, columns->num) bytes, is aligned to 64, and holds unspecified
   values afterwards.

   squared_distances: out[k] = the squared distance of the query and rows[indices[k]].

   The kernels on matches (geometry/ray_pairs.h) read `arrays`: the rays of view 0 and of view 1 (3
   and 3) and their slopes d ray / d pixel (6 and 6, row-major 3x2). If on_plane is not 0, all rays
   have z = 1 and the last rows of the slopes are 0, and these are not read. m is the matrix of a
   model, row-major. Match k is indices[k], or first + k if indices is null or no parameter.

   sampson_squares: squares[k] = r^2, the squared Sampson distance; infinite where it is not a
   number.

   pose_squares: the same for a pose of 21 numbers: the essential matrix E, then R and t. Also
   infinite where the point of the match is behind a camera by more than the angle scale *
   arrays[18][k] (depth_vote in geometry/essential.h).

   transfer_squares: squares[k] = r^2, the squared transfer residual of a homography.

   sampson_sums: adds match k's term of sum n to sums[TVK_WIDTH n + k % TVK_WIDTH]. With g = dr/dm
   (9 entries) and w the weight of the loss, the sums are those of w g g' (45, the upper triangle
   row by row), of w g r (9) and of the truncated loss (r^2 / scale^2, at most 1). The last one is
   not a sum but the product of Cauchy's 1 + r^2 / scale^2. `cauchy` selects the loss; the entry of
   the other loss does not change.

   transfer_sums: the same for the transfer residual. In place of w g g' it adds the 36 products of
   the upper triangles of w S' W S and of f0 f0', where S = d d / d (H f0), d is the displacement
   and W the weight of the residual (kernels/transfer.h).

   sampson_score: the sum of min(r^2 / T^2, 1) TVK_SCORE_ONE, each term truncated to an integer,
   over the blocks first_block .. first_block + num_blocks - 1 of TVK_SCORE_BLOCK matches. The
   arrays are in single precision: on the plane x0 y0 x1 y1 and the upper triangles of J J' of view
   0 and of view 1 (3 and 3), else all 18.

   relpose_5pt: rays[TVK_WIDTH (6 k + 3 view + c) + s] is entry c of the k-th ray of sample s in a
   view. The first num_samples of the TVK_WIDTH samples are solved; the rays of the others must be
   finite. For sample s, writes counts[s] essential matrices, row-major, of Frobenius norm 1, to
   essentials + 9 TVK_RELPOSE_MODELS s: those for which the five matches satisfy the oriented
   epipolar constraint (same_side in kernels/relpose_5pt.h). counts[s] is 0 for a degenerate sample.
   The entries after these matrices are unspecified.

   triangulate: the points of `count` matches of two pinholes by Midpoint, Linear-LS or Iterative-LS
   (`method`, a tv_triangulation). A pixel is two numbers, x and y. A match whose point is neither
   TV_POINT_OK nor TV_POINT_BEHIND, or that needs more care, gets status -1 and zeros; the caller
   solves it by triangulation/triangulation.cc. Returns whether there is such a match. */
#define TVK_DETECT_LIST(X)                                                                       \
  X(fast_score_row, void,                                                                        \
    (const uint8_t *const rows[7], int32_t width, int32_t arc, int32_t threshold,                \
     uint8_t *scores))                                                                           \
  X(hessian_determinants, void,                                                                  \
    (const uint8_t *const centres[2], int64_t stride, int32_t *determinants))                    \
  X(suppress_row, int32_t,                                                                       \
    (const uint8_t *prev, const uint8_t *cur, const uint8_t *next, int32_t width, uint16_t *xs)) \
  X(average_columns, void,                                                                       \
    (const uint8_t *row, const tvk_columns *columns, int32_t out_width, uint16_t *sums))         \
  X(average_rows, void,                                                                          \
    (const uint16_t *const rows[3], const int32_t row_weights[3], int32_t width, uint8_t *out))  \
  X(halve_row, void, (const uint8_t *a, const uint8_t *b, int32_t out_width, uint8_t *out))

#define TVK_SQUEEZE_LIST(X)                                                                        \
  X(squeeze_row, void,                                                                             \
    (const uint8_t *row, int32_t width, int64_t begin, int32_t step, int32_t out_width,            \
     uint32_t *sums, uint16_t *out))                                                               \
  X(mix_rows, void,                                                                                \
    (const uint16_t *const rows[TVK_MIX_ROWS], const int32_t weights[TVK_MIX_ROWS], int32_t width, \
     uint8_t *out))

#define TVK_DESCRIBE_LIST(X)                                                                       \
  X(blur_row, void,                                                                                \
    (const uint8_t *above, const uint8_t *row, const uint8_t *below, int32_t width, uint8_t *out)) \
  X(pair_rows, void, (const uint8_t *row, const uint8_t *below, int32_t width, uint16_t *pairs))   \
  X(sample_patch, void,                                                                            \
    (const uint16_t *pairs, int32_t width, int32_t height, int32_t x, int32_t y, int32_t du_x,     \
     int32_t du_y, int32_t num_rows, int16_t *patch))                                              \
  X(orientation_histogram, void, (const int16_t *patch, int32_t *histogram, int32_t peaks[2]))     \
  X(gradient_histogram, void, (const int16_t *patches, int32_t num_patches, int32_t *histogram))   \
  X(quantize_descriptors, void,                                                                    \
    (const int32_t *histograms, int32_t count, int32_t root, uint8_t *descriptors))

#define TVK_ALIGN_LIST(X)                                                                      \
  X(window_template, void,                                                                     \
    (const uint8_t *pixels, int64_t stride, int32_t width, int32_t x, int32_t y, int32_t step, \
     int16_t *channels, int32_t *products))                                                    \
  X(window_sums, void,                                                                         \
    (const uint8_t *pixels, int64_t stride, int32_t x, int32_t y, const int32_t map[4],        \
     const int16_t *channels, int32_t *sums))

#define TVK_MATCH_LIST(X)                                                              \
  X(nearest_groups, tvk_nearest_shape,                                                 \
    (const tvk_descriptors *rows, const tvk_descriptors *columns, void *scratch,       \
     tvk_nearest_lists *of_columns, tvk_nearest *of_rows))                             \
  X(squared_distances, void,                                                           \
    (const uint8_t *query, const uint8_t *rows, const int32_t *indices, int32_t count, \
     int32_t *out))

/* The kernels on matches. They are in files of their own (lanes_*.c), so that a set may use another
   set's. */
#define TVK_GEOMETRY_LIST(X)                                                                \
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

/* The parts that the kernels belong to, each with a table of its own, so that a linker that drops
   unused sections (--gc-sections) leaves out those of the parts that a program does not call. */
#define TVK_PIXEL_PARTS(X)       \
  X(detect, TVK_DETECT_LIST)     \
  X(squeeze, TVK_SQUEEZE_LIST)   \
  X(describe, TVK_DESCRIBE_LIST) \
  X(align, TVK_ALIGN_LIST)       \
  X(match, TVK_MATCH_LIST)
#define TVK_PARTS(X) TVK_PIXEL_PARTS(X) X(geometry, TVK_GEOMETRY_LIST)
/* All their kernels. */
#define TVK_LIST(X)  \
  TVK_DETECT_LIST(X) \
  TVK_SQUEEZE_LIST(X) TVK_DESCRIBE_LIST(X) TVK_ALIGN_LIST(X) TVK_MATCH_LIST(X) TVK_GEOMETRY_LIST(X)

/* A kernel set that this build has and this CPU can run. */
typedef struct tvk_set {
  int32_t id;    /* its tv_kernels value */
  int32_t index; /* of its tables among those of this build */
} tvk_set;

/* The table of each part: tvk_detect_of returns that of the kernels for tv_detect, and so on. */
#define TVK_MEMBER(name, result, parameters) result(*name) parameters;
#define TVK_DECLARE_PART(part, LIST)  \
  typedef struct tvk_##part##_table { \
    LIST(TVK_MEMBER)                  \
  } tvk_##part##_table;               \
  const tvk_##part##_table *tvk_##part##_of(const tvk_set *set);
TVK_PARTS(TVK_DECLARE_PART)
#undef TVK_DECLARE_PART
#undef TVK_MEMBER

/* The sets that this build has and this CPU can run, for n = 0, 1, .. in order from the C set to
   the fastest, then null. The NEON set is there twice on CPUs with ARMv8.2's dot product: without
   it, then with it. */
const tvk_set *tvk_nth(int32_t n);

/* The fastest set of the value `id` (a tv_kernels), or of all sets for TV_KERNELS_AUTO. Null if
   this build or this CPU has none. */
const tvk_set *tvk_select(int32_t id);

#ifdef __cplusplus
}
#endif

#endif
