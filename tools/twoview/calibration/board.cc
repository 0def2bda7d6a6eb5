#include "calibration/board.h"

#include <poll.h>
#include <sys/prctl.h>
#include <sys/resource.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <chrono>
#include <cmath>
#include <csignal>
#include <cstring>
#include <opencv2/calib3d.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "base/median.h"

namespace cli {
namespace {

constexpr int kSearchSide = 1280;    // longer side of the image that is searched, pixels
constexpr int kThumbnailSide = 400;  // longer side of a thumbnail on the contact sheet, pixels
// An image is dark if fewer than 1 % of its pixels are above this grey level.
constexpr int kDarkLevel = 40;
// A chessboard that is not the requested one, or a part of the requested one, is reported only if
// at least this many inner corners are seen in each direction.
const cv::Size kSmallestBoard(3, 3);
// In a sharp picture of any size the board's edges rise within 2 to 4 px.
constexpr double kMaxRisePx = 5, kMaxRiseOfMedian = 1.8;
// Two views are duplicates if their distance_px is below this share of the image's diagonal.
constexpr double kMinMoveShare = 0.015;
// A grid is a part of a larger board if the second row of squares outside its corners has more than
// this share of the contrast of the row inside them.
constexpr double kLargerBoardShare = 0.4;
// The wall-clock limit is this many times the CPU limit, for a busy machine.
constexpr int kWallPerCpu = 8;
// CPU limit of the quick search. It finds a board in 2 to 30 ms, or it may search for 4 s.
constexpr int kQuickSeconds = 1;

double longer_side(cv::Size size) { return std::max(size.width, size.height); }

cv::Mat shrunk(const cv::Mat& image, int longer, double& scale) {
  scale = std::min(1.0, longer / longer_side(image.size()));
  if (scale == 1) return image;
  cv::Mat small;
  const cv::Size size(std::max(1L, std::lround(image.cols * scale)),
                      std::max(1L, std::lround(image.rows * scale)));
  cv::resize(image, small, size, 0, 0, cv::INTER_AREA);
  return small;
}

// Access to the corners by row and column, for any storage order.
struct Grid {
  const Corners& corners;
  cv::Size inner;
  cv::Point2f at(int row, int column) const {
    return corners[static_cast<size_t>(row * inner.width + column)];
  }
};

double mean_around(const cv::Mat& luma, cv::Point2f place) {
  const cv::Rect box(cvRound(place.x) - 1, cvRound(place.y) - 1, 3, 3);
  const cv::Rect whole(0, 0, luma.cols, luma.rows);
  return (box & whole) == box ? cv::mean(luma(box))[0] : -1;
}

// The smallest grey-level step between neighbouring squares along a side of the grid, measured
// `squares_out` squares outside the outermost corners (-0.5: within the first squares inside).
// `line` holds the corners of that side, `next` the corners one row further in. The result is
// positive if the squares alternate and the first one is darker, negative if they alternate and the
// first one is brighter, and 0 if they do not alternate.
double alternation(const cv::Mat& luma, const Corners& line, const Corners& next,
                   float squares_out) {
  std::vector<double> greys;
  for (size_t i = 0; i + 1 < line.size(); ++i) {
    const cv::Point2f middle = 0.5F * (line[i] + line[i + 1]);
    const cv::Point2f inward = 0.5F * (next[i] + next[i + 1]) - middle;
    const double grey = mean_around(luma, middle - squares_out * inward);
    if (grey < 0) return 0;  // the position is outside the image
    greys.push_back(grey);
  }
  double least = 255, most = -255;
  for (size_t i = 0; i + 1 < greys.size(); ++i) {
    const double step = (i % 2 ? -1 : 1) * (greys[i + 1] - greys[i]);
    least = std::min(least, step);
    most = std::max(most, step);
  }
  return least > 0 ? least : most < 0 ? most : 0;
}

// Whether the squares between the corners alternate as on a chessboard. The check is needed because
// in a larger board OpenCV also finds grids that run diagonally.
bool squares_alternate(const cv::Mat& luma, const Grid& grid) {
  const auto square = [&](int r, int c) {
    return mean_around(luma, 0.25F * (grid.at(r, c) + grid.at(r, c + 1) + grid.at(r + 1, c) +
                                      grid.at(r + 1, c + 1)));
  };
  const bool first_is_dark = square(0, 0) < square(0, 1);
  for (int r = 0; r + 1 < grid.inner.height; ++r)
    for (int c = 0; c + 1 < grid.inner.width; ++c) {
      const bool is_dark = ((r + c) % 2 == 0) == first_is_dark;
      const double own = square(r, c);
      if (c + 2 < grid.inner.width && (own < square(r, c + 1)) != is_dark) return false;
      if (r + 2 < grid.inner.height && (own < square(r + 1, c)) != is_dark) return false;
    }
  return true;
}

// Whether the grid is a part of a larger board, which OpenCV also accepts. Outside its last inner
// corners a board has one more row of squares; a larger board has a second one.
bool is_part_of_a_larger_board(const cv::Mat& luma, const Grid& grid) {
  const auto line = [&](bool row, int index) {
    Corners corners;
    for (int i = 0; i < (row ? grid.inner.width : grid.inner.height); ++i)
      corners.push_back(row ? grid.at(index, i) : grid.at(i, index));
    return corners;
  };
  for (const bool row : {true, false}) {
    const int last = (row ? grid.inner.height : grid.inner.width) - 1;
    for (const auto& [outer, next] : {std::pair(0, 1), std::pair(last, last - 1)}) {
      const Corners side = line(row, outer), inside = line(row, next);
      // Rows of squares alternate with period two: compare the row inside the outermost corners
      // with the second row outside them, which only a larger board has.
      const double own = alternation(luma, side, inside, -0.5F);
      const double beyond = alternation(luma, side, inside, 1.5F);
      if (own != 0 && beyond / own > kLargerBoardShare) return true;
    }
  }
  return false;
}

// Half the side of cornerSubPix's search window. With 0.4 of a square, corners at the border of
// OpenCV's boards, whose outermost squares are half as wide, moved by several pixels; 0.3 is safe.
int refinement_reach(const Grid& grid) {
  double least = 1e9;
  for (int r = 0; r < grid.inner.height; ++r)
    for (int c = 0; c < grid.inner.width; ++c) {
      if (c > 0) least = std::min(least, cv::norm(grid.at(r, c) - grid.at(r, c - 1)));
      if (r > 0) least = std::min(least, cv::norm(grid.at(r, c) - grid.at(r - 1, c)));
    }
  return std::clamp(static_cast<int>(0.3 * least), 2, 11);
}

// Reverses the order of the corners (a rotation of the board by 180 degrees) if this makes the
// first square dark. A board whose columns plus rows of inner corners are odd then has one order in
// all views; other boards look the same after that rotation, and keep OpenCV's order.
void begin_with_a_dark_square(const cv::Mat& luma, cv::Size inner, Corners& corners) {
  const Grid grid{corners, inner};
  const auto square = [&](int r, int c) {
    const cv::Point2f middle =
        0.25F * (grid.at(r, c) + grid.at(r, c + 1) + grid.at(r + 1, c) + grid.at(r + 1, c + 1));
    return mean_around(luma, middle);
  };
  if (square(0, 0) > square(inner.height - 2, inner.width - 2) && (inner.width + inner.height) % 2)
    std::reverse(corners.begin(), corners.end());
}

double edge_rise_px(const cv::Mat& luma, cv::Size inner, const Corners& corners) {
  double rise = 0;  // the larger of both directions: motion blurs one
  for (const bool vertical : {false, true})
    rise = std::max(
        rise, double(cv::estimateChessboardSharpness(luma, inner, corners, 0.8F, vertical)[0]));
  return rise;
}

// The result of the search as it is sent through the pipe; the corners follow it.
struct Found {
  Reason reason = Reason::kNoBoard;
  int32_t seen_width = 0, seen_height = 0;
  double edge_rise_px = 0;
  uint32_t num_corners = 0;
};

bool is_dark(const cv::Mat& image) {
  const cv::Mat bright = image > kDarkLevel;
  return cv::countNonZero(bright) < static_cast<int>(image.total() / 100);
}

// Searches for a chessboard of another size than the requested one.
void look_for_any_board(const cv::Mat& small, cv::Size inner, Found& found) {
  Corners corners;
  cv::Mat meta;  // output of OpenCV: its size is the number of corners
  if (!cv::findChessboardCornersSB(small, kSmallestBoard, corners,
                                   cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_LARGER, meta))
    return;
  cv::Size seen = meta.size();
  if ((seen.width < seen.height) != (inner.width < inner.height))
    std::swap(seen.width, seen.height);
  // The grid has the requested size, but the search for a board of this size refused it: so it is a
  // part of the board together with something beside the board.
  if (seen == inner) {
    found.reason = Reason::kPartialBoard;
    return;
  }
  found.seen_width = seen.width;
  found.seen_height = seen.height;
  const bool holds_ours = seen.width >= inner.width && seen.height >= inner.height;
  found.reason = holds_ours ? Reason::kOtherBoard : Reason::kPartialBoard;
}

// OpenCV's fast check rejects most images without a board. In a 640x480 image with a larger board,
// OpenCV 4.6 takes 4 s to reject it.
bool quick_search(const cv::Mat& small, cv::Size inner, Corners& corners) {
  return cv::findChessboardCorners(
      small, inner, corners,
      cv::CALIB_CB_ADAPTIVE_THRESH | cv::CALIB_CB_NORMALIZE_IMAGE | cv::CALIB_CB_FAST_CHECK);
}

// Searches with findChessboardCornersSB, which takes 0.1 s in a 640x480 image and tolerates more
// noise and blur.
bool thorough_search(const cv::Mat& small, cv::Size inner, Corners& corners) {
  return cv::findChessboardCornersSB(small, inner, corners, cv::CALIB_CB_NORMALIZE_IMAGE);
}

enum class Search { kQuick, kThorough };

Found search(const cv::Mat& luma, cv::Size inner, Search how, Corners& corners) {
  Found found;
  double scale = 1;
  const cv::Mat small = shrunk(luma, kSearchSide, scale);
  const bool is_whole = how == Search::kQuick ? quick_search(small, inner, corners)
                                              : thorough_search(small, inner, corners);
  if (!is_whole || corners.size() != static_cast<size_t>(inner.area())) {
    corners.clear();
    if (how == Search::kQuick) return found;
    if (is_dark(small)) found.reason = Reason::kTooDark;
    look_for_any_board(small, inner, found);
    return found;
  }
  const auto to_full = static_cast<float>(1 / scale);
  for (cv::Point2f& corner : corners)
    corner = (corner + cv::Point2f(0.5F, 0.5F)) * to_full - cv::Point2f(0.5F, 0.5F);
  const int reach = refinement_reach({corners, inner});
  cv::cornerSubPix(luma, corners, cv::Size(reach, reach), cv::Size(-1, -1),
                   cv::TermCriteria(cv::TermCriteria::EPS + cv::TermCriteria::COUNT, 100, 0.0005));
  const Grid grid{corners, inner};
  if (!squares_alternate(luma, grid) || is_part_of_a_larger_board(luma, grid)) {
    corners.clear();
    look_for_any_board(small, inner, found);
    if (found.reason != Reason::kPartialBoard) found.reason = Reason::kOtherBoard;
    return found;
  }
  begin_with_a_dark_square(luma, inner, corners);
  found.reason = Reason::kUsed;
  found.edge_rise_px = edge_rise_px(luma, inner, corners);
  return found;
}

bool write_all(int file, const void* data, size_t size) {
  const char* at = static_cast<const char*>(data);
  while (size > 0) {
    const ssize_t done = ::write(file, at, size);
    if (done <= 0) return false;
    at += done;
    size -= static_cast<size_t>(done);
  }
  return true;
}

[[noreturn]] void search_as_child(int to_parent, const cv::Mat& luma, cv::Size inner, Search how,
                                  int limit_seconds) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);  // the kernel kills this child if the parent ends
  const rlim_t seconds = static_cast<rlim_t>(limit_seconds);
  const rlimit limit{seconds, seconds + 1}, no_core{0, 0};
  ::setrlimit(RLIMIT_CPU, &limit);
  ::setrlimit(RLIMIT_CORE, &no_core);
  ::signal(SIGXCPU, SIG_DFL);
  Corners corners;
  Found found;
  try {
    found = search(luma, inner, how, corners);
  } catch (const std::exception&) {  // thrown by OpenCV for an image of a few pixels
    found = Found{};
    corners.clear();
  }
  found.num_corners = static_cast<uint32_t>(corners.size());
  const bool is_sent = write_all(to_parent, &found, sizeof found) &&
                       write_all(to_parent, corners.data(), corners.size() * sizeof corners[0]);
  ::_exit(is_sent ? 0 : 1);
}

