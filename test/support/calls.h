/* Wrappers of the calls on features and on matched pixels that take the structs' members as
   parameters, so that a test can change one of them at a time; and functions that make a view in
   one expression. */
#ifndef TEST_SUPPORT_CALLS_H
#define TEST_SUPPORT_CALLS_H

#include "twoview/twoview.h"

static inline tv_features features_of(const tv_keypoint *keypoints, const uint8_t *descriptors,
                                      int32_t num) {
  tv_features features;
  tv_features_init(&features);
  features.num = num;
  features.keypoints = keypoints;
  features.descriptors = descriptors;
  return features;
}

static inline tv_pixel_pairs pairs_of(const double *pixels0, const double *pixels1,
                                      const float *ratios, int32_t num) {
  tv_pixel_pairs pairs;
  tv_pixel_pairs_init(&pairs);
  pairs.num = num;
  pairs.pixels0 = pixels0;
  pairs.pixels1 = pixels1;
  pairs.ratios = ratios;
  return pairs;
}

static inline tv_view view_of(tv_image image, const tv_camera *camera, const tv_image *mask) {
  tv_view view;
  tv_view_init(&view);
  view.image = image;
  view.camera = camera;
  view.mask = mask;
  return view;
}

static inline tv_status match_rows(tv_context *context, const uint8_t *descriptors0, int32_t num0,
                                   const uint8_t *descriptors1, int32_t num1,
                                   const tv_match_options *options,
                                   tv_correspondence *correspondences, int32_t cap_correspondences,
                                   int32_t *num_correspondences) {
  const tv_features features0 = features_of(NULL, descriptors0, num0);
  const tv_features features1 = features_of(NULL, descriptors1, num1);
  return tv_match(context, &features0, &features1, options, correspondences, cap_correspondences,
                  num_correspondences);
}

static inline tv_status match_rows_guided(
    tv_context *context, const tv_camera *camera0, const tv_camera *camera1,
    const double epipolar[9], const tv_keypoint *keypoints0, const uint8_t *descriptors0,
    int32_t num0, const tv_keypoint *keypoints1, const uint8_t *descriptors1, int32_t num1,
    const tv_guided_options *options, tv_correspondence *correspondences,
    int32_t cap_correspondences, int32_t *num_correspondences) {
  const tv_features features0 = features_of(keypoints0, descriptors0, num0);
  const tv_features features1 = features_of(keypoints1, descriptors1, num1);
  return tv_match_guided(context, camera0, camera1, epipolar, &features0, &features1, options,
                         correspondences, cap_correspondences, num_correspondences);
}

static inline tv_status estimate_pixels(tv_context *context, const tv_camera *camera0,
                                        const tv_camera *camera1, const double *pixels0,
                                        const double *pixels1, const float *ratios,
                                        int32_t num_matches, const tv_estimate_options *options,
                                        tv_two_view *result, uint8_t *inlier_mask) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, ratios, num_matches);
  return tv_estimate_two_view(context, camera0, camera1, &pairs, options, result, inlier_mask);
}

static inline tv_status adjust_pixels(tv_context *context, const tv_camera *camera0,
                                      const tv_camera *camera1, const double *pixels0,
                                      const double *pixels1, int32_t num_points,
                                      const tv_bundle_options *options, double R[9], double t[3],
                                      tv_point *points, tv_bundle_result *result) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, num_points);
  return tv_adjust_two_view(context, camera0, camera1, &pairs, options, R, t, points, result);
}

#endif
