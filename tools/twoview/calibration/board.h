// Detection of a chessboard in a picture within a time limit, and the reasons for which a view is
// rejected.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace cli {

// Corners row by row, in pixels; (0, 0) is the centre of the first pixel.
using Corners = std::vector<cv::Point2f>;

// The reason why a view of the board is not used; kUsed means that it is used.
enum class Reason {
  kUsed,
  kTooDark,       // no board found, and hardly any pixel is above black
  kNoBoard,       // no chessboard found
  kPartialBoard,  // a chessboard with fewer inner corners than requested, or a cut-off one
  kOtherBoard,    // a chessboard with more inner corners, or a part of a larger one
  kTimeLimit,     // the search reached its time limit, or crashed
  kBlurred,       // the edges rise too slowly to locate a corner
  kDuplicate,     // the board has the position of an earlier view
  kSurplus,       // --max-views other views are used
  kOutlier,       // its reprojection error is far above the median
  kUnreadable,    // the picture cannot be read
  kOtherSize      // the picture is of another size than most
};
const char* reason_name(Reason reason);   // for JSON, such as "partial_board"
const char* reason_words(Reason reason);  // for people, such as "a part of the board"

struct BoardView {
  std::string name;
  Reason reason = Reason::kUsed;
  std::string detail;       // the measured numbers that explain the reason; may be empty
  cv::Size seen;            // inner corners of another chessboard that was found; 0 if none
  Corners corners;          // of the requested board; empty if it was not found
  double edge_rise_px = 0;  // distance over which edges rise from 10 to 90 %, pixels
  cv::Mat thumbnail;        // a small grey picture of the view
  double thumbnail_scale = 1;
  bool has_board() const { return !corners.empty(); }
  bool is_used() const { return reason == Reason::kUsed; }
};

// Searches an 8-bit image for the whole board: quickly, then thoroughly. Each search runs in a
// process of its own, which is ended after a limit of CPU time (or 8 times as long by the clock),
// since OpenCV can take minutes on a dark image: 1 s for the quick search, `limit_seconds` for the
// thorough one. Where another board than the requested one is likely, the quick search is left out:
// it takes long on such an image and cannot say which board that is. The corners are ordered so
// that the square at the first corner is dark, if columns plus rows of inner corners are odd.
BoardView find_board(const cv::Mat& luma, const std::string& name, cv::Size inner,
                     bool is_other_likely, int limit_seconds);

// Mark views as blurred, duplicate or surplus, in the order of the views.
void reject_blurred(std::vector<BoardView>& views);
void reject_duplicates(std::vector<BoardView>& views, cv::Size image);
void reject_surplus(std::vector<BoardView>& views, int max_views);

// The root mean square distance between the corners of two views, in the better of the two orders
// of the corners.
double distance_px(const Corners& a, const Corners& b);

}  // namespace cli
