/* The kernels of the dense cloud: a list and a table of their own, because nothing else uses them,
   and a build without the dense cloud does not have them. What kernels.h says of its kernels holds
   for these, too. */
#ifndef TWOVIEW_KERNELS_DENSE_H
#define TWOVIEW_KERNELS_DENSE_H

#include <stdint.h>

#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  TVK_DENSE_BLOCK = 32,       /* steps in a block of costs; lines have whole blocks */
  TVK_DENSE_CENSUS_REACH = 2, /* pixels around the middle of the census window */
  TVK_DENSE_PATHS = 3,
  TVK_DENSE_SMALL = 4,    /* the cost of a change of parallax by one step along a path */
  TVK_DENSE_LARGE = 32,   /* of a change by more, where the image has no edge */
  TVK_DENSE_NEVER = 200,  /* above every cost of a path */
  TVK_DENSE_REACH = 3,    /* cells around the middle of a window of least squares */
  TVK_DENSE_SUMS = 10,    /* of such a window */
  TVK_DENSE_NODES = 8,    /* columns between two at which the lens is evaluated */
  TVK_DENSE_SPAN = 16,    /* columns of a block of cells */
  TVK_DENSE_STRETCH = 64, /* columns whose windows are taken together: whole blocks */
  TVK_SWEEP_ACROSS = 4,   /* pixels of the map around the middle of a census of words */
  TVK_SWEEP_DOWN = 3,
  TVK_SWEEP_BITS = 31,  /* of such a census */
  TVK_SWEEP_CHANCE = 15 /* the cost of a plane at a place that no view shows, as chance gives it */
};

/* A census that stands for no pixel. The highest bit of any other is 0. */
#define TVK_SWEEP_NONE 0xffffffffu

/* A view, and where the planes put a row of the map in it: column x at the element scale x + shift,
   rounded down, at most `last`, behind element `row`. The elements at the edges have no census. */
typedef struct tvk_swept_view {
  const uint32_t *census;
  const float *scale, *shift; /* of each plane */
  const int32_t *row;
  int32_t last, reserved;
} tvk_swept_view;

/* A row of the map and what four paths bring: along it, and from the row before. */
typedef struct tvk_swept_row {
  int32_t width, count; /* count: planes, a multiple of TVK_DENSE_BLOCK */
  int32_t step;         /* 1: the paths go to larger columns and rows, -1: to smaller ones */
  int32_t reserved;
  const uint8_t *costs;     /* count for each column */
  uint8_t *kept;            /* the same: sums of paths, to which those of these four are added */
  const uint8_t *across;    /* as of tvk_dense_row, with an entry behind the last column */
  const uint8_t *large[3];  /* of each column, from the columns x - 1, x, x + 1 of the row before */
  const uint8_t *before[3]; /* path costs of that row, count for each column */
  uint8_t *after[3];        /* and those of this row */
  const uint8_t *least_before[3]; /* of each column, the least of them */
  uint8_t *least_after[3];
  uint8_t *scratch; /* 2 count */
} tvk_swept_row;

/* The pixels of TVK_DENSE_NODES columns of a row, as polynomials of the column; none if the lens
   model is not smooth there. */
typedef struct tvk_dense_span {
  double at[4][2];             /* coefficients of u and v; 0 where it is not smooth */
  int32_t is_smooth, reserved; /* 0 or 1 */
} tvk_dense_span;

/* Rows of cells around a row y, of `width` columns with TVK_DENSE_REACH more before and behind
   them: n = 0 .. 2 TVK_DENSE_REACH are the rows from y - TVK_DENSE_REACH on, the last is the row
   that the window of row y - 1 had before them. a: image 0; b: image 1 moved by the steps; g: four
   times the mean slope of both; all 0 where a cell has no step, and `is_cell` 1 where it has one.
 */
typedef struct tvk_dense_rows {
  const uint8_t *a[2 * TVK_DENSE_REACH + 2], *b[2 * TVK_DENSE_REACH + 2];
  const int16_t *g[2 * TVK_DENSE_REACH + 2];
  const uint8_t *is_cell[2 * TVK_DENSE_REACH + 2];
} tvk_dense_rows;

