// Calibrates a camera from pictures of a chessboard with OpenCV, and writes it as OpenCV's YAML,
// which twoview reads.
// usage: 01_calibrate OUT.yaml COLUMNS ROWS IMAGE...     (inner corners of the board)
#include <cstdio>
#include <cstdlib>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

int main(int argc, char** argv) {
  if (argc < 7) {
    std::fprintf(stderr, "usage: 01_calibrate OUT.yaml COLUMNS ROWS IMAGE IMAGE IMAGE...\n");
    return 2;
  }
  const cv::Size inner(std::atoi(argv[2]), std::atoi(argv[3]));
  std::vector<cv::Point3f> board;  // unit: a square's side; its size does not affect K
  for (int y = 0; y < inner.height; ++y)
    for (int x = 0; x < inner.width; ++x) board.emplace_back(float(x), float(y), 0.0F);
  std::vector<std::vector<cv::Point2f>> seen;
  cv::Size size;
  for (int k = 4; k < argc; ++k) {
    const cv::Mat image = cv::imread(argv[k], cv::IMREAD_GRAYSCALE);
    if (image.empty() || (size.area() > 0 && image.size() != size)) {
      std::fprintf(stderr, "%s: no image, or of another size\n", argv[k]);
      return 2;
    }
    size = image.size();
    std::vector<cv::Point2f> corners;
    const int flags =
        cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK;
    if (!cv::findChessboardCorners(image, inner, corners, flags)) {
      std::printf("%s: no whole board\n", argv[k]);
      continue;
    }
    cv::cornerSubPix(image, corners, cv::Size(5, 5), cv::Size(-1, -1),
                     cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 40, 0.001));
    seen.push_back(corners);
  }
  if (seen.size() < 3) {
    std::fprintf(stderr, "only %zu boards: at least 3 are needed, 15 are better\n", seen.size());
    return 2;
  }
  cv::Mat K, distortion;
  std::vector<cv::Mat> rotations, translations;
  const double rms = cv::calibrateCamera(std::vector<std::vector<cv::Point3f>>(seen.size(), board),
                                         seen, size, K, distortion, rotations, translations);
  std::printf("%zu boards, %.3f px rms: fx %.2f fy %.2f cx %.2f cy %.2f\n", seen.size(), rms,
              K.at<double>(0, 0), K.at<double>(1, 1), K.at<double>(0, 2), K.at<double>(1, 2));
  cv::FileStorage out(argv[1], cv::FileStorage::WRITE);
  out << "image_width" << size.width << "image_height" << size.height << "camera_matrix" << K
      << "distortion_coefficients" << distortion;
  return out.isOpened() ? 0 : 2;
}
