/* twoview: which descriptors belong together. */
#ifndef TWOVIEW_MATCH_H
#define TWOVIEW_MATCH_H

#include "twoview/context.h"
#include "twoview/feature.h"

TV_BEGIN_DECLS

typedef struct tv_correspondence {
  int32_t idx0, idx1; /* rows of descriptors0 and descriptors1 */
  uint32_t dist_sq;   /* squared L2 distance of the two */
  float ratio;        /* distance to the nearest / to the second nearest, the worse of the two
                         directions; [0, 1], lower is more certain */
} tv_correspondence;

/* Filled by tv_match_options_init. */
typedef struct tv_match_options {
  uint32_t struct_size; /* set by tv_match_options_init */
  float ratio;          /* keep where ratio < this in both directions, (0, 1], default 0.87;
                           1 keeps ties out only */
} tv_match_options;

TV_API void tv_match_options_init(tv_match_options *options);

/* Exact two nearest neighbours in both directions; a pair is kept when each is the other's nearest
   and both pass the ratio test. Equal distances count the lower index as nearer. Swapped inputs give
   the same pairs, swapped. The result is in ascending order of idx0.
   descriptors0/1: num x TV_DESCRIPTOR_BYTES, num in [0, context's max_keypoints].
   correspondences: the caller's array; capacity of min(num0, num1) is always enough.
   *num_correspondences: how many were written; on TV_ERR_CAPACITY how many there are.
   A side with one descriptor only has no second neighbour: the ratio test cannot pass.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS, TV_ERR_CAPACITY,
   TV_ERR_OVERLAP.
   Time: num0 * num1 * 128 multiply-adds. */
TV_API tv_status tv_match(tv_context *context, const uint8_t *descriptors0, int32_t num0,
                          const uint8_t *descriptors1, int32_t num1,
                          const tv_match_options *options, tv_correspondence *correspondences,
                          int32_t cap_correspondences, int32_t *num_correspondences);

TV_END_DECLS

#endif
