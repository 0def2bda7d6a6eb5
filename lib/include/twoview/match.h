/* twoview: which descriptors of two images belong together.

   Ratio test: D. G. Lowe, "Distinctive image features from scale-invariant keypoints", IJCV 2004,
   7.1. Formulas and tests: docs/algorithms/match.md. */
#ifndef TWOVIEW_MATCH_H
#define TWOVIEW_MATCH_H

#include "twoview/camera.h"
#include "twoview/context.h"
#include "twoview/feature.h"

TV_BEGIN_DECLS

/* A match: a feature of image 0 and the feature of image 1 that it belongs to. */
typedef struct tv_correspondence {
  /* Indices of the feature in image 0 and in image 1. */
  int32_t idx0, idx1;
  /* The squared L2 distance of the two descriptors. */
  uint32_t dist_sq;
  /* The distance to the nearest descriptor over the distance to the second nearest, the larger of
     the two directions; [0, 1]. The lower it is, the more certain is the match. */
  float ratio;
} tv_correspondence;

/* Options of tv_match. Filled by tv_match_options_init. */
typedef struct tv_match_options {
  /* The caller's sizeof, set by tv_match_options_init. */
  uint32_t struct_size;
  /* A match is kept where its ratio is below this value in both directions; (0, 1], default 0.92. A
     bigger value gives more matches, of which more are wrong; 1 rejects only exact ties. */
  float ratio;
  /* Only keypoints at least this far from the nearest one, in pixels of the image as given, count
     as the second nearest one; [0, 1000], default 10. 0: all others count. Nearer ones are second
     orientations of the same corner, the same corner on another level, or its neighbours on the
     same edge, whose descriptors are alike without making the match uncertain. A bigger value gives
     more matches. */
  float neighbourhood_px;
  /* The L2 distance of descriptors that replaces the distance to the second nearest one where that
     is larger or where there is none, as in tv_guided_options; [0, 3000], default 0: no such bound.
     A smaller value rejects matches whose descriptors are unlike though nothing else is like
     them. */
  float max_distance;
} tv_match_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_match_options_init. */
TV_API void tv_match_options_init_sized(tv_match_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_match_options_init(options) tv_match_options_init_sized((options), sizeof *(options))

/* Finds for each descriptor the two nearest ones of the other image by exhaustive search, and keeps
   a pair when each is the nearest of the other and both pass the ratio test. Of equal distances the
   one with the lower index counts as nearer. When both images are exchanged, the pairs are the same
   ones, exchanged. If an image has only one descriptor, there is no second nearest one, and nothing
   is matched.
   With neighbourhood_px above 0 the second nearest one is the nearest of those whose keypoints are
   at least that far from the nearest one's keypoint: sqrt(dx^2 + dy^2) >= neighbourhood_px. Equal
   descriptors within the neighbourhood then compete by their index only; where an equal one is
   outside it, the pair is rejected as always. Where an image has no keypoint that far away, there
   is no second nearest one.
   features0, features1: the descriptors of the two images, with their keypoints, of which every
   field is checked as tv_describe checks it. Descriptors without keypoints, as of other programs,
   may be matched, too: where both are null, neighbourhood_px counts as 0; where one is null,
   TV_ERR_NULL is returned. With neighbourhood_px 0 keypoints are not read. options: null means the
   defaults. correspondences: room for cap_correspondences, in ascending order of idx0; the smaller
   of both counts of features is always enough. *num_correspondences: how many were written; on
   TV_ERR_CAPACITY how many there are. Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE,
   TV_ERR_LIMITS, TV_ERR_NOT_FINITE, TV_ERR_CAPACITY, TV_ERR_OVERLAP. Time: 128 multiply-adds for
   each of the num0 x num1 pairs of descriptors; where descriptors are equal or neighbourhoods are
   crowded with similar ones, for at most num0 x (2 num0 + 3 num1 + 130) pairs (five times as many
   for equal large counts), with a distance of keypoints for each. Source of the neighbourhood: D.
   Mishkin, J. Matas, M. Perdoch, "MODS: Fast and robust method for two-view matching", CVIU 2015
   (first geometrically inconsistent nearest neighbour). */
TV_API tv_status tv_match(tv_context *context, const tv_features *features0,
                          const tv_features *features1, const tv_match_options *options,
                          tv_correspondence *correspondences, int32_t cap_correspondences,
                          int32_t *num_correspondences);

/* The epipolar geometry of two images, as an input of tv_match_guided. The caller fills every
   field; the cameras are read during the call only. */
typedef struct tv_epipolar {
  /* Both cameras, any models, where `matrix` is E; both null where it is F. */
  const tv_camera *camera0, *camera1;
  /* Row-major 3x3 of any scale, finite: E (tv_two_view.E) where there are cameras, for which the
     band is measured in pixels of the images as given; else F of the pixels (tv_two_view.F). */
  double matrix[9];
} tv_epipolar;

/* Options of tv_match_guided. Filled by tv_guided_options_init. */
typedef struct tv_guided_options {
  /* The caller's sizeof, set by tv_guided_options_init. */
  uint32_t struct_size;
  /* Half the width of the band around the epipolar line in which a match is searched: a Sampson
     distance in pixels of the images as given, [0.01, 1000], default 4. A wider band finds matches
     where the first estimate is inaccurate; a narrow one biases the next estimate towards it. */
  float max_error_px;
  /* A match is kept where its ratio is below this value in both directions; (0, 1], default 0.87. A
     bigger value gives more matches, of which more are wrong. */
  float ratio;
  /* The L2 distance of descriptors that replaces the distance to the second nearest one where the
     band holds no other keypoint, (0, 3000], default 180: 95 % of the correct matches lie below it.
     A bigger value gives more matches, of which more are wrong. */
  float max_distance;
  /* Keypoints within this distance in pixels of the nearest one are not counted as the second
     nearest one, because they are second orientations of the same corner or its neighbours on the
     same edge; [0, 1000], default 4. */
  float neighbourhood_px;
} tv_guided_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_guided_options_init. */
TV_API void tv_guided_options_init_sized(tv_guided_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_guided_options_init(options) tv_guided_options_init_sized((options), sizeof *(options))

/* Matches again where the epipolar geometry is known. A pair is kept when each is the nearest of
   the other among the keypoints within a band around the epipolar line, and both pass the ratio
   test. There are few candidates in a band, so that matches pass that the ratio test over the whole
   image rejects. The ratio of the result is the distance over the smaller of max_distance and the
   distance to the second nearest keypoint in the band, the larger of the two directions. Of equal
   distances the one with the lower index counts as nearer. Exchanged views with the transposed
   matrix give the same pairs, exchanged. A keypoint outside its lens's valid region is not matched.
   epipolar: the known geometry. One camera alone is TV_ERR_ARGUMENT.
   features0, features1: keypoints and descriptors of the two images. Every field of the keypoints
   is checked as tv_describe checks it. options: null means the defaults. correspondences: room for
   cap_correspondences, in ascending order of idx0; the smaller of both counts of features is always
   enough. *num_correspondences: how many were written; on TV_ERR_CAPACITY how many there are.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS, TV_ERR_CAMERA,
   TV_ERR_NOT_FINITE, TV_ERR_CAPACITY, TV_ERR_OVERLAP.
   Time: a product of three numbers for each pair of keypoints, and 128 multiply-adds, at most
   twice, for each pair in a band. */
TV_API tv_status tv_match_guided(tv_context *context, const tv_epipolar *epipolar,
                                 const tv_features *features0, const tv_features *features1,
                                 const tv_guided_options *options,
                                 tv_correspondence *correspondences, int32_t cap_correspondences,
                                 int32_t *num_correspondences);

/* Moves one keypoint of each match to where the 8 x 8 samples around it fit best to those around
   the other keypoint, under an affine map, a gain and an offset (least-squares matching; A. W.
   Gruen, South African Journal of Photogrammetry 14(3), 1985). tv_reconstruct calls it between
   tv_match and tv_estimate_two_view unless align_matches is 0. The keypoint of the larger size
   stays. The other one moves by at most 1.2 times its size over size_of_one, in pixels; only x and
   y change. Neither moves where the samples leave the image, have too little texture, or do not
   fit. Exchanged images give the same positions. Two matches one after the other whose keypoints
   are at the same places, as of a corner with two orientations, move together.
   images: image 0 and image 1, within the context's limits.
   matches: num_matches, as tv_match returns them; where a keypoint is part of several matches, they
   are aligned in their order, and exchanged images may give other positions.
   size_of_one: the size of a keypoint of the full image, (0, 4096], best
   tv_feature_options.keypoint_size.
   keypoints: the arrays of both images, num_keypoints[0] and num_keypoints[1] long: as they were
   found before the call, moved after it. Every field is checked as tv_describe checks it.
   aligned: room for num_matches bytes; a byte is 0 where the match was not aligned, else the
   standard deviation of the aligned position over that of its keypoints, in 128ths, 1 to 255: the
   less the pixels differ after the fit and the more texture they have, the smaller it is.
   tv_reconstruct multiplies the sigmas of both keypoints (tv_keypoint_sigmas) of such a match by
   byte / 128.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (also an index out of its range), TV_ERR_NOT_FINITE,
   TV_ERR_LIMITS, TV_ERR_OVERLAP; nothing is written then. The context is one made for
   TV_PURPOSE_EXTRACT. Time: at most four fits of 64 samples a match. docs/algorithms/match.md. */
TV_API tv_status tv_align_matches(tv_context *context, const tv_image images[2],
                                  const tv_correspondence *matches, int32_t num_matches,
                                  float size_of_one, tv_keypoint *const keypoints[2],
                                  const int32_t num_keypoints[2], uint8_t *aligned);

TV_END_DECLS

#endif