/* The numbers with which fit_cells weighs. */
typedef struct tvk_dense_model {
  float gain_prior; /* variance of a window, squared grey levels, at which its gain counts half */
  float excess_sq;  /* by which the variance of the residuals is multiplied */
  float noise_sq;   /* the least variance of the residuals, squared grey levels */
  float step_info;  /* 1 / the variance of a mean step, without any texture, squared steps */
  float floor_sq;   /* the least variance of a result, squared steps */
} tvk_dense_model;

/* One row of the two images, which correspond, and what the paths from above brought. Step k of
   parallax is what moves column x of image 0 to column x + k of image 1. */
typedef struct tvk_dense_row {
  int32_t width, num_steps; /* num_steps: a multiple of TVK_DENSE_BLOCK */
  const uint8_t *brighter0, *darker0, *brighter1, *darker1; /* what census_codes wrote */
  const uint8_t *grey0;  /* 0: the pixel is outside the image that it came from */
  const uint8_t *large;  /* of each column, the cost of a large change from above */
  const uint8_t *across; /* of each column x, the same between x - 1 and x */
  uint8_t *costs;        /* num_steps for each column */
  uint8_t *sums;         /* the same: the path costs added up */
  uint8_t *above;        /* the same: the path costs of the row above, then those of this row */
  uint8_t *least;        /* of each column, the least of them, likewise */
  uint8_t *scratch;      /* 3 num_steps */
} tvk_dense_row;

/* The contract of each kernel. Rows of cells are read and written in whole blocks, of
   TVK_DENSE_BLOCK in the kernels of the matching and of TVK_DENSE_SPAN in the others, up to two
   entries before them, and four behind the last block: arrays have room for that, and what is
   written behind `width` is without meaning.

   census_codes: rows[0..4] are the rows y - 2 .. y + 2 of an image. Of each of 8 pairs of opposite
   pixels around a pixel, one bit of `brighter` says whether the first is brighter than the second
   by more than `tolerance`, and one of `darker` whether it is darker by more. Pixels that are 0,
   which are outside their image, have all bits of `brighter`, so that half of the bits differ from
   those of any other; the two columns at both ends have none.

   edge_costs: of each column, the cost of a large change between the pixel and the one above, and
   the one on its left: TVK_DENSE_LARGE less their difference, at least TVK_DENSE_SMALL.

   sum_ahead: writes the costs of each column's steps, the number of bits in which the codes differ,
   0 where grey0 is 0; continues the path from above, and writes the sums of its costs and of those
   of the path from the left to `sums`.

   choose_steps: adds the path from the right to `sums`. Of each column, the step of the least sum,
   the first of several; that sum; and how much more the least sum of any step has that is not its
   neighbour. least1: for each column of image 1, of which there are width + num_steps - 1, the
   least sum of the steps that lead there. A column whose grey0 is 0 has zeros, and does not count
   in least1.

   support_row: rows[0..6] are rows of steps, -1 where there is none, y - 3 .. y + 3, of `width`
   columns with TVK_DENSE_REACH more before and behind them. How many of a column's 5 x 5
   neighbours, itself included, have the same step to within one; how many of its 7 x 7 neighbours;
   and the sum of the differences to it of the latter.

   cell_columns: of the cells in the rows of a window of 7 rows, with a, b and g of tvk_dense_rows,
   the sums over each column of a, b, g, aa, bb, gg, ab, ag, bg, and their number, in this order,
   each in an array of `pitch`, a multiple of TVK_DENSE_SPAN that holds the width and its frame, and
   TVK_DENSE_SPAN entries more: from those of the row above unless `first`.

   cell_sums: the same sums over windows of 7 x 7, whose first columns are `columns`, each in an
   array of TVK_DENSE_STRETCH.

   fit_cells: from these sums, what support_row wrote and the steps, writes the parallax of each
   column in steps, its standard deviation, and 255 times the correlation of the windows, at least 1
   (dense/fraction.h); both windows count as having `gain_prior`
   more variance that is alike, and those that would have to move by more than a step as unlike.

   smooth_row: rows[0..2] are the rows y - 1 .. y + 1; the mean of 3 x 3 pixels with the weights 1 2
   1 along both axes, rounded, at least 1. 0 where the pixel is 0, and the pixel itself in the first
   and the last column.

   place_row: the polynomials of each span at 0 .. TVK_DENSE_NODES - 1, in units of 1/65536 pixel of
   an image that is `scale` times as large: (p + 0.5) scale - 0.5. u is -1 where that is not in the
   image, and where the span is not smooth.

   sample_row: the grey level of an image at each of `count` such places, by bilinear interpolation,
   at least 1; 0 where u is negative.

   census_words: rows[0..6] are every second row of a view, from 2 TVK_SWEEP_DOWN above to as many
   below. The census of each element, whose window has every second element: whether of each pair of
   opposite ones the upper or left one is darker. TVK_SWEEP_NONE where the window is not wholly
   inside, which is where the element or a corner is 0.

   plane_costs: of each column x, whose census is census[2 x], and each plane, the mean number of
   bits in which the census differs from those of the views that have one there, without the worst
   of several; 0 where the column has no census.

   sum_planes: follows the paths, and adds their sums, less the least of the column, to `kept`, up
   to 255.

   choose_planes: of each column, the plane of the least sum, the first of several, and how much
   more the least sum of any plane has that is more than two away. */
