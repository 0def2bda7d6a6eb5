// Orientation and SIFT descriptors of keypoints.
#pragma once

#include "image/pyramid.h"
#include "twoview/feature.h"

namespace tv {

// The octave for a keypoint of this size: there, the samples of its descriptor are 1.12 to 2.24
// pixels apart, closer only in octave 0 and wider only in the last one.
int32_t octave_of(double keypoint_size);

// The first and the last octave that these keypoints need, for make_octaves. `pooling` is as in
// tv_feature_options.
struct OctaveRange {
  int32_t first, last;
};
OctaveRange octave_range(const tv_keypoint* keypoints, int32_t count, int32_t pooling);

// Writes the angles of the one or two peaks of the gradient histogram, the highest first. Returns
// how many.
int32_t dominant_angles(const tvk_set& set, const Octaves& octaves, const tv_keypoint& keypoint,
                        float angles_rad[2]);

// Writes the descriptors, TV_DESCRIPTOR_BYTES bytes each. `kind` is a tv_normalisation; `pooling`
// is as in tv_feature_options.
void describe_keypoints(const tvk_set& set, const Octaves& octaves, const tv_keypoint* keypoints,
                        int32_t count, int32_t kind, int32_t pooling, uint8_t* descriptors);

}  // namespace tv
