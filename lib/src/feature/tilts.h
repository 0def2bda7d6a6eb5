// The views of an image in which the rungs of effort find keypoints: the image as it is, and
// squeezed ones. A plane that is seen at a slant is squeezed along one direction, so that a corner
// looks alike in a squeezed view of one picture and in the other picture as it is. J.-M. Morel, G.
// Yu, "ASIFT: a new framework for fully affine invariant image comparison", SIAM J. Imaging
// Sciences 2009. Which views, and why: docs/algorithms/effort.md; test: test/unit/test_tilts.cc.
#pragma once

#include "image/pyramid.h"
#include "image/squeeze.h"
#include "twoview/feature.h"

namespace tv {

inline constexpr int32_t kMaxEffort = 3;  // the highest rung
inline constexpr int32_t kNumTilts = 17;  // views of the highest rung; tilt 0 is the image itself
// The widest and the highest view, which is that of an image: larger squeezed ones are left out.
inline constexpr int32_t kMaxViewSide = 16384;
inline constexpr int32_t kMostRungKeypoints = 65535;  // their indices have 16 bits
// Pixels: the size of a keypoint on level 7 with the largest option keypoint_size, and the most of
// a mapped keypoint.
inline constexpr float kMostKeypointSize = 4096;

// How many tilts a rung has: 0 .. tilts_of_rung - 1.
int32_t tilts_of_rung(int32_t rung);

// The most keypoints of one view, and of all views of a rung, where max_keypoints is that of an
// image on rung 0.
int32_t view_budget(int32_t rung, int32_t tilt, int32_t max_keypoints);
int32_t rung_budget(int32_t rung, int32_t max_keypoints);

// Tilt 1 to kNumTilts - 1 of an image.
Squeeze squeeze_of(int32_t tilt, int32_t width, int32_t height);

// Whether a view is large enough for keypoints, and not too large.
bool is_usable(const Squeeze& squeeze);

// The direction that the patches of upright keypoints have in a view of this tilt. In the image
// these patches are squeezed and not turned.
float upright_angle_rad(int32_t tilt);

// Turns keypoints of a squeezed view into keypoints of the image: position, the angle of the
// patch's x axis, and the size of a square patch of the same area.
void map_keypoints(const Squeeze& squeeze, tv_keypoint* keypoints, int32_t count);

// The shape of a mapped keypoint's patch, row-major: its columns are the axes of the patch in the
// image, as long as the keypoint's size is in the view. For tilt 0 it is size times the rotation by
// the keypoint's angle.
void patch_shape(const tv_keypoint& keypoint, int32_t tilt, double shape[4]);

}  // namespace tv
