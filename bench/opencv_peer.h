// OpenCV's part of the work, as its user would write it; each function stands for a stage of ours.
#pragma once

#include <opencv2/core.hpp>
#include <vector>

#include "images.h"
#include "twoview/twoview.h"

namespace bench {

struct OpencvFeatures {
  std::vector<cv::KeyPoint> keypoints;
  cv::Mat descriptors;  // float, 128 columns
};

// Keypoints on octave 0, layer 0, so that SIFT::compute builds one octave and describes at `size`.
std::vector<cv::KeyPoint> opencv_keypoints(const tv_keypoint* keypoints, int count);

// FAST-9 with suppression, the best max_keypoints, and upright SIFT descriptors of that size.
OpencvFeatures opencv_fast_sift(const cv::Mat& image, int threshold, int max_keypoints, float size);
OpencvFeatures opencv_sift(const cv::Mat& image, int max_keypoints);

using IndexPairs = std::vector<std::pair<int, int>>;

// Two nearest neighbours by BFMatcher in both directions; a pair is kept where each is the other's
// nearest and both pass the ratio test: what tv_match gives.
IndexPairs opencv_match(const cv::Mat& descriptors0, const cv::Mat& descriptors1, float ratio);

struct OpencvPose {
  cv::Mat R, t, inlier_mask;  // R empty: no pose
};
OpencvPose opencv_estimate(const std::vector<cv::Point2d>& pixels0,
                           const std::vector<cv::Point2d>& pixels1, const tv_camera cameras[2],
                           int method, double confidence, double max_error_px);

// All of it: images to pose and points.
struct OpencvPair {
  OpencvPose pose;
  size_t num_keypoints[2], num_matches;
  int num_inliers;
  cv::Mat points;  // 4 x inliers
};
OpencvPair opencv_reconstruct(const OpencvFeatures features[2], const tv_camera cameras[2],
                              float ratio);

cv::Matx33d opencv_K(const tv_camera& camera);

}  // namespace bench
