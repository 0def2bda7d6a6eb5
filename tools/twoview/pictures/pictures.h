// The pictures that a run writes, each as 8-bit BGR.
#pragma once

#include <opencv2/core/mat.hpp>
#include <vector>

#include "pair/result.h"

namespace cli {

// Corners as rings of their size with a tick along their angle, coloured by pyramid level.
cv::Mat keypoints_picture(const Picture& picture, const std::vector<tv_keypoint>& keypoints);

// Matches as lines between the two images, coloured by how far the point moved. With an inlier
// mask, outliers are faint, red and drawn first.
cv::Mat matches_picture(const Picture& picture0, const Picture& picture1,
                        const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                        const tv_correspondence* matches, int count, const uint8_t* inlier_mask);

// Points of well-spread inliers with their epipolar lines (curves, when the lens distorts) in both
// images, and where the epipoles are. Needs a pose or F.
cv::Mat epipolar_picture(const Outcome& outcome);
bool has_epipolar_geometry(const Outcome& outcome);

// The cloud from the front, as camera 0 sees it, and from the side; axes in metres or
// in units of the distance between the cameras. The cloud is not empty.
cv::Mat views_picture(const Outcome& outcome, const std::vector<CloudPoint>& cloud);

}  // namespace cli
