// OpenCV's counterparts of our stages, written as a user of OpenCV would write them.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "images.h"
#include "twoview/twoview.h"

namespace bench {

struct OpencvFeatures {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;  // one row of 128 floats for each keypoint
};

// Converts our keypoints to OpenCV's, on octave 0 and layer 0, so that SIFT::compute builds only
// one octave and describes each keypoint at its own size.
std::vector<cv::KeyPoint> opencv_keypoints(const tv_keypoint* keypoints, int count);

// FAST-9 with non-maximum suppression, the max_keypoints strongest corners, and their upright SIFT
// descriptors with keypoint diameter `size` in pixels.
OpencvFeatures opencv_fast_sift(const cv::Mat& image, int threshold, int max_keypoints, float size);
OpencvFeatures opencv_sift(const cv::Mat& image, int max_keypoints);

using IndexPairs = std::vector<std::pair<int, int>>;

// Matches like tv_match: BFMatcher finds the two nearest neighbours in both directions, and a pair
// is a match if each is the other's nearest neighbour and both pass the ratio test.
IndexPairs opencv_match(const cv::Mat& descriptors0, const cv::Mat& descriptors1, float ratio);

struct OpencvPose {
  cv::Mat R, t, inlier_mask;  // R is empty if no pose was found
};
OpencvPose opencv_estimate(const std::vector<cv::Point2d>& pixels0,
                           const std::vector<cv::Point2d>& pixels1, const tv_camera cameras[2],
                           int method, double confidence, double max_error_px);

// The result of matching, estimation and triangulation of a pair.
struct OpencvPair {
  OpencvPose pose;
  size_t num_keypoints[2], num_matches;
  int num_inliers;
  cv::Mat points;  // homogeneous, a column of 4 for each inlier
};
OpencvPair opencv_reconstruct(const OpencvFeatures features[2], const tv_camera cameras[2],
                              float ratio);

cv::Matx33d opencv_K(const tv_camera& camera);

}  // namespace bench
