/* twoview: the main job, two images in memory to a pose and points.

   The stages in a row; each one's header names its sources. Signs and frames: docs/conventions.md. */
#ifndef TWOVIEW_RECONSTRUCT_H
#define TWOVIEW_RECONSTRUCT_H

#include "twoview/feature.h"
#include "twoview/match.h"
#include "twoview/triangulate.h"
#include "twoview/two_view.h"

TV_BEGIN_DECLS

/* One view of the pair. All of it is the caller's and lives as long as the call. */
typedef struct tv_view {
  tv_image image;          /* 8-bit luma */
  const tv_camera *camera; /* of this image; null in both views: uncalibrated, no pose */
  const tv_image *mask;    /* null, or an image of the same size, 0 where no corner is wanted */
} tv_view;

/* Filled by tv_reconstruct_options_init. */
typedef struct tv_reconstruct_options {
  uint32_t struct_size;  /* set by tv_reconstruct_options_init */
  int32_t triangulation; /* a tv_triangulation; default TV_TRIANGULATION_ITERATIVE_LS */
  const tv_feature_options *feature;   /* null (default): the stage's defaults; else the caller's */
  const tv_match_options *match;       /* the same */
  const tv_estimate_options *estimate; /* the same */
  int32_t guided_matching; /* 1: after a first full pose, matches along its epipolar lines join the
                              others (tv_match_guided with its defaults) and all are estimated again;
                              default 0 */
  int32_t bundle_adjustment; /* 1: a full pose and its inliers' points are adjusted together
                                (tv_adjust_two_view with its defaults); R, t, E, F, covariance and
                                noise_px are then its own; default 0: the estimate's refinement ends
                                as near the truth (docs/decisions/0005-bundle.md) */
} tv_reconstruct_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tv_reconstruct_options_init(tv_reconstruct_options *options);

/* What tv_reconstruct found. The arrays lie in the context and hold until the next call with it. */
typedef struct tv_reconstruction {
  uint32_t struct_size; /* set by tv_reconstruction_init */
  int32_t num_keypoints[2];        /* of view 0 and 1, second orientations included */
  const tv_keypoint *keypoints[2]; /* num_keypoints */
  const uint8_t *descriptors[2]; /* num_keypoints x TV_DESCRIPTOR_BYTES */
  int32_t num_matches; /* those of tv_match, and of guided matching where that was taken */
  int32_t num_points; /* inliers whose point is TV_POINT_OK */
  const tv_correspondence *matches; /* num_matches, rows of keypoints */
  const uint8_t *inlier_mask; /* num_matches, 1 for an inlier of the model that the result's kind names */
  const tv_point *points;     /* num_matches; TV_POINT_INVALID where the match is no inlier, or where
                                 there is no full pose */
  /* Matches that were found and are not among `matches`, which hold at most the context's
     max_matches: those of the highest ratio are left out, with equal ratios those of the weaker
     keypoints. With guided matching, of both passes' matches where the second was taken. */
  int32_t num_matches_left_out;
} tv_reconstruction;

/* Writes zeros, and struct_size; null is allowed. */
TV_API void tv_reconstruction_init(tv_reconstruction *reconstruction);

/* tv_extract on both images, tv_match, tv_estimate_two_view, tv_triangulate. More matches than the
   context's max_matches are no error: the best are taken (num_matches_left_out). With bundle_adjustment
   swapped views give the inverse to rounding only.
   With guided_matching the second estimate is taken where it is of the same kind with no fewer inliers
   and no worse a verdict, but verdict and reasons stay the first one's: matches sought along its lines
   are no independent evidence for it.
   options: null means the defaults. two_view: initialised by tv_two_view_init.
   Statuses as the stages'. */
TV_API tv_status tv_reconstruct(tv_context *context, const tv_view *view0, const tv_view *view1,
                                const tv_reconstruct_options *options, tv_two_view *two_view,
                                tv_reconstruction *reconstruction);

TV_END_DECLS

#endif
