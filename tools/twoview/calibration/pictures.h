// Pictures of a calibration: the detected boards, the coverage of the image, and the residuals.
#pragma once

#include "calibration/solve.h"

namespace cli {

// A contact sheet: each view with its corners, or with the reason why it is not used.
cv::Mat detections_picture(const std::vector<BoardView>& views, const Board& board);

// Where corners were seen in the image, and in which directions the board was tilted.
cv::Mat coverage_picture(const std::vector<BoardView>& views, const Board& board,
                         const Calibration& calibration);

// The residuals of the calibration: all in one plot, by position in the image, and by view.
cv::Mat residuals_picture(const std::vector<BoardView>& views, const Calibration& calibration);

}  // namespace cli
