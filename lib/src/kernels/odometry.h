/* The kernels of the odometry: a list and a table of their own, because nothing else uses them, and
   a build without the odometry does not have them. What kernels.h says of its kernels holds for
   these, too. */
#ifndef TWOVIEW_KERNELS_ODOMETRY_H
#define TWOVIEW_KERNELS_ODOMETRY_H

#include <stdint.h>

#include "kernels/kernels.h"

#ifdef __cplusplus
extern "C" {
#endif

enum {
  TVK_SIGHTING_BLOCK = 32,  /* matches of a call of sighting_costs */
  TVK_SIGHTING_COST = 65536 /* of a match outside the threshold */
};

/* The matrix of blocks, the diagonal that it has without the points, and the gradient: 6 entries of
   these two for each block. */
typedef struct tvk_reduced_system {
  double *entries, *diagonal, *gradient;
} tvk_reduced_system;

/* The contract of each kernel.

   sighting_costs: the sum of the costs of TVK_SIGHTING_BLOCK matches from `first` on, whose numbers
   are in twelve arrays: the point X, the two rows of J and a (pose/sightings.h). pose: R,
   row-major, and t. With p = R X + t, a match costs TVK_SIGHTING_COST times |J p|^2 inverse_sq /
   (a . p)^2, rounded down, where that is less than 1 and a . p > 0, and otherwise times 1.

   subtract_products: of a symmetric matrix whose lower triangle is stored as in
   adjust/block_cholesky.h, subtracts Z_a Z_b' from the 6x6 blocks (blocks[a], blocks[b]) for all
   a and all b <= a, where blocks ascends. Z_a is 6x3; its columns are at columns + 6 a, `pitch`
   entries apart. The three products are added first, so that each entry changes once.

   add_observation: adds the terms of an observation of a window (adjust/window_observation.h) to
   those of its point, and, if `block` is not negative, to those of its view. observation: J (2x3,
   column-major), then n; R: cam_from_world, row-major; linear: the nine numbers of a
   tv::LinearObservation. The derivatives of the residual e by x are h = (J - e n') / depth; half
   the gradient by x is q = weight h'e; then h becomes root (h - along e (e'h)), and Jp = h R. sums:
   the 6 entries of the upper triangle of Jp'Jp, by rows, and the 3 of R'q. With the rows
   a = (x cross h0, h0) and b = (x cross h1, h1), a'a + b'b is added to the block of the diagonal
   and its own diagonal to `diagonal`, (x cross q, q) to the gradient, and Jp0i a + Jp1i b to the
   columns i = 0, 1, 2, which are `pitch` entries apart. */
#define TVK_ODOMETRY_LIST(X)                                                                     \
  X(sighting_costs, int32_t,                                                                     \
    (const float *const *arrays, int32_t first, const float *pose, float inverse_sq))            \
  X(subtract_products, void,                                                                     \
    (double *entries, const double *columns, int32_t pitch, const int32_t *blocks, int32_t num)) \
  X(add_observation, void,                                                                       \
    (const double *observation, const double *R, const double *linear, double *sums,             \
     const tvk_reduced_system *system, int32_t block, double *columns, int32_t pitch))

typedef struct tvk_odometry_table {
#define TVK_MEMBER(name, result, parameters) result(*name) parameters;
  TVK_ODOMETRY_LIST(TVK_MEMBER)
#undef TVK_MEMBER
} tvk_odometry_table;

/* Those of a set. */
const tvk_odometry_table *tvk_odometry_of(const tvk_set *set);

#ifdef __cplusplus
}
#endif

#endif
