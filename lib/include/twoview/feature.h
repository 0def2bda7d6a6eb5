/* twoview: FAST corners with SIFT descriptors.

   Corners: E. Rosten, T. Drummond, "Machine learning for high-speed corner detection", ECCV 2006,
   on an image pyramid. Descriptors: D. G. Lowe, "Distinctive image features from scale-invariant
   keypoints", IJCV 2004; RootSIFT: R. Arandjelovic, A. Zisserman, "Three things everyone should
   know to improve object retrieval", CVPR 2012. Formulas and tests: docs/algorithms/fast.md,
   docs/algorithms/sift.md. */
#ifndef TWOVIEW_FEATURE_H
#define TWOVIEW_FEATURE_H

#include "twoview/context.h"
#include "twoview/image.h"

TV_BEGIN_DECLS

/* The bytes of a descriptor: 4 x 4 cells of 8 gradient directions. */
#define TV_DESCRIPTOR_BYTES 128

/* A corner, with the size and the orientation of the patch that its descriptor is computed from. */
typedef struct tv_keypoint {
  /* Position in pixels of the full image; (0, 0) is the centre of the top-left pixel. */
  float x, y;
  /* Diameter of the keypoint in pixels of the full image. A descriptor's cell is 1.5 times as wide.
   */
  float size;
  /* Angle of the dominant gradient in radians, (-pi, pi], from x towards y (clockwise as seen in
     the image); 0 for upright keypoints. */
  float angle_rad;
  /* The largest threshold in grey levels at which the pixel is still a corner, [1, 254]. */
  float score;
  /* The pyramid level on which the corner was found; 0 is the full image. */
  int32_t level;
} tv_keypoint;

/* The keypoints and descriptors of one image, as an input of matching. Filled by tv_features_init
   with zeros; the arrays are the caller's and are read during the call only. */
typedef struct tv_features {
  /* The caller's sizeof, set by tv_features_init. */
  uint32_t struct_size;
  /* How many descriptors (and keypoints) there are, [0, the context's max_keypoints]. */
  int32_t num;
  /* `num` keypoints. They may be null for tv_match, which then has no neighbourhoods;
     tv_match_guided requires them. */
  const tv_keypoint *keypoints;
  /* num x TV_DESCRIPTOR_BYTES bytes; row i describes keypoint i. */
  const uint8_t *descriptors;
} tv_features;

/* Writes zeros into a struct of struct_size bytes, and the size; null is allowed. Programs call
   tv_features_init. */
TV_API void tv_features_init_sized(tv_features *features, size_t struct_size);
/* Writes zeros, and struct_size; null is allowed. */
#define tv_features_init(features) tv_features_init_sized((features), sizeof *(features))

/* The orientation that a keypoint's descriptor is turned to. */
typedef enum tv_orientation {
  /* The angle is 0. For cameras that do not roll: faster, and the descriptors are more distinctive.
   */
  TV_ORIENTATION_UPRIGHT = 0,
  /* The peak of Lowe's gradient histogram. A second peak above 80 % of the highest one makes a
     second keypoint at the same place. */
  TV_ORIENTATION_GRADIENT = 1
} tv_orientation;

/* How a descriptor is normalised. Either way it consists of bytes and is compared by L2 distance.
 */
typedef enum tv_normalisation {
  /* Unit L2 norm, times 512, saturated at 255 (Lowe). */
  TV_NORMALISATION_SIFT = 0,
  /* Square root of the descriptor of unit L1 norm, times 512, saturated at 255. */
  TV_NORMALISATION_ROOTSIFT = 1
} tv_normalisation;

/* Options of detection and description. Filled by tv_feature_options_init.
   The measurements behind the defaults are in docs/decisions/0001-features.md and
   docs/accuracy.md. */
