// Chessboards in pictures: found within a bound of time, and refused with a reason.
#pragma once

#include <opencv2/core.hpp>
#include <string>
#include <vector>

namespace cli {

using Corners = std::vector<cv::Point2f>;  // row by row; (0, 0) is the centre of the first pixel

// Why a view of the board is left out; kUsed: it is not.
enum class Reason {
  kUsed,
  kTooDark,       // no board, and hardly anything above black
  kNoBoard,       // nothing like a chessboard
  kPartialBoard,  // a chessboard, but not all of it
  kOtherBoard,    // a chessboard of more corners
  kTimeLimit,     // the search was ended
  kBlurred,       // edges rise too slowly to place a corner
  kDuplicate,     // the board stands where an earlier view has it
  kSurplus,       // more views than --max-views
  kOutlier        // its error is far above the others'
};
const char* reason_name(Reason reason);   // "partial_board", as in JSON
const char* reason_words(Reason reason);  // "only a part of the board is seen"

struct BoardView {
  std::string name;
  Reason reason = Reason::kUsed;
  std::string detail;       // numbers behind the reason, for people; may be empty
  cv::Size seen;            // inner corners of the chessboard that is there instead; 0 unless known
  Corners corners;          // of the whole board, where it was found
  double edge_rise_px = 0;  // from 10 to 90 per cent, across the board's edges
  cv::Mat thumbnail;        // grey
  double thumbnail_scale = 1;
  bool has_board() const { return !corners.empty(); }
  bool is_used() const { return reason == Reason::kUsed; }
};

// Searches an 8-bit image for the whole board in a process of its own, which ends after
// `limit_seconds` of CPU time: OpenCV has been seen to take minutes on a dark image.
// `likely_other`: a board that may well be there instead, looked for before the searches that take
// seconds to be sure that ours is not; an empty size for none. The first row and column are such
// that the square between the first four corners is dark, where the board's shape lets that be
// chosen.
BoardView find_board(const cv::Mat& luma, const std::string& name, cv::Size inner,
                     cv::Size likely_other, int limit_seconds);

// Marks views as blurred, duplicates and surplus, in the views' order.
void reject_blurred(std::vector<BoardView>& views);
void reject_duplicates(std::vector<BoardView>& views, cv::Size image);
void reject_surplus(std::vector<BoardView>& views, int max_views);

// Root mean square distance between the corners of two views, whichever end of the board is first.
double distance_px(const Corners& a, const Corners& b);

}  // namespace cli
