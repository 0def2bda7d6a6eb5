// Where the estimate corrects the principal point, the program must draw the pair's pictures with
// the corrected camera. Objects with destructors are used only inside functions that return plain
// values, since Unity leaves a failing test by longjmp, which skips destructors.

#include <array>
#include <cmath>
#include <opencv2/core.hpp>
#include <vector>

#include "pair/measures.h"
#include "pair/result.h"
#include "pictures/pictures.h"

// unity.h comes after all other headers: it defines isnan and isinf as macros.
#include "unity.h"

using namespace cli;

void setUp(void) {}
void tearDown(void) {}

namespace {

constexpr int kWidth = 640, kHeight = 480, kMatches = 12;
constexpr double kFocal = 500, kCx = 330, kCy = 230;
constexpr double kShift[2] = {-25, 15};

// A grey pair with a pose and matches over the whole image; has_cameras says whether cameras are
// given.
struct Case {
  std::vector<tv_keypoint> keypoints[2];
  std::vector<tv_correspondence> matches;
  std::vector<uint8_t> inliers;
  Outcome outcome;

  explicit Case(bool has_cameras) : inliers(kMatches, 1) {
    for (int k = 0; k < kMatches; ++k) {
      tv_keypoint keypoint{};
      keypoint.x = static_cast<float>(60 + 45 * k);
      keypoint.y = static_cast<float>(40 + 150 * k % 400);
      for (auto& list : keypoints) list.push_back(keypoint);
      tv_correspondence match{};
      match.idx0 = match.idx1 = k;
      matches.push_back(match);
    }
    outcome.has_cameras = has_cameras;
    for (int i = 0; i < 2; ++i) {
      outcome.picture[i].luma = cv::Mat(kHeight, kWidth, CV_8U, cv::Scalar(90));
      outcome.picture[i].name = "grey";
      tv_camera& camera = outcome.camera[i];
      camera.model = TV_CAMERA_PINHOLE;
      camera.width = kWidth;
      camera.height = kHeight;
      camera.fx = camera.fy = kFocal;
      camera.cx = kCx;
      camera.cy = kCy;
      outcome.reconstruction.keypoints[i] = keypoints[i].data();
    }
    outcome.reconstruction.num_matches = kMatches;
    outcome.reconstruction.matches = matches.data();
    outcome.reconstruction.inlier_mask = inliers.data();
    tv_two_view_init(&outcome.two_view);
  }
};

const Matrix3 kR = {std::cos(0.3), 0, std::sin(0.3), 0, 1, 0, -std::sin(0.3), 0, std::cos(0.3)};
const Vector3 kT = {0.6, 0.0, 0.8};

// The epipolar picture drawn from pose and cameras, with a shift of the principal point.
cv::Mat by_rays() {
  Case c(true);
  tv_two_view& v = c.outcome.two_view;
  std::copy(kR.begin(), kR.end(), v.R);
  std::copy(kT.begin(), kT.end(), v.t);
  v.has_R = v.has_t = 1;
  std::copy(kShift, kShift + 2, v.principal_point_shift);
  return epipolar_picture(c.outcome);
}

// The same picture drawn from the fundamental matrix of cameras with this principal point; the
// drawing code reads no camera.
cv::Mat by_F(double cx, double cy) {
  Case c(false);
  const Matrix3 inverse = {1 / kFocal, 0, -cx / kFocal, 0, 1 / kFocal, -cy / kFocal, 0, 0, 1};
  const Matrix3 skew = {0, -kT[2], kT[1], kT[2], 0, -kT[0], -kT[1], kT[0], 0};
  const Matrix3 F = product(product(transposed(inverse), product(skew, kR)), inverse);
  std::copy(F.begin(), F.end(), c.outcome.two_view.F);
  c.outcome.two_view.has_F = 1;
  return epipolar_picture(c.outcome);
}

// The share of samples that differ by more than 60 of 255, which anti-aliasing does not reach.
double difference(const cv::Mat& a, const cv::Mat& b) {
  cv::Mat gap;
  if (a.size() != b.size()) return 1;
  cv::absdiff(a, b, gap);
  const cv::Mat samples = gap.reshape(1);
  return static_cast<double>(cv::countNonZero(samples > 60)) / static_cast<double>(samples.total());
}

// `difference` of the picture drawn from cameras and the one drawn from F: a share from 0 to 1.
double difference_from(double cx, double cy) { return difference(by_rays(), by_F(cx, cy)); }

void test_epipolar_lines_and_epipoles_are_of_the_corrected_camera() {
  TEST_ASSERT_DOUBLE_WITHIN(0.002, 0, difference_from(kCx + kShift[0], kCy + kShift[1]));
  TEST_ASSERT_TRUE(difference_from(kCx, kCy) > 0.01);
}

}  // namespace

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_epipolar_lines_and_epipoles_are_of_the_corrected_camera);
  return UNITY_END();
}
