/* twoview: FAST corners with SIFT descriptors.

   Corners: E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006,
   on an image pyramid. Descriptors: D. G. Lowe, "Distinctive image features from scale-invariant
   keypoints", IJCV 2004; RootSIFT: R. Arandjelovic, A. Zisserman, CVPR 2012.
   Formulas and tests: docs/algorithms/fast.md, docs/algorithms/sift.md. */
#ifndef TWOVIEW_FEATURE_H
#define TWOVIEW_FEATURE_H

#include "twoview/context.h"
#include "twoview/image.h"

TV_BEGIN_DECLS

/* Bytes of a descriptor: 4 x 4 cells of 8 directions. */
#define TV_DESCRIPTOR_BYTES 128

/* A corner, and where and how wide its surroundings are described. */
typedef struct tv_keypoint {
  float x, y;      /* pixels of the full image; (0,0) is the centre of its top-left pixel */
  float size;      /* diameter in pixels of the full image; a descriptor's spatial bin is 1.5 size */
  float angle_rad; /* dominant gradient, (-pi, pi], from x towards y (clockwise as seen); 0 if upright */
  float score;     /* the largest threshold at which the pixel is still a corner, 1..254 */
  int32_t level;   /* pyramid level it was found on, 0 the full image */
} tv_keypoint;

/* Which way a descriptor's frame is turned. */
typedef enum tv_orientation {
  TV_ORIENTATION_UPRIGHT = 0, /* angle 0: for cameras that do not roll; cheaper, more distinctive */
  TV_ORIENTATION_GRADIENT = 1 /* Lowe's histogram; a second peak above 80 per cent is a second keypoint */
} tv_orientation;

/* How a descriptor is normalised; both are bytes, and compared by L2 distance. */
typedef enum tv_normalisation {
  TV_NORMALISATION_SIFT = 0,    /* unit L2 norm x 512, saturated at 255 */
  TV_NORMALISATION_ROOTSIFT = 1 /* square root of the unit-L1 descriptor x 512, saturated */
} tv_normalisation;

/* Filled by tv_feature_options_init. The defaults serve the demo, the accuracy and the speed tables;
   docs/decisions/0001-features.md has the measurements behind them. */
typedef struct tv_feature_options {
  uint32_t struct_size;  /* set by tv_feature_options_init */
  int32_t max_keypoints; /* a bound on descriptors an image, second orientations included, which get
                            the room that corners leave; [1, the context's], or 0 (default): 2048 or
                            the context's, whichever is less */
  int32_t arc;           /* contiguous pixels of the 16-pixel circle: 9 (default), 10, 11 or 12 (the
                            paper's); a longer arc gives fewer, sharper corners */
  int32_t threshold;     /* grey levels, [1, 254], default 10; a bigger value gives fewer, stronger
                            corners */
  int32_t min_threshold; /* 0: threshold is fixed. Else [1, threshold], default 3: the threshold falls
                            as far as this until max_keypoints corners are found */
  int32_t levels;        /* pyramid levels, [1, 8], default 1; more bridge changes of scale and cost
                            precision, for coarse corners take their place in max_keypoints: each
                            level has a share by its area, and what it leaves goes to coarser ones */
  float scale_factor;    /* between levels, [1.1, 2], default 2 */
  int32_t cell_px;       /* 0 (default): the best corners, wherever they are. Else [8, 16384]: side of
                            the grid cell, in pixels of each level, in which corners are budgeted so
                            that they spread */
  int32_t subpixel;      /* 1 (default): refine the corner's position below a pixel; 0: integers */
  int32_t orientation;   /* a tv_orientation, default gradient */
  int32_t descriptor;    /* a tv_normalisation, default RootSIFT */
  float keypoint_size;   /* tv_keypoint.size of a corner on level 0, in pixels, [1, 32], default 4;
                            larger sees more of the surroundings: more distinctive, less local */
} tv_feature_options;

/* Writes the defaults, and struct_size; null is allowed. */
TV_API void tv_feature_options_init(tv_feature_options *options);

/* Finds corners. The result is in descending order of (score, then level, y, x).
   mask: null, or an image of the same size; a corner is kept where its byte is not 0.
   keypoints: the caller's array of cap_keypoints; angle_rad is 0.
   *num_keypoints: how many were written; on TV_ERR_CAPACITY how many there are. Capacity of
   options->max_keypoints is always enough; of the context's where that is 0.
   options may be null (defaults).
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS, TV_ERR_CAPACITY,
   TV_ERR_OVERLAP.
   An image too small for any corner gives 0 keypoints and TV_OK. */
TV_API tv_status tv_detect(tv_context *context, const tv_image *image, const tv_image *mask,
                           const tv_feature_options *options, tv_keypoint *keypoints,
                           int32_t cap_keypoints, int32_t *num_keypoints);

/* Gives each of the keypoints its dominant orientation, by options->orientation; those with a second
   one appear twice, one after the other, angle apart. The order is the input's. Reads x, y, size.
   oriented: the caller's array of cap_oriented; overlaps no other argument. *num_oriented: how many were
   written; on TV_ERR_CAPACITY how many there are. Statuses as tv_detect, and TV_ERR_NOT_FINITE. */
TV_API tv_status tv_orient(tv_context *context, const tv_image *image,
                           const tv_feature_options *options, const tv_keypoint *keypoints,
                           int32_t num_keypoints, tv_keypoint *oriented, int32_t cap_oriented,
                           int32_t *num_oriented);

/* Describes the image at the keypoints that the caller gives (x, y, size, angle_rad are read).
   descriptors: num_keypoints x TV_DESCRIPTOR_BYTES, row i for keypoint i: 4x4 cells of 8 directions,
   index (cell_y * 4 + cell_x) * 8 + direction in the frame turned by angle_rad, direction counter-
   clockwise from x as seen in the image (UBC order, as OpenCV's and COLMAP's). A point beyond the image's
   border is described from what the image's nearest pixels show; a flat patch gives zeros.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS (the image), TV_ERR_NOT_FINITE,
   TV_ERR_OVERLAP. */
TV_API tv_status tv_describe(tv_context *context, const tv_image *image,
                             const tv_feature_options *options, const tv_keypoint *keypoints,
                             int32_t num_keypoints, uint8_t *descriptors);

/* tv_detect, tv_orient and tv_describe over one pyramid: what a program usually wants.
   mask, keypoints, *num_keypoints and statuses as tv_detect; angle_rad is that of tv_orient.
   descriptors: cap_keypoints x TV_DESCRIPTOR_BYTES, rows as tv_describe. */
TV_API tv_status tv_extract(tv_context *context, const tv_image *image, const tv_image *mask,
                            const tv_feature_options *options, tv_keypoint *keypoints,
                            uint8_t *descriptors, int32_t cap_keypoints, int32_t *num_keypoints);

TV_END_DECLS

#endif