// Reads from the pipe until its other end closes or the time is over.
std::string read_until(int from_child, std::chrono::steady_clock::time_point end) {
  std::string bytes;
  char part[4096];
  for (;;) {
    const auto left = std::chrono::duration_cast<std::chrono::milliseconds>(
        end - std::chrono::steady_clock::now());
    pollfd wait{from_child, POLLIN, 0};
    const int ready = left.count() > 0 ? ::poll(&wait, 1, static_cast<int>(left.count())) : 0;
    if (ready < 0 && errno == EINTR) continue;
    if (ready <= 0) return bytes;
    const ssize_t count = ::read(from_child, part, sizeof part);
    if (count < 0 && errno == EINTR) continue;
    if (count <= 0) return bytes;
    bytes.append(part, static_cast<size_t>(count));
  }
}

// Returns false when the search was ended by its time limit or crashed.
bool search_in_child(const cv::Mat& luma, cv::Size inner, Search how, int limit_seconds,
                     Found& found, Corners& corners) {
  int pipe_ends[2];
  if (::pipe(pipe_ends) != 0) throw BadInput("no pipe: " + std::string(std::strerror(errno)));
  const pid_t child = ::fork();
  if (child < 0) throw BadInput("no process: " + std::string(std::strerror(errno)));
  if (child == 0) {
    ::close(pipe_ends[0]);
    search_as_child(pipe_ends[1], luma, inner, how, limit_seconds);
  }
  ::close(pipe_ends[1]);
  const std::string bytes =
      read_until(pipe_ends[0], std::chrono::steady_clock::now() +
                                   std::chrono::seconds(kWallPerCpu * limit_seconds));
  ::close(pipe_ends[0]);
  ::kill(child, SIGKILL);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  if (bytes.size() < sizeof found) return false;
  std::memcpy(&found, bytes.data(), sizeof found);
  if (bytes.size() != sizeof found + found.num_corners * sizeof corners[0]) return false;
  corners.resize(found.num_corners);
  if (!corners.empty())
    std::memcpy(corners.data(), bytes.data() + sizeof found, bytes.size() - sizeof found);
  return true;
}

