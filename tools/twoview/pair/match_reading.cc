#include "pair/match_reading.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdio>
#include <opencv2/core.hpp>
#include <vector>

#include "base/error.h"

namespace cli {
namespace {

constexpr size_t kMost = 200;  // matches that are looked at
// Of another reading, against the one of the file: the least number of matches at which the
// pictures become alike, how many times more than cease to be, and the least share that is alike.
// At the matches of 36 pairs of six sets 0.31 to 0.93 are alike; of tankard and fox_wall, whose
// views are far from or turned against each other, 0.03 to 0.82.
constexpr size_t kGained = 20;
constexpr double kClearly = 5, kAlikeShare = 0.3;
constexpr double kFewAlike = 0.15;  // half of the least share
// Half a step moves a pixel by 1: in both images against each other where the scene moves by 200
// pixels between them, in one image 1000 pixels from its corner.
constexpr double kScaleStep = 1.01, kScaleStepInOne = 1.002;
constexpr double kMostScale = 4;
// Cut and framed pictures are looked for where less of the matches are alike, first at some of
// them. The pictures stay alike a few pixels beside the true places, since neighbours move alike.
constexpr double kMostlyAlike = 0.5;
constexpr size_t kCoarse = 60;
constexpr int kShiftStep = 4;        // pixels
constexpr double kMostShift = 0.25;  // of the picture's side
constexpr double kMostFrame = 2;     // the side of a framed picture, over that of what is in it

using Match = std::array<double, 4>;  // x, y in image 0 and in image 1

// How the numbers of a match may be meant.
struct Reading {
  enum class Kind {
    kAsGiven,
    kSides,
    kRowColumn,
    kFromBelow,
    kLarger,
    kShifted,       // pictures that were cut or framed on one side
    kFramedBeside,  // with bars of equal width left and right, which the numbers count
    kFramedAbove    // above and below
  } kind = Kind::kAsGiven;
  bool in[2] = {true, true};        // the images of which it is
  double scale = 1;                 // of kLarger and of frames
  double shift_x = 0, shift_y = 0;  // of kShifted: what is added, pixels
};

// A place on a side of a picture that was squeezed into the middle of a frame of the same size.
double unframed(double place, int side, double scale) {
  const double middle = 0.5 * (side - 1);
  return middle + scale * (place - middle);
}

Match read_as(const Reading& reading, Match match, const Picture pictures[2]) {
  if (reading.kind == Reading::Kind::kSides) return {match[2], match[3], match[0], match[1]};
  for (size_t v = 0; v < 2; ++v) {
    double *const x = &match[2 * v], *const y = x + 1;
    if (!reading.in[v]) continue;
    if (reading.kind == Reading::Kind::kRowColumn) std::swap(*x, *y);
    if (reading.kind == Reading::Kind::kFromBelow) *y = pictures[v].luma.rows - 1 - *y;
    if (reading.kind == Reading::Kind::kFramedBeside)
      *x = unframed(*x, pictures[v].luma.cols, reading.scale);
    if (reading.kind == Reading::Kind::kFramedAbove)
      *y = unframed(*y, pictures[v].luma.rows, reading.scale);
    *x += reading.shift_x;
    *y += reading.shift_y;
    if (reading.kind != Reading::Kind::kLarger) continue;
    *x = (*x + 0.5) * reading.scale - 0.5;
    *y = (*y + 0.5) * reading.scale - 0.5;
  }
  return match;
}

// Whether the pictures around two pixels look alike: squares of 11 x 11 pixels that correlate.
// False for plain ones, and at the pictures' edges.
bool look_alike(const cv::Mat& a, const double* pixel_a, const cv::Mat& b, const double* pixel_b) {
  constexpr int kSide = 11;
  constexpr double kLeastSigma = 3, kAlike = 0.7;
  const auto square = [](const cv::Mat& luma, const double* pixel) {
    const cv::Rect whole(0, 0, luma.cols, luma.rows);
    const cv::Rect wanted(static_cast<int>(std::lround(pixel[0])) - kSide / 2,
                          static_cast<int>(std::lround(pixel[1])) - kSide / 2, kSide, kSide);
    cv::Mat values;
    if ((wanted & whole) == wanted) luma(wanted).convertTo(values, CV_64F);
    return values;
  };
  const cv::Mat x = square(a, pixel_a), y = square(b, pixel_b);
  if (x.empty() || y.empty()) return false;
  cv::Scalar mean_x, mean_y, sigma_x, sigma_y;
  cv::meanStdDev(x, mean_x, sigma_x);
  cv::meanStdDev(y, mean_y, sigma_y);
  if (sigma_x[0] < kLeastSigma || sigma_y[0] < kLeastSigma) return false;
  return cv::mean((x - mean_x[0]).mul(y - mean_y[0]))[0] > kAlike * sigma_x[0] * sigma_y[0];
}

std::vector<bool> alike(const Reading& reading, const Picture pictures[2],
                        const std::vector<Match>& matches) {
  std::vector<bool> are_alike;
  for (const Match& match : matches) {
    const Match read = read_as(reading, match, pictures);
    are_alike.push_back(look_alike(pictures[0].luma, &read[0], pictures[1].luma, &read[2]));
  }
  return are_alike;
}

size_t num_of(const std::vector<bool>& values) {
  return static_cast<size_t>(std::count(values.begin(), values.end(), true));
}

// By how much the matches of the images can be spread until one leaves its picture.
double room_to_spread(const Reading& reading, const Picture pictures[2],
                      const std::vector<Match>& matches) {
  double room = kMostScale;
  for (const Match& match : matches)
    for (size_t v = 0; v < 2; ++v) {
      if (!reading.in[v]) continue;
      room = std::min(room, (pictures[v].luma.cols + 0.5) / std::max(1.0, match[2 * v] + 0.5));
      room = std::min(room, (pictures[v].luma.rows + 0.5) / std::max(1.0, match[2 * v + 1] + 0.5));
    }
  return room;
}

std::vector<Reading> other_readings(const Picture pictures[2], const std::vector<Match>& matches,
                                    bool may_be_smaller) {
  std::vector<Reading> readings;
  readings.push_back({Reading::Kind::kSides, {true, true}, 1});
  for (const auto& [in0, in1] : {std::pair(true, true), {true, false}, {false, true}}) {
    readings.push_back({Reading::Kind::kRowColumn, {in0, in1}, 1});
    readings.push_back({Reading::Kind::kFromBelow, {in0, in1}, 1});
    if (!may_be_smaller) continue;
    const double step = in0 && in1 ? kScaleStep : kScaleStepInOne;
    Reading larger{Reading::Kind::kLarger, {in0, in1}, step};
    const double room = room_to_spread(larger, pictures, matches);
    for (; larger.scale <= room; larger.scale *= step) readings.push_back(larger);
  }
  return readings;
}

// The readings for pictures that were cut or framed before they were matched.
std::vector<Reading> cut_readings(const Picture pictures[2]) {
  std::vector<Reading> readings;
  for (const Reading::Kind kind : {Reading::Kind::kFramedAbove, Reading::Kind::kFramedBeside})
    for (double scale = kScaleStep; scale <= kMostFrame; scale *= kScaleStep)
      readings.push_back({kind, {true, true}, scale});
  const int most_x = static_cast<int>(kMostShift * pictures[0].luma.cols) / kShiftStep;
  const int most_y = static_cast<int>(kMostShift * pictures[0].luma.rows) / kShiftStep;
  for (int y = -most_y; y <= most_y; ++y)
    for (int x = -most_x; x <= most_x; ++x) {
      Reading reading{Reading::Kind::kShifted, {true, true}, 1};
      reading.shift_x = kShiftStep * x;
      reading.shift_y = kShiftStep * y;
      if (x != 0 || y != 0) readings.push_back(reading);
    }
  return readings;
}

std::string shift_words(double shift_x, double shift_y, const Picture& picture) {
  const double scale = static_cast<double>(picture.file_width) / picture.luma.cols;
  char text[160];
  std::snprintf(text, sizeof text,
                "they are of pictures that were cut or framed: add about (%.0f, %.0f) pixels to x "
                "and y",
                scale * shift_x, scale * shift_y);
  return text;
}

std::string words_of(const Reading& reading, const Picture pictures[2]) {
  const std::string where = reading.in[0] && reading.in[1] ? " in both images"
                            : reading.in[0]                ? " in image 0"
                                                           : " in image 1";
  const Picture& picture = pictures[reading.in[0] ? 0 : 1];
  const int longer = std::max(picture.file_width, picture.file_height);
  const int side = static_cast<int>(std::lround(longer / reading.scale));
  switch (reading.kind) {
    case Reading::Kind::kRowColumn:
      return "row and column are exchanged" + where + ": give the column, x, first";
    case Reading::Kind::kFromBelow:
      return "y is counted from the lower edge" + where + ": give it from the upper one";
    case Reading::Kind::kLarger:
      return "they are of smaller pictures" + where + ", of about " + std::to_string(side) +
             " pixels on the longer side: --matches-resize L says it for both";
    case Reading::Kind::kShifted: return shift_words(reading.shift_x, reading.shift_y, picture);
    case Reading::Kind::kFramedAbove:
    case Reading::Kind::kFramedBeside: {
      const bool is_above = reading.kind == Reading::Kind::kFramedAbove;
      const int whole = is_above ? picture.file_height : picture.file_width;
      return std::string("they are of pictures with bars ") +
             (is_above ? "above and below" : "left and right") + " of what is in these, about " +
             std::to_string(std::lround(0.5 * whole * (1 - 1 / reading.scale))) + " of " +
             std::to_string(whole) + " pixels each: take the bars off, and scale the rest";
    }
    default:
      return "the sides are exchanged: exchange both, or name the pictures in the other order";
  }
}

// Whether the pictures agree with the second list, and not with the first one.
bool is_clearly_better(const std::vector<bool>& given, const std::vector<bool>& other) {
  size_t gained = 0, lost = 0;
  for (size_t i = 0; i < given.size(); ++i) {
    gained += !given[i] && other[i];
    lost += given[i] && !other[i];
  }
  return gained >= kGained &&
         static_cast<double>(gained) >= kClearly * static_cast<double>(lost + 1);
}

}  // namespace

namespace {

// The way of reading the file in which the pictures agree with most of these matches, if with
// clearly more than as the file is written; else the way that it is written.
struct Best {
  Reading reading;
  size_t num_alike = 0;
};
Best best_of(const std::vector<Reading>& readings, const Picture pictures[2],
             const std::vector<Match>& matches, const std::vector<bool>& given) {
  Best best;
  for (const Reading& reading : readings) {
    const std::vector<bool> other = alike(reading, pictures, matches);
    const size_t num = num_of(other);
    if (num <= best.num_alike || !is_clearly_better(given, other)) continue;
    best = {reading, num};
  }
  return best;
}

// Of cut and framed pictures, which are many: by some of the matches, and then by all.
Best best_cut(const Picture pictures[2], const std::vector<Match>& matches,
              const std::vector<bool>& given) {
  std::vector<Match> some;
  std::vector<bool> some_given;
  const size_t step = 1 + matches.size() / kCoarse;
  for (size_t i = 0; i < matches.size(); i += step) {
    some.push_back(matches[i]);
    some_given.push_back(given[i]);
  }
  const Best coarse = best_of(cut_readings(pictures), pictures, some, some_given);
  if (coarse.num_alike == 0) return {};
  return best_of({coarse.reading}, pictures, matches, given);
}

}  // namespace

bool require_reading(const Picture pictures[2], bool may_be_smaller, const std::string& name,
                     const MatchList& matches) {
  std::vector<Match> some;
  for (size_t i = 0; i < matches.size(); i += 1 + matches.size() / kMost)
    some.push_back({matches.pixels[0][2 * i], matches.pixels[0][2 * i + 1],
                    matches.pixels[1][2 * i], matches.pixels[1][2 * i + 1]});
  if (some.size() < kGained) return true;
  const std::vector<bool> given = alike({}, pictures, some);
  const auto count = static_cast<double>(some.size());
  const bool are_few = static_cast<double>(num_of(given)) < kFewAlike * count;
  Best best = best_of(other_readings(pictures, some, may_be_smaller), pictures, some, given);
  if (static_cast<double>(num_of(given)) < kMostlyAlike * count) {
    const Best cut = best_cut(pictures, some, given);
    if (cut.num_alike > best.num_alike) best = cut;
  }
  if (static_cast<double>(best.num_alike) < kAlikeShare * count) return !are_few;
  throw BadInput(name + ": the pictures look alike at " + std::to_string(num_of(given)) + " of " +
                 std::to_string(some.size()) + " matches as they stand, and at " +
                 std::to_string(best.num_alike) + " where " + words_of(best.reading, pictures));
}

}  // namespace cli
