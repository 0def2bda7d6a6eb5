/* twoview: the whole way, from two images in memory to a pose and points.

   It calls the stages in a row; the header of each stage names its sources. Views from the side:
   J.-M. Morel, G. Yu, "ASIFT: a new framework for fully affine invariant image comparison", SIAM J.
   Imaging Sciences 2(2), 2009; docs/algorithms/effort.md. Signs and frames: docs/conventions.md. */
#ifndef TWOVIEW_RECONSTRUCT_H
#define TWOVIEW_RECONSTRUCT_H

#include "twoview/feature.h"
#include "twoview/match.h"
#include "twoview/triangulate.h"
#include "twoview/two_view.h"

TV_BEGIN_DECLS

/* One of the two views. Filled by tv_view_init with zeros; what it points to is the caller's and
   stays valid during the call. */
typedef struct tv_view {
  /* The caller's sizeof, set by tv_view_init. */
  uint32_t struct_size;
  /* Must be 0. */
  uint32_t reserved;
  /* The image. */
  tv_image image;
  /* The camera of this image, of its width and height; null in both views means uncalibrated, which
     gives no pose. */
  const tv_camera *camera;
  /* Null, or an image of the same size; only corners where its byte is not 0 are kept. */
  const tv_image *mask;
} tv_view;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_view_init. */
TV_API void tv_view_init_sized(tv_view *view, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_view_init(view) tv_view_init_sized((view), sizeof *(view))

/* Options of tv_reconstruct. Filled by tv_reconstruct_options_init. */
typedef struct tv_reconstruct_options {
  /* The caller's sizeof, set by tv_reconstruct_options_init. */
  uint32_t struct_size;
  /* A tv_triangulation, default TV_TRIANGULATION_ITERATIVE_LS. */
  int32_t triangulation;
  /* Options of tv_extract; null (default) means its defaults. */
  const tv_feature_options *feature;
  /* Options of tv_match; null (default) means its defaults. */
  const tv_match_options *match;
  /* Options of tv_estimate_two_view; null (default) means its defaults. */
  const tv_estimate_options *estimate;
  /* 1: after a first full pose, tv_match_guided with its default options searches further matches,
     and the pose is estimated again from all of them; 0 (default): it is not. It takes more time
     and helps where few matches pass the ratio test. */
  int32_t guided_matching;
  /* 1: a full pose and the points of its inliers are adjusted together by tv_adjust_two_view with
     its default options, which takes the cameras as exact, and R, t, E and F are those of the
     adjustment; what was judged stays: covariance, noise_px, verdict. 0 (default): all is the
     estimate's, which was measured to be as accurate
     (docs/decisions/0005-bundle.md). */
  int32_t bundle_adjustment;
  /* How a keypoint's size gives the noise of its position, the exponent of tv_keypoint_sigmas with
     the feature option keypoint_size as the size of sigma 1: in [0, 2], default 1: in proportion
     to the size. 0: all keypoints are taken as equally precise. The sigmas serve the estimate and
     bundle_adjustment. The band of guided_matching stays the same for all, since it is the error of
     the first pose that makes it wide. */
  double sigma_by_size;
  /* 1 (default): before the estimate, one keypoint of each match of tv_match is moved to where the
     8 x 8 samples around it fit best to those around the other keypoint, under an affine map, a
     gain and an offset (least-squares matching; A. W. Gruen, South African Journal of
     Photogrammetry 14(3), 1985), and the sigmas of sigma_by_size are multiplied for this match
     by what the fit says of its precision (tv_align_matches). It is moved by at most 1.2 times its
     size over keypoint_size, in pixels, or not at all where the samples do not fit. 0, and for a
     caller whose struct ends before this field: no keypoint is moved. 1 takes 0.7 microseconds a
     match on a desktop CPU, and lowers the median error of poses by a fifth
     (docs/decisions/0026-precision.md). */
  int32_t align_matches;
  /* Must be 0. */
  int32_t reserved;
  /* The rung of effort to begin with, [0, the context's max_effort]; 0 (default): one view of each
     image and max_keypoints keypoints in it, N for short. 1: 4 N keypoints, where the image has
     them. 2: N keypoints, and N / 2 in each of four views that are squeezed by 2, as a plane seen
     at 60 degrees is, along 0, 45, 90 and 135 degrees. 3: 16 squeezed views, by sqrt(2), 2 and 2
     sqrt(2), 6.4 N keypoints in all. A higher rung finds matches where a turned wall or a wide
     baseline leaves too few; docs/algorithms/effort.md has what each gains and takes. */
  int32_t effort;
  /* The highest rung that may be climbed to, [0, the context's max_effort]; 0 (default), and any
     value that is not above `effort`: none but `effort` is run. While the verdict is not "ok" and
     the evidence says that more could help, the next rung is run; its result replaces that of the
     one before. Blank or equal pictures and, mostly, unrelated ones end it early. */
  int32_t max_effort;
} tv_reconstruct_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_reconstruct_options_init. */
TV_API void tv_reconstruct_options_init_sized(tv_reconstruct_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_reconstruct_options_init(options) \
  tv_reconstruct_options_init_sized((options), sizeof *(options))

/* The features, matches and points that tv_reconstruct found. The arrays lie in the context's
   memory and stay valid until the next call with the context. */
typedef struct tv_reconstruction {
  /* The caller's sizeof, set by tv_reconstruction_init. */
  uint32_t struct_size;
  /* How many keypoints view 0 and view 1 have, second orientations included. */
  int32_t num_keypoints[2];
  /* How many matches were found beyond the context's max_matches and left out: those of the highest
     ratio and, among equal ratios, those of the weaker keypoints. If the second estimate of guided
     matching was taken, they are counted among the matches that it chose from: those that the first
     estimate used, and those of guided matching that share no keypoint with them. */
  int32_t num_matches_left_out;
  /* The keypoints of view 0 and of view 1, num_keypoints[0] and num_keypoints[1] of them. */
  const tv_keypoint *keypoints[2];
  /* Their descriptors, num_keypoints x TV_DESCRIPTOR_BYTES; row i describes keypoint i. */
  const uint8_t *descriptors[2];
  /* How many matches there are: those of tv_match, and those of guided matching where its estimate
     was taken. */
  int32_t num_matches;
  /* How many inliers have a point whose status is TV_POINT_OK. */
  int32_t num_points;
  /* num_matches matches; their indices refer to `keypoints`. */
  const tv_correspondence *matches;
  /* num_matches bytes; a byte is 1 where the match is an inlier of the model that the kind of the
     result names. */
  const uint8_t *inlier_mask;
  /* num_matches points; the status is TV_POINT_INVALID where the match is no inlier, and everywhere
     if there is no full pose. */
  const tv_point *points;
  /* The rung of effort whose result this is. */
  int32_t effort;
  /* How many rungs were run. */
  int32_t num_rungs;
  /* The tilt of each keypoint of view 0 and of view 1, for tv_keypoint_shapes: 0 for the image as
     it is, 1 to 16 for the squeezed views of rungs 2 and 3. */
  const uint8_t *tilts[2];
  /* The nanoseconds that each of the rungs that were run took, the first one first; 0 without a
     clock. */
  uint64_t rung_ns[4];
} tv_reconstruction;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_reconstruction_init. */
TV_API void tv_reconstruction_init_sized(tv_reconstruction *reconstruction, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_reconstruction_init(reconstruction) \
  tv_reconstruction_init_sized((reconstruction), sizeof *(reconstruction))

/* Computes the pose and the points of two images: tv_extract on both, tv_match,
   tv_estimate_two_view, tv_triangulate.
   More matches than the context's max_matches are no error: the best are taken, and
   num_matches_left_out says how many were not.
   With guided_matching, the second estimate replaces the first one if it is of the same kind, has
   no fewer inliers and no worse a verdict. Verdict and reasons remain those of the first estimate,
   because matches that were searched along its epipolar lines are no independent evidence for it.
   An image and a mirrored one may agree on a pose that does not exist. Where the verdict would be
   "ok" and less than a quarter of the keypoints match, the strongest 512 of each image are
   therefore matched again, as they are and with the patches of one image mirrored; if more match
   mirrored, the reason TV_REASON_LOW_INLIER_RATIO is given. A scene that is its own mirror image
   can still pass, and with upright descriptors (TV_ORIENTATION_UPRIGHT) an image mirrored left to
   right can.
   The estimate is given the reason TV_REASON_REPEATED_STRUCTURE where more than half of its inliers
   have a second nearest descriptor at a squared distance below 20000: then a second place looks the
   same, as on a wall that one pattern covers. With a max_distance of 141 and below in the options
   of tv_match that distance is unknown, and the reason is not given for it.
   With bundle_adjustment, exchanged views give the inverse pose up to rounding; without it, bit for
   bit.
   options: null means the defaults.
   two_view: initialised by tv_two_view_init; evidence: null, or initialised by tv_evidence_init;
   reconstruction: initialised by tv_reconstruction_init. They do not overlap (TV_ERR_OVERLAP).
   Returns TV_ERR_NULL, TV_ERR_STRUCT_SIZE, TV_ERR_ARGUMENT (an option, or a reserved field that is
   not 0), TV_ERR_CAMERA (also where the width or height of a view's image is not that of its
   camera: tv_camera_scale gives the camera of a resized image), and the statuses of the stages. */
TV_API tv_status tv_reconstruct(tv_context *context, const tv_view *view0, const tv_view *view1,
                                const tv_reconstruct_options *options, tv_two_view *two_view,
                                tv_evidence *evidence, tv_reconstruction *reconstruction);

TV_END_DECLS

#endif
