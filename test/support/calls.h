/* Wrappers of the calls on features and on matched pixels that take the structs' members as
   parameters, so that a test can change one of them at a time; and functions that make a view in
   one expression. */
#ifndef TEST_SUPPORT_CALLS_H
#define TEST_SUPPORT_CALLS_H

#include <string.h>

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

static inline tv_camera_pair pair_of(const tv_camera *camera0, const tv_camera *camera1,
                                     const double R[9], const double t[3]) {
  tv_camera_pair pair;
  pair.camera0 = *camera0;
  pair.camera1 = *camera1;
  memcpy(pair.cam1_from_cam0_R, R, sizeof pair.cam1_from_cam0_R);
  memcpy(pair.cam1_from_cam0_t, t, sizeof pair.cam1_from_cam0_t);
  return pair;
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
    tv_context *context, const tv_camera *camera0, const tv_camera *camera1, const double matrix[9],
    const tv_keypoint *keypoints0, const uint8_t *descriptors0, int32_t num0,
    const tv_keypoint *keypoints1, const uint8_t *descriptors1, int32_t num1,
    const tv_guided_options *options, tv_correspondence *correspondences,
    int32_t cap_correspondences, int32_t *num_correspondences) {
  const tv_features features0 = features_of(keypoints0, descriptors0, num0);
  const tv_features features1 = features_of(keypoints1, descriptors1, num1);
  tv_epipolar epipolar;
  epipolar.camera0 = camera0;
  epipolar.camera1 = camera1;
  if (matrix != NULL) memcpy(epipolar.matrix, matrix, sizeof epipolar.matrix);
  return tv_match_guided(context, matrix != NULL ? &epipolar : NULL, &features0, &features1,
                         options, correspondences, cap_correspondences, num_correspondences);
}

static inline tv_status align_keypoints_of(tv_context *context, tv_image image0, tv_image image1,
                                           const tv_correspondence *matches, int32_t num_matches,
                                           float size_of_one, tv_keypoint *keypoints0,
                                           int32_t num_keypoints0, tv_keypoint *keypoints1,
                                           int32_t num_keypoints1, uint8_t *aligned) {
  tv_image images[2];
  tv_keypoint *keypoints[2];
  int32_t num_keypoints[2];
  images[0] = image0;
  images[1] = image1;
  keypoints[0] = keypoints0;
  keypoints[1] = keypoints1;
  num_keypoints[0] = num_keypoints0;
  num_keypoints[1] = num_keypoints1;
  return tv_align_matches(context, images, matches, num_matches, size_of_one, keypoints,
                          num_keypoints, aligned);
}

/* With the evidence, which it initialises; null where it is not wanted. */
static inline tv_status estimate_evidence(tv_context *context, const tv_camera *camera0,
                                          const tv_camera *camera1, const double *pixels0,
                                          const double *pixels1, const float *ratios,
                                          int32_t num_matches, const tv_estimate_options *options,
                                          tv_two_view *result, tv_evidence *evidence,
                                          uint8_t *inlier_mask) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, ratios, num_matches);
  tv_evidence_init(evidence);
  return tv_estimate_two_view(context, camera0, camera1, &pairs, options, result, evidence,
                              inlier_mask);
}

static inline tv_status estimate_pixels(tv_context *context, const tv_camera *camera0,
                                        const tv_camera *camera1, const double *pixels0,
                                        const double *pixels1, const float *ratios,
                                        int32_t num_matches, const tv_estimate_options *options,
                                        tv_two_view *result, uint8_t *inlier_mask) {
  return estimate_evidence(context, camera0, camera1, pixels0, pixels1, ratios, num_matches,
                           options, result, NULL, inlier_mask);
}

#ifdef __cplusplus
// A result with the evidence of it, by value.
struct EstimatedPair : tv_two_view {
  tv_evidence evidence;
};
#endif

static inline tv_status triangulate_pixels(const tv_camera_pair *pair, const double *pixels0,
                                           const double *pixels1, int32_t num,
                                           tv_triangulation method, tv_point *points) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, num);
  return tv_triangulate(pair, &pairs, method, points);
}

static inline tv_status correct_pixels_of(const tv_camera_pair *pair, const double *pixels0,
                                          const double *pixels1, int32_t num, tv_triangulation cost,
                                          double *corrected0, double *corrected1, uint8_t *valid) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, num);
  return tv_correct_matches(pair, &pairs, cost, corrected0, corrected1, valid);
}

static inline tv_status adjust_pixels(tv_context *context, const double *pixels0,
                                      const double *pixels1, int32_t num_points,
                                      const tv_bundle_options *options, tv_camera_pair *pair,
                                      tv_point *points, tv_bundle_result *result) {
  const tv_pixel_pairs pairs = pairs_of(pixels0, pixels1, NULL, num_points);
  return tv_adjust_two_view(context, &pairs, options, pair, points, result);
}

#endif
