/* twoview: which descriptors belong together.

   Ratio test: D. G. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004, 7.1. Formulas
   and tests: docs/algorithms/match.md. */
#ifndef TWOVIEW_MATCH_H
#define TWOVIEW_MATCH_H

#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/feature.h"

TV_BEGIN_DECLS

/* A row of one image's descriptors and the row of the other's that it belongs to. */
typedef struct tv_correspondence {
  int32_t idx0, idx1; /* rows of descriptors0 and descriptors1 */
  uint32_t dist_sq;   /* squared L2 distance of the two */
  float ratio;        /* distance to the nearest / to the second nearest, the worse of the two
                         directions; [0, 1], lower is more certain */
} tv_correspondence;

/* Filled by tv_match_options_init. */
typedef struct tv_match_options {
  uint32_t struct_size; /* set by tv_match_options_init */
  float ratio;          /* keep where ratio < this in both directions, (0, 1], default 0.92;
                           1 keeps ties out only */
} tv_match_options;

/* Writes the defaults, and struct_size; null is allowed. */
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

/* Filled by tv_guided_options_init. */
typedef struct tv_guided_options {
  uint32_t struct_size;   /* set by tv_guided_options_init */
  float max_error_px;     /* half the width of the band along an epipolar line: Sampson distance in
                             pixels of the images as given, [0.01, 1000], default 4; a narrow one holds
                             the next estimate to the first */
  float ratio;            /* keep where the ratio < this, (0, 1], default 0.87 */
  float max_distance;     /* L2 distance of descriptors that counts as a rival where the band holds no
                             other, (0, 3000], default 180: true matches lie below it nineteen times
                             out of twenty */
  float neighbourhood_px; /* keypoints this near the nearest one are no rivals of it: the same
                             corner's second orientation, the same edge's next corner; [0, 1000],
                             default 4 */
} tv_guided_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tv_guided_options_init(tv_guided_options *options);

/* A second matching pass: the nearest neighbour among the keypoints within a band along the epipolar
   line, each the other's nearest. There are few rivals in a band, so that matches pass which the
   ratio test over the whole image drops. `ratio` of the result is the distance over the smaller of
   max_distance and the distance to the nearest rival in the band, the worse of the two directions.
   Equal distances count the lower index as nearer.
   camera0, camera1, epipolar: both cameras and E (tv_two_view.E; of any lens: the band is measured in
   pixels of the images as given), or no cameras and F of the pixels. epipolar: row-major 3x3, finite.
   Swapped views with the transposed matrix give the same pairs, swapped.
   A keypoint outside its lens's valid region is not matched.
   keypoints, descriptors: num of each, num in [0, context's max_keypoints]; keypoints are checked as
   tv_describe checks them, all of their fields. options may be null.
   correspondences: the caller's array, in ascending order of idx0; capacity of min(num0, num1) is always
   enough.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS, TV_ERR_CAMERA,
   TV_ERR_NOT_FINITE, TV_ERR_CAPACITY (*num_correspondences then is how many there are),
   TV_ERR_OVERLAP.
   Time: num0 * num1 products of three numbers, and 128 multiply-adds for each pair in the band,
   at most twice. */
TV_API tv_status tv_match_guided(tv_context *context, const tv_camera *camera0,
                                 const tv_camera *camera1, const double epipolar[9],
                                 const tv_keypoint *keypoints0, const uint8_t *descriptors0,
                                 int32_t num0, const tv_keypoint *keypoints1,
                                 const uint8_t *descriptors1, int32_t num1,
                                 const tv_guided_options *options,
                                 tv_correspondence *correspondences, int32_t cap_correspondences,
                                 int32_t *num_correspondences);

TV_END_DECLS

#endif
