// Pictures of a calibration: the boards found, the coverage of the image, the residuals.
#pragma once

#include "calibration/solve.h"

namespace cli {

// A contact sheet: each view with its corners, or with the reason why it is left out.
cv::Mat detections_picture(const std::vector<BoardView>& views, const Board& board);

// Where in the image corners were seen, and to which sides the board was tilted.
cv::Mat coverage_picture(const std::vector<BoardView>& views, const Board& board,
                         const Calibration& calibration);

// The residuals of the camera: all of them, by place in the image, and by view.
cv::Mat residuals_picture(const std::vector<BoardView>& views, const Calibration& calibration);

}  // namespace cli
