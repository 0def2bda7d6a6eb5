// A camera from views of a chessboard, by OpenCV; and how far to trust it.
#pragma once

#include <string>
#include <vector>

#include "calibration/board.h"
#include "twoview/camera.h"

namespace cli {

struct Board {
  cv::Size inner;     // corners
  double square = 1;  // its side, metres
};

enum class Lens { kBrownConrady, kRational, kKannalaBrandt };
const char* lens_name(Lens lens);
// "k1" and so on, in the order of tv_camera's k.
std::vector<std::string> distortion_names(Lens lens);

// One view's pose and residuals.
struct ViewFit {
  size_t view = 0;  // index among the views
  double rms_px = 0;
  double tilt_deg = 0;  // between the board's normal and the line of sight to its middle
  cv::Matx33d R;        // camera_from_board
  cv::Vec3d t;          // metres
  std::vector<cv::Point2d> residuals;  // seen less projected, pixels
};

struct Calibration {
  Lens lens = Lens::kBrownConrady;
  tv_camera camera{};
  std::vector<double> sigma;  // standard deviations: fx fy cx cy, then the distortion
  double rms_px = 0;          // over corners, of the distance
  std::vector<ViewFit> fits;  // of the views in use
  double coverage = 0;        // share of the image's 8 x 8 cells with a corner
};

constexpr int kMinViews = 3, kCells = 8;

// Solves from the views in use, again and again without the views whose error is far above the
// others; those become outliers. Residuals are by the library's own lens models. Throws BadInput
// where OpenCV finds no camera.
Calibration calibrate_camera(std::vector<BoardView>& views, const Board& board, cv::Size image,
                             Lens lens);

// A reason for not trusting the camera.
struct Warning {
  std::string name;   // "few_views"
  std::string words;  // with the number and what to do
};
std::vector<Warning> warnings_of(const Calibration& calibration);

// Of the cells of the image, row by row, how many corners each holds.
std::vector<int> corners_by_cell(const std::vector<BoardView>& views, cv::Size image);

}  // namespace cli