std::string number(double value, const char* unit) {
  char text[64];
  std::snprintf(text, sizeof text, "%.1f %s", value, unit);
  return text;
}

}  // namespace

const char* reason_name(Reason reason) {
  constexpr const char* names[] = {"used",        "too_dark",   "no_board",   "partial_board",
                                   "other_board", "time_limit", "blurred",    "duplicate",
                                   "surplus",     "outlier",    "unreadable", "other_size"};
  return names[static_cast<int>(reason)];
}

const char* reason_words(Reason reason) {
  constexpr const char* words[] = {"used",
                                   "too dark",
                                   "no chessboard",
                                   "a part of the board",
                                   "a larger board",
                                   "search ended, too slow",
                                   "blurred",
                                   "as an earlier view",
                                   "more than --max-views",
                                   "error too large",
                                   "cannot be read",
                                   "another size"};
  return words[static_cast<int>(reason)];
}

BoardView find_board(const cv::Mat& luma, const std::string& name, cv::Size inner,
                     bool is_other_likely, int limit_seconds) {
  BoardView view;
  view.name = name;
  view.thumbnail = shrunk(luma, kThumbnailSide, view.thumbnail_scale).clone();
  const auto find = [&](Search how, int seconds, Found& found) {
    if (search_in_child(luma, inner, how, seconds, found, view.corners)) return true;
    view.corners.clear();
    return false;
  };
  Found found;
  const bool is_found = !is_other_likely && find(Search::kQuick, kQuickSeconds, found) &&
                        found.reason != Reason::kNoBoard;
  if (!is_found && !find(Search::kThorough, limit_seconds, found)) {
    view.reason = Reason::kTimeLimit;
    view.detail = std::to_string(limit_seconds) + " s";
    return view;
  }
  view.reason = found.reason;
  view.seen = cv::Size(found.seen_width, found.seen_height);
  view.edge_rise_px = found.edge_rise_px;
  if (view.seen.area() > 0)
    view.detail =
        std::to_string(view.seen.width) + "x" + std::to_string(view.seen.height) + " seen";
  return view;
}

