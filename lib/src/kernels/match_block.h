/* Blocks of TVK_LANES matches: loading them, and adding up their loss. */
#ifndef TWOVIEW_KERNELS_MATCH_BLOCK_H
#define TWOVIEW_KERNELS_MATCH_BLOCK_H

#include "kernels/lanes.h"

/* The rays f0, f1 and their slopes J = d ray / d pixel (row-major 3x2) of TVK_LANES matches. */
typedef struct sampson_block {
  lanes f0[3], f1[3], J0[6], J1[6];
} sampson_block;

/* Single loads, which are quicker than AVX-512's gathers on Zen 4: 1 per cent of a pair. */
static inline lanes gather_lanes(const double *array, const int32_t index[TVK_LANES]) {
#if defined(TVK_AVX512)
  return (lanes){array[index[0]], array[index[1]], array[index[2]], array[index[3]],
                 array[index[4]], array[index[5]], array[index[6]], array[index[7]]};
#elif defined(TVK_AVX2)
  return (lanes){array[index[0]], array[index[1]], array[index[2]], array[index[3]]};
#else
  return (lanes){array[index[0]], array[index[1]]};
#endif
}

/* Elements index[0 ..] of the array, or its elements from `first` on if index is null. */
static inline lanes load_lanes(const double *array, const int32_t *index, int32_t first) {
  return index ? gather_lanes(array, index) : lanes_load(array + first);
}

static TVK_INLINE void load_arrays(const double *const *arrays, const int32_t *index, int32_t first,
                                   int on_plane, sampson_block *b) {
  /* How many entries of a ray and of a Jacobian are not constant. */
  const int rays = on_plane ? 2 : 3, slopes = on_plane ? 4 : 6;
  int k;
  for (k = 0; k < rays; ++k) {
    b->f0[k] = load_lanes(arrays[k], index, first);
    b->f1[k] = load_lanes(arrays[3 + k], index, first);
  }
  for (k = 0; k < slopes; ++k) {
    b->J0[k] = load_lanes(arrays[6 + k], index, first);
    b->J1[k] = load_lanes(arrays[12 + k], index, first);
  }
}

/* Loads the `count` matches indices[0 ..], or first, first + 1, .. if indices is null. The
   remaining lanes repeat the first match. */
static TVK_INLINE void load_block(const double *const *arrays, const int32_t *indices,
                                  int32_t first, int32_t count, int on_plane, sampson_block *b) {
  int32_t some[TVK_LANES];
  int l;
  if (count == TVK_LANES && !indices) {
    load_arrays(arrays, NULL, first, on_plane, b);
    return;
  }
  if (count < TVK_LANES) {
    for (l = 0; l < TVK_LANES; ++l) {
      const int32_t k = l < count ? l : 0;
      some[l] = indices ? indices[k] : first + k;
    }
    indices = some;
  }
  load_arrays(arrays, indices, 0, on_plane, b);
}

/* Loads `count` numbers; the remaining lanes are 0. */
static TVK_INLINE lanes load_first(const double *from, int32_t count) {
  lanes x = {0};
  int32_t l;
  if (count == TVK_LANES) return lanes_load(from);
  for (l = 0; l < count; ++l) x[l] = from[l];
  return x;
}

static TVK_INLINE void store_first(double *to, lanes x, int32_t count) {
  int32_t l;
  if (count == TVK_LANES) {
    lanes_store(to, x);
  } else {
    for (l = 0; l < count; ++l) to[l] = x[l];
  }
}

/* Adds the loss of the first `count` lanes at q = r^2 / scale^2. `sums` points to the entry of the
   truncated loss; the entry of Cauchy's product follows it. Writes the weights of the loss and
   returns the mask of the lanes where the loss is not constant. */
static inline lane_mask add_loss(lanes q, int32_t count, int cauchy, double *sums, lanes *weight) {
  lanes number = {0};
  lane_mask used, ok;
  int l;
  for (l = 0; l < TVK_LANES; ++l) number[l] = l;
  used = number < (double)count;
  if (cauchy) {
    double *product = sums + TVK_WIDTH;
    const lanes beyond = lanes_select(used, lanes_of(TVK_LARGEST_LOSS), lanes_of(1));
    ok = used & (q < TVK_LARGEST_LOSS);
    *weight = lanes_keep(ok, 1.0 / (1.0 + q));
    lanes_store(product, lanes_load(product) * lanes_select(ok, 1.0 + q, beyond));
  } else {
    ok = used & (q < 1.0);
    *weight = lanes_keep(ok, lanes_of(1));
    lanes_store(sums, lanes_load(sums) + lanes_select(ok, q, lanes_keep(used, lanes_of(1))));
  }
  return ok;
}

#endif
