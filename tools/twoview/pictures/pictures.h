// The pictures that the verbs write. Each function returns an 8-bit BGR image.
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "pair/result.h"

namespace cli {

// Keypoints as rings of their size with a tick along their angle, coloured by pyramid level.
cv::Mat keypoints_picture(const Picture& picture, const std::vector<tv_keypoint>& keypoints);

// Matches as lines between the two images, coloured by the displacement of the point. If an inlier
// mask is given, outliers are drawn first, in faint red.
cv::Mat matches_picture(const Picture& picture0, const Picture& picture1,
                        const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                        const tv_correspondence* matches, int count, const uint8_t* inlier_mask);

// Well-spread inliers with their epipolar lines (curves if the lens distorts) in both images, and
// the positions of the epipoles. The outcome must have a pose or F.
cv::Mat epipolar_picture(const Outcome& outcome);
bool has_epipolar_geometry(const Outcome& outcome);

// The cloud from the front, as camera 0 sees it, and from the side. The axes are in metres, or in
// baselines. The outcome must have a full pose, and the cloud must not be empty.
cv::Mat views_picture(const Outcome& outcome, const std::vector<CloudPoint>& cloud);

}  // namespace cli
