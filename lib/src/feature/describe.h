// Orientation and SIFT descriptors of keypoints.
#pragma once

#include "image/pyramid.h"
#include "twoview/feature.h"

namespace tv {

// The octave whose pixels come nearest to the samples of a patch of this keypoint.
int32_t octave_of(float keypoint_size);

// The octaves that these keypoints need.
struct OctaveRange {
  int32_t first, last;
};
OctaveRange octave_range(const tv_keypoint* keypoints, int32_t count);

// The angles of the peaks of the gradient histogram, the highest first; returns 1 or 2.
int32_t dominant_angles(const tvk_table& kernels, const Octaves& octaves,
                        const tv_keypoint& keypoint, float angles_rad[2]);

// TV_DESCRIPTOR_BYTES bytes; descriptor is a tv_normalisation.
void describe_keypoint(const tvk_table& kernels, const Octaves& octaves,
                       const tv_keypoint& keypoint, int32_t kind, uint8_t* descriptor);

}  // namespace tv
