// Estimates a camera from views of a chessboard, with OpenCV, and says how reliable it is.
#pragma once

#include <string>
#include <vector>

#include "calibration/board.h"
#include "twoview/camera.h"

namespace cli {

struct Board {
  cv::Size inner;     // number of inner corners in a row and in a column
  double square = 1;  // side of a square, metres
};

enum class Lens { kBrownConrady, kRational, kKannalaBrandt };
const char* lens_name(Lens lens);
// "k1" and so on, in the order of tv_camera's k.
std::vector<std::string> distortion_names(Lens lens);

// The estimated pose and the residuals of one view.
struct ViewFit {
  size_t view = 0;  // index of the view in the list of BoardViews
  double rms_px = 0;
  double tilt_deg = 0;                 // angle of the board's normal to the line of sight
  cv::Matx33d R;                       // rotation camera_from_board
  cv::Vec3d t;                         // translation camera_from_board, metres
  std::vector<cv::Point2d> residuals;  // measured minus projected corners, pixels
};

struct Calibration {
  Lens lens = Lens::kBrownConrady;
  tv_camera camera{};
  std::vector<double> sigma;  // standard deviations of fx fy cx cy and the distortion
  // Root mean square over all corners of the distance between measured and projected corner.
  double rms_px = 0;
  std::vector<ViewFit> fits;  // one ViewFit for each used view
  double coverage = 0;        // share of the 8 x 8 cells of the image that hold a corner
  std::string contradiction;  // views that were left out as those of another camera; or empty
};

constexpr int kMinViews = 3, kCells = 8;

// Estimates the camera from the used views. It repeats the estimate without the views whose error
// is far above that of the others, which it marks as outliers, and without a third of the views or
// less that another camera saw. Residuals are those of the library's lens models. Throws BadInput
// if OpenCV finds no camera, if tv_camera_check refuses the camera, if its lens does not reach a
// corner of the board, or if more than a third of at least ten views are of another camera.
Calibration calibrate_camera(std::vector<BoardView>& views, const Board& board, cv::Size image,
                             Lens lens);

// A reason why the estimated camera may be unreliable.
struct Warning {
  std::string name;   // the key in JSON, such as "few_views"
  std::string words;  // a sentence with the measured number and advice
};
std::vector<Warning> warnings_of(const Calibration& calibration);

// The number of corners in each cell of the image, row by row.
std::vector<int> corners_by_cell(const std::vector<BoardView>& views, cv::Size image);

}  // namespace cli