#define TVK_DENSE_LIST(X)                                                                         \
  X(census_codes, void,                                                                           \
    (const uint8_t *const *rows, int32_t width, int32_t tolerance, uint8_t *brighter,             \
     uint8_t *darker))                                                                            \
  X(edge_costs, void,                                                                             \
    (const uint8_t *row, const uint8_t *above, int32_t width, uint8_t *large, uint8_t *across))   \
  X(sum_ahead, void, (const tvk_dense_row *row))                                                  \
  X(choose_steps, void,                                                                           \
    (const tvk_dense_row *row, int16_t *steps, uint8_t *least, uint8_t *margin, uint8_t *least1)) \
  X(support_row, void,                                                                            \
    (const int16_t *const *rows, int32_t width, uint8_t *support, uint8_t *alike, int8_t *slant)) \
  X(cell_columns, void,                                                                           \
    (const tvk_dense_rows *rows, int32_t pitch, int32_t first, int32_t *columns))                 \
  X(cell_sums, void, (const int32_t *columns, int32_t pitch, int32_t *sums))                      \
  X(fit_cells, void,                                                                              \
    (const int32_t *sums, const int16_t *steps, const uint8_t *alike, const int8_t *slant,        \
     const tvk_dense_model *model, float *parallax, float *sigma, uint8_t *similarity))           \
  X(smooth_row, void, (const uint8_t *const *rows, int32_t width, uint8_t *out))                  \
  X(place_row, void,                                                                              \
    (const tvk_dense_span *spans, int32_t num_spans, double scale, int32_t width, int32_t height, \
     int32_t *u, int32_t *v))                                                                     \
  X(sample_row, void,                                                                             \
    (const uint8_t *image, int32_t width, int32_t height, int64_t stride, const int32_t *u,       \
     const int32_t *v, int32_t count, uint8_t *out))                                              \
  X(census_words, void, (const uint8_t *const *rows, int32_t width, uint32_t *census))            \
  X(plane_costs, void,                                                                            \
    (const tvk_swept_view *views, int32_t num_views, const uint32_t *census, int32_t width,       \
     int32_t count, uint8_t *costs))                                                              \
  X(sum_planes, void, (const tvk_swept_row *row))                                                 \
  X(choose_planes, void,                                                                          \
    (const uint8_t *sums, int32_t width, int32_t count, int16_t *planes, uint8_t *margin))

typedef struct tvk_dense_table {
#define TVK_MEMBER(name, result, parameters) result(*name) parameters;
  TVK_DENSE_LIST(TVK_MEMBER)
#undef TVK_MEMBER
} tvk_dense_table;

/* Those of a set. */
const tvk_dense_table *tvk_dense_of(const tvk_set *set);

#ifdef __cplusplus
}
#endif

#endif
