#include "opencv_peer.h"

#include <opencv2/calib3d.hpp>
#include <opencv2/features2d.hpp>

namespace bench {
namespace {

constexpr float kDegrees = 57.29577951f;

bool passes(const std::vector<cv::DMatch>& two, float ratio) {
  return two.size() == 2 && two[0].distance < ratio * two[1].distance;
}

}  // namespace

cv::Matx33d opencv_K(const tv_camera& camera) {
  return cv::Matx33d(camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1);
}

std::vector<cv::KeyPoint> opencv_keypoints(const tv_keypoint* keypoints, int count) {
  std::vector<cv::KeyPoint> converted;
  for (int k = 0; k < count; ++k) {
    const tv_keypoint& p = keypoints[k];
    const float degrees = p.angle_rad * kDegrees;
    converted.emplace_back(p.x, p.y, p.size, degrees < 0 ? degrees + 360 : degrees, p.score, 0, k);
  }
  return converted;
}

OpencvFeatures opencv_fast_sift(const cv::Mat& image, int threshold, int max_keypoints,
                                float size) {
  OpencvFeatures features;
  cv::FAST(image, features.keypoints, threshold, true);
  cv::KeyPointsFilter::retainBest(features.keypoints, max_keypoints);
  for (cv::KeyPoint& keypoint : features.keypoints) keypoint.size = size, keypoint.angle = 0;
  cv::SIFT::create()->compute(image, features.keypoints, features.descriptors);
  return features;
}

OpencvFeatures opencv_sift(const cv::Mat& image, int max_keypoints) {
  OpencvFeatures features;
  cv::SIFT::create(max_keypoints)
      ->detectAndCompute(image, cv::noArray(), features.keypoints, features.descriptors);
  return features;
}

IndexPairs opencv_match(const cv::Mat& descriptors0, const cv::Mat& descriptors1, float ratio) {
  const cv::BFMatcher matcher(cv::NORM_L2);
  std::vector<std::vector<cv::DMatch>> forward, back;
  matcher.knnMatch(descriptors0, descriptors1, forward, 2);
  matcher.knnMatch(descriptors1, descriptors0, back, 2);
  IndexPairs pairs;
  for (size_t i = 0; i < forward.size(); ++i) {
    if (!passes(forward[i], ratio)) continue;
    const auto& other = back[static_cast<size_t>(forward[i][0].trainIdx)];
    if (passes(other, ratio) && other[0].trainIdx == static_cast<int>(i)) {
      pairs.emplace_back(static_cast<int>(i), forward[i][0].trainIdx);
    }
  }
  return pairs;
}

OpencvPose opencv_estimate(const std::vector<cv::Point2d>& pixels0,
                           const std::vector<cv::Point2d>& pixels1, const tv_camera cameras[2],
                           int method, double confidence, double max_error_px) {
  // findEssentialMat takes one K: the second view's pixels are converted to the first camera's.
  const tv_camera &a = cameras[0], &b = cameras[1];
  std::vector<cv::Point2d> moved1 = pixels1;
  for (cv::Point2d& p : moved1) {
    p = cv::Point2d((p.x - b.cx) * a.fx / b.fx + a.cx, (p.y - b.cy) * a.fy / b.fy + a.cy);
  }
  OpencvPose pose;
  const cv::Matx33d K = opencv_K(a);
  const cv::Mat E = cv::findEssentialMat(pixels0, moved1, K, method, confidence, max_error_px,
                                         10000, pose.inlier_mask);
  if (E.rows != 3 || E.cols != 3) return pose;
  // 1e9 removes the limit of the depth: by default points beyond 50 baselines are no inliers.
  cv::recoverPose(E, pixels0, moved1, K, pose.R, pose.t, 1e9, pose.inlier_mask);
  return pose;
}

OpencvPair opencv_reconstruct(const OpencvFeatures features[2], const tv_camera cameras[2],
                              float ratio) {
  OpencvPair result{};
  const IndexPairs pairs = opencv_match(features[0].descriptors, features[1].descriptors, ratio);
  std::vector<cv::Point2d> pixels[2];
  for (const auto& [i, j] : pairs) {
    pixels[0].emplace_back(features[0].keypoints[static_cast<size_t>(i)].pt);
    pixels[1].emplace_back(features[1].keypoints[static_cast<size_t>(j)].pt);
  }
  for (int v = 0; v < 2; ++v) result.num_keypoints[v] = features[v].keypoints.size();
  result.num_matches = pairs.size();
  if (pairs.size() < 5) return result;
  result.pose = opencv_estimate(pixels[0], pixels[1], cameras, cv::USAC_MAGSAC, 0.9999, 1.0);
  if (result.pose.R.empty()) return result;
  std::vector<cv::Point2d> inliers[2];
  for (size_t k = 0; k < pairs.size(); ++k) {
    if (!result.pose.inlier_mask.at<uchar>(static_cast<int>(k))) continue;
    for (int v = 0; v < 2; ++v) inliers[v].push_back(pixels[v][k]);
  }
  result.num_inliers = static_cast<int>(inliers[0].size());
  if (inliers[0].empty()) return result;
  cv::Mat motion;
  cv::hconcat(result.pose.R, result.pose.t, motion);
  cv::triangulatePoints(opencv_K(cameras[0]) * cv::Matx34d::eye(),
                        cv::Mat(opencv_K(cameras[1])) * motion, inliers[0], inliers[1],
                        result.points);
  return result;
}

}  // namespace bench