typedef struct tv_feature_options {
  /* The caller's sizeof, set by tv_feature_options_init. */
  uint32_t struct_size;
  /* The most keypoints of an image, [1, the context's max_keypoints]; 0 (default) means 2048 or
     the context's max_keypoints, whichever is less. Second orientations are counted, too, and use
     the room that corners leave. More keypoints give more matches and take more time: matching
     grows with the square. */
  int32_t max_keypoints;
  /* How many contiguous pixels of the circle of 16 must all be brighter or all be darker than the
     centre: 9, 10, 11 or 12 (default, and the FAST-SIFT paper's). A longer arc gives fewer, sharper
     corners. */
  int32_t arc;
  /* The difference in grey levels that these pixels must exceed, [1, 254], default 15. A bigger
     value gives fewer, stronger corners. */
  int32_t threshold;
  /* 0: the threshold is fixed. Otherwise in [1, threshold], default 3: the threshold is lowered,
     but not below this value, until max_keypoints corners are found. */
  int32_t min_threshold;
  /* How many levels the pyramid has, [1, 8], default 4. More levels find matches across a change of
     scale. They cost precision, because corners of coarse levels, which are located less precisely,
     take a share of max_keypoints in proportion to the level's area, and what finer levels leave
     unused. */
  int32_t levels;
  /* The scale factor from a pyramid level to the next, [1.1, 2], default 1.41. */
  float scale_factor;
  /* The side of a grid cell in pixels of each level, [8, 16384], default 48: each cell keeps only
     its share, so that the corners spread over the image. Corners below `threshold` are kept only
     where there are too few others. 0: the strongest corners are kept, wherever they are. */
  int32_t cell_px;
  /* 1 (default): the position of a corner is refined to a fraction of a pixel; 0: it is that of the
     pixel. */
  int32_t subpixel;
  /* A tv_orientation, default TV_ORIENTATION_GRADIENT. */
  int32_t orientation;
  /* A tv_normalisation, default TV_NORMALISATION_ROOTSIFT. */
  int32_t descriptor;
  /* The size that a corner of level 0 receives, in pixels, [1, 32], default 4. A larger patch is
     more distinctive and is more often disturbed by occlusion and perspective. */
  float keypoint_size;
  /* 0 (default): a descriptor is the histogram of one window. 1: it is the mean of the histograms
     of two windows, of 0.7 and 1.3 times its size (J. Dong, S. Soatto, "Domain-size pooling in
     local descriptors: DSP-SIFT", CVPR 2015). This finds more matches across a change of view or
     of scale. Descriptors with and without pooling must not be matched with each other. */
  int32_t pooling;
  /* Must be 0. */
  int32_t reserved;
} tv_feature_options;

/* Writes the default options into a struct of struct_size bytes; null is allowed. Programs call
   tv_feature_options_init. */
TV_API void tv_feature_options_init_sized(tv_feature_options *options, size_t struct_size);
/* Writes the default options; null is allowed. */
#define tv_feature_options_init(options) tv_feature_options_init_sized((options), sizeof *(options))

/* Finds corners and writes them in descending order of score; equal scores are ordered by level, y
   and x.
   mask: null, or an image of the same size; only corners where its byte is not 0 are kept.
   options: null means the defaults.
   keypoints: room for cap_keypoints, of which options->max_keypoints (the context's where that is
   0) are always enough; angle_rad of each is 0. *num_keypoints: how many were written; on
   TV_ERR_CAPACITY how many there are. An image that is too small for any corner gives 0 keypoints
   and TV_OK. Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS,
   TV_ERR_CAPACITY, TV_ERR_OVERLAP. */
TV_API tv_status tv_detect(tv_context *context, const tv_image *image, const tv_image *mask,
                           const tv_feature_options *options, tv_keypoint *keypoints,
                           int32_t cap_keypoints, int32_t *num_keypoints);

/* Writes the given keypoints with their dominant orientation, as options->orientation selects. A
   keypoint with two orientations is written twice in a row. The order is that of the input, of
   which x, y and size are read. options: null means the defaults. oriented: room for cap_oriented
   keypoints; it overlaps no other argument. *num_oriented: how many were written; on
   TV_ERR_CAPACITY how many there are. Returns the statuses as tv_detect does, and
   TV_ERR_NOT_FINITE. */