void reject_blurred(std::vector<BoardView>& views) {
  std::vector<double> rises;
  for (const BoardView& view : views)
    if (view.is_used()) rises.push_back(view.edge_rise_px);
  if (rises.empty()) return;
  // A view is blurred if its edges are wider than kMaxRiseOfMedian times the median; but never if
  // they are at most kMaxRisePx wide, since sharp views may differ by more than that ratio; and
  // always if they are wider than twice kMaxRisePx, since all views may be blurred.
  const double limit = std::max(kMaxRisePx, kMaxRiseOfMedian * median_of(rises));
  for (BoardView& view : views) {
    if (!view.is_used() || view.edge_rise_px <= std::min(limit, 2 * kMaxRisePx)) continue;
    view.reason = Reason::kBlurred;
    view.detail = "edges over " + number(view.edge_rise_px, "px");
  }
}

double distance_px(const Corners& a, const Corners& b) {
  double same = 0, turned = 0;
  for (size_t i = 0; i < a.size(); ++i) {
    const cv::Point2f along = a[i] - b[i], back = a[i] - b[b.size() - 1 - i];
    same += along.dot(along);
    turned += back.dot(back);
  }
  return std::sqrt(std::min(same, turned) / static_cast<double>(a.size()));
}

void reject_duplicates(std::vector<BoardView>& views, cv::Size image) {
  const double least = kMinMoveShare * std::hypot(image.width, image.height);
  for (size_t i = 0; i < views.size(); ++i) {
    if (!views[i].is_used()) continue;
    for (size_t j = 0; j < i; ++j) {
      if (!views[j].is_used()) continue;
      const double moved = distance_px(views[i].corners, views[j].corners);
      if (moved >= least) continue;
      views[i].reason = Reason::kDuplicate;
      views[i].detail = number(moved, "px from ") + views[j].name;
      break;
    }
  }
}

void reject_surplus(std::vector<BoardView>& views, int max_views) {
  std::vector<BoardView*> left;
  for (BoardView& view : views)
    if (view.is_used()) left.push_back(&view);
  if (static_cast<int>(left.size()) <= max_views) return;
  // Keeps the views that differ most: each step takes the view that is farthest from all views
  // taken so far.
  std::vector<double> nearest(left.size(), HUGE_VAL);
  std::vector<bool> taken(left.size(), false);
  size_t next = 0;
  for (int n = 0; n < max_views; ++n) {
    taken[next] = true;
    size_t farthest = 0;
    double best = -1;
    for (size_t i = 0; i < left.size(); ++i) {
      nearest[i] = std::min(nearest[i], distance_px(left[i]->corners, left[next]->corners));
      if (taken[i] || nearest[i] <= best) continue;
      best = nearest[i];
      farthest = i;
    }
    next = farthest;
  }
  for (size_t i = 0; i < left.size(); ++i)
    if (!taken[i]) left[i]->reason = Reason::kSurplus;
}

}  // namespace cli