TV_API tv_status tv_orient(tv_context *context, const tv_image *image, const tv_keypoint *keypoints,
                           int32_t num_keypoints, const tv_feature_options *options,
                           tv_keypoint *oriented, int32_t cap_oriented, int32_t *num_oriented);

/* Computes the descriptors of the given keypoints, of which x, y, size and angle_rad are read.
   options: null means the defaults. descriptors: room for num_keypoints x TV_DESCRIPTOR_BYTES; row
   i describes keypoint i. A row holds 4 x 4 cells of 8 directions at index (cell_y * 4 + cell_x) *
   8 + direction, in the frame that angle_rad turns; directions count counter-clockwise from x as
   seen in the image. This is the UBC order, which OpenCV and COLMAP use, too. Beyond the image's
   border, the nearest pixels of the border are repeated. A patch of one grey level gives a
   descriptor of zeros. Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_STRUCT_SIZE, TV_ERR_LIMITS,
   TV_ERR_NOT_FINITE, TV_ERR_OVERLAP. */
TV_API tv_status tv_describe(tv_context *context, const tv_image *image,
                             const tv_keypoint *keypoints, int32_t num_keypoints,
                             const tv_feature_options *options, uint8_t *descriptors);

/* Detects, orients and describes over one pyramid: tv_detect, tv_orient and tv_describe in one
   call, which is what most programs need. mask, keypoints, *num_keypoints and statuses are as for
   tv_detect; angle_rad is set as by tv_orient. descriptors: room for cap_keypoints x
   TV_DESCRIPTOR_BYTES, with rows as tv_describe writes them. */
TV_API tv_status tv_extract(tv_context *context, const tv_image *image, const tv_image *mask,
                            const tv_feature_options *options, tv_keypoint *keypoints,
                            uint8_t *descriptors, int32_t cap_keypoints, int32_t *num_keypoints);

/* Computes how precisely keypoints are located from their sizes, for tv_pixel_pairs: the standard
   deviation of a position, relative to that of a keypoint of size_of_one pixels, is taken as
   (size / size_of_one)^exponent, limited to [0.01, 1000].
   keypoints: num_keypoints; every field is checked as tv_describe checks it. size_of_one: (0,
   4096], best tv_feature_options.keypoint_size. exponent: [0, 2]; 0 gives 1 for all, 1 a noise in
   proportion to the size; docs/decisions/0001-features.md has what was measured.
   sigmas: room for num_keypoints; gather them by the indices of the matches.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT, TV_ERR_NOT_FINITE, TV_ERR_OVERLAP. Thread-safe. */
TV_API tv_status tv_keypoint_sigmas(const tv_keypoint *keypoints, int32_t num_keypoints,
                                    float size_of_one, double exponent, float *sigmas);

/* Computes how the patches of keypoints lie in the image: shapes[4 k] to shapes[4 k + 3] are a 2 x
   2 matrix, row-major, whose columns are the x and the y axis of patch k in pixels, each as long as
   the keypoint's size is in the view that it was found in. A keypoint of the image as it is has
   size times the rotation by angle_rad; one of a squeezed view has an ellipse of the same area as a
   circle of its size: its patch is longer along the direction of the view. keypoints:
   num_keypoints; every field is checked as tv_describe checks it. tilts: null (all 0), or
   num_keypoints bytes (tv_reconstruction.tilts). shapes: room for 4 x num_keypoints.
   Returns TV_ERR_NULL, TV_ERR_ARGUMENT (also a tilt above 16), TV_ERR_NOT_FINITE, TV_ERR_OVERLAP.
   Thread-safe. */
TV_API tv_status tv_keypoint_shapes(const tv_keypoint *keypoints, const uint8_t *tilts,
                                    int32_t num_keypoints, double *shapes);

TV_END_DECLS

#endif
