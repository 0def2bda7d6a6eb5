#include "files/matches_arrays.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <optional>
#include <utility>

#include "base/error.h"
#include "files/match_scores.h"
#include "files/npy_file.h"
#include "files/zip_file.h"

namespace cli {
namespace {

using Names = std::vector<std::string>;

// The arrays of matched pixels, of both images, in the order in which they are preferred: those of
// the pictures as they are before those of pictures that the matcher made smaller, refined ones
// before coarse ones.
const std::vector<std::pair<std::string, std::string>> kMatched = {
    {"mkpts0_f", "mkpts1_f"},
    {"mkeypoints0_orig", "mkeypoints1_orig"},
    {"mkpts0", "mkpts1"},
    {"mkpts1", "mkpts2"},
    {"matched_kpts0", "matched_kpts1"},
    {"matched_keypoints0", "matched_keypoints1"},
    {"mkeypoints0", "mkeypoints1"},
    {"points0", "points1"},
    {"points1", "points2"},
    {"pts0", "pts1"},
    {"pts1", "pts2"},
    {"kptsA", "kptsB"},
    {"mkpts0_c", "mkpts1_c"}};
// The arrays of keypoints that the indices of kIndices refer to.
const std::vector<std::pair<std::string, std::string>> kKeypoints = {
    {"keypoints0_orig", "keypoints1_orig"},
    {"keypoints0", "keypoints1"},
    {"keypoints1", "keypoints2"},
    {"kpts0", "kpts1"},
    {"kpts1", "kpts2"},
    {"kps0", "kps1"},
    {"kp0", "kp1"}};
const Names kIndices = {"matches", "matches0", "matches01", "match_indices"};
// One array of x0 y0 x1 y1, perhaps with a score.
const Names kRows = {"matches", "correspondences", "corrs", "arr_0"};
// kornia's LoFTR calls matched pixels keypoints; only with this array they are.
const std::string kBatches = "batch_indexes";

// The arrays of a file, each read when it is first used.
class Arrays {
 public:
  Arrays(std::string_view bytes, const std::string& name) : name_(name) {
    if (is_npy(bytes)) {
      single_ = parse_npy(bytes, name);
      return;
    }
    members_ = zip_members(bytes, name);
    for (ZipMember& member : members_) {
      constexpr std::string_view kEnding = ".npy";
      const size_t length = member.name.size();
      if (length > kEnding.size() && member.name.substr(length - kEnding.size()) == kEnding)
        member.name.resize(length - kEnding.size());
    }
  }
  bool has(const std::string& array) const { return find(array) != nullptr; }
  // The array without leading axes of length 1, which are a batch's.
  NpyArray get(const std::string& array, size_t most_axes) {
    used_.push_back(array);
    const std::string what = name_ + ": " + array;
    NpyArray read = parse_npy(content_of(*find(array), name_), what);
    while (read.shape.size() > most_axes && read.shape[0] == 1)
      read.shape.erase(read.shape.begin());
    return read;
  }
  const std::optional<NpyArray>& single() const { return single_; }
  Names names() const {
    Names names;
    for (const ZipMember& member : members_) names.push_back(member.name);
    return names;
  }
  Names left_out() const {
    Names names;
    for (const ZipMember& member : members_)
      if (std::find(used_.begin(), used_.end(), member.name) == used_.end())
        names.push_back(member.name);
    return names;
  }

 private:
  const ZipMember* find(const std::string& array) const {
    for (const ZipMember& member : members_)
      if (member.name == array) return &member;
    return nullptr;
  }
  std::string name_;
  std::vector<ZipMember> members_;
  std::optional<NpyArray> single_;
  Names used_;
};

std::string joined(const Names& names) {
  std::string text;
  for (const std::string& name : names) text += (text.empty() ? "" : ", ") + name;
  return text;
}

[[noreturn]] void refuse_shape(const std::string& what, const NpyArray& array,
                               const std::string& wanted) {
  throw BadInput(what + " has the shape " + array.shape_in_words() + ", not " + wanted);
}

// Pixels of one image, n x 2.
NpyArray points_in(Arrays& arrays, const std::string& array, const std::string& name) {
  NpyArray points = arrays.get(array, 2);
  if (points.shape.size() != 2 || points.shape[1] != 2)
    refuse_shape(name + ": " + array, points, "(n, 2)");
  return points;
}

void add(MatchList& matches, size_t image, const NpyArray& points, size_t row) {
  matches.pixels[image].push_back(points.values[2 * row]);
  matches.pixels[image].push_back(points.values[2 * row + 1]);
}

// The score of each match: of an array with a value for each, or, where `of_keypoint0` has the
// index of each match's keypoint in image 0, with one for each of those `num_keypoints`.
void add_scores(Arrays& arrays, const std::string& name, const std::vector<size_t>& of_keypoint0,
                size_t num_keypoints, MatchList& matches) {
  for (const bool lower : {true, false})
    for (const std::string& array : score_names(lower)) {
      if (!arrays.has(array) || !matches.ratios.empty()) continue;
      const NpyArray scores = arrays.get(array, 1);
      const bool is_of_matches = scores.shape.size() == 1 && scores.rows() == matches.size();
      const bool is_of_keypoints =
          scores.shape.size() == 1 && !of_keypoint0.empty() && scores.rows() == num_keypoints;
      if (!is_of_matches && !is_of_keypoints)
        refuse_shape(name + ": " + array, scores,
                     "(" + std::to_string(matches.size()) + ",), one for each match");
      std::vector<double> values = scores.values;
      if (!is_of_matches) {
        values.clear();
        for (const size_t keypoint : of_keypoint0) values.push_back(scores.values[keypoint]);
      }
      matches.ratios = ratios_of(values, lower, name + ": " + array);
    }
}

MatchList matched_pixels(Arrays& arrays, const std::string& array0, const std::string& array1,
                         const std::string& name) {
  const NpyArray points[2] = {points_in(arrays, array0, name), points_in(arrays, array1, name)};
  if (points[0].rows() != points[1].rows())
    throw BadInput(name + ": " + array0 + " and " + array1 + " have the shapes " +
                   points[0].shape_in_words() + " and " + points[1].shape_in_words());
  MatchList matches;
  for (size_t v = 0; v < 2; ++v) matches.pixels[v] = points[v].values;
  if (arrays.has(kBatches)) arrays.get(kBatches, 1);
  add_scores(arrays, name, {}, 0, matches);
  return matches;
}

size_t index_of(double value, size_t count, const std::string& what) {
  if (value == std::floor(value) && value >= 0 && value < static_cast<double>(count))
    return static_cast<size_t>(value);
  char text[40];
  std::snprintf(text, sizeof text, "%g", value);
  throw BadInput(what + " holds the index " + text + ", and there are " + std::to_string(count) +
                 " keypoints");
}

// Matches of keypoints by their indices: an array (n, 2), or the index of the keypoint in image 1
// of each keypoint in image 0, -1 where it has none.
MatchList indexed_pixels(Arrays& arrays, const std::pair<std::string, std::string>& keypoints,
                         const std::string& indices, const std::string& name) {
  const NpyArray points[2] = {points_in(arrays, keypoints.first, name),
                              points_in(arrays, keypoints.second, name)};
  const NpyArray index = arrays.get(indices, 2);
  const std::string what = name + ": " + indices;
  const bool is_of_keypoints = index.rows() == points[0].rows() && index.columns() == 1;
  const bool is_of_pairs = index.shape.size() == 2 && index.shape[1] == 2;
  if (!is_of_pairs && !is_of_keypoints)
    refuse_shape(what, index,
                 "(n, 2), nor (" + std::to_string(points[0].rows()) +
                     ",), one for each keypoint of image 0");
  MatchList matches;
  std::vector<size_t> of_keypoint0;
  for (size_t row = 0; row < index.rows(); ++row) {
    const double second = index.values[is_of_pairs ? 2 * row + 1 : row];
    if (!is_of_pairs && second == -1) continue;
    const size_t i = is_of_pairs ? index_of(index.values[2 * row], points[0].rows(), what) : row;
    add(matches, 0, points[0], i);
    add(matches, 1, points[1], index_of(second, points[1].rows(), what));
    of_keypoint0.push_back(i);
  }
  add_scores(arrays, name, of_keypoint0, points[0].rows(), matches);
  return matches;
}

bool is_rows(const NpyArray& array) {
  return array.shape.size() == 2 && (array.shape[1] == 4 || array.shape[1] == 5);
}

// x0 y0 x1 y1, and perhaps a score, in the rows of one array.
MatchList rows_of(const NpyArray& array, const std::string& what) {
  if (!is_rows(array)) refuse_shape(what, array, "(n, 4) or (n, 5), x0 y0 x1 y1 and a score");
  MatchList matches;
  std::vector<double> scores;
  for (size_t row = 0; row < array.rows(); ++row) {
    const double* const values = &array.values[row * array.columns()];
    for (size_t i = 0; i < 4; ++i) matches.pixels[i / 2].push_back(values[i]);
    if (array.columns() == 5) scores.push_back(values[4]);
  }
  if (!scores.empty()) matches.ratios = ratios_of(scores, false, what);
  return matches;
}

MatchList read_arrays(Arrays& arrays, const std::string& name) {
  if (arrays.single()) return rows_of(*arrays.single(), name);
  for (const auto& [array0, array1] : kMatched)
    if (arrays.has(array0) && arrays.has(array1))
      return matched_pixels(arrays, array0, array1, name);
  for (const auto& keypoints : kKeypoints) {
    if (!arrays.has(keypoints.first) || !arrays.has(keypoints.second)) continue;
    for (const std::string& indices : kIndices)
      if (arrays.has(indices)) return indexed_pixels(arrays, keypoints, indices, name);
    if (arrays.has(kBatches))
      return matched_pixels(arrays, keypoints.first, keypoints.second, name);
    throw BadInput(name + ": " + keypoints.first + " and " + keypoints.second +
                   " without matches: no array is called " + joined(kIndices));
  }
  for (const std::string& array : kRows)
    if (arrays.has(array)) return rows_of(arrays.get(array, 2), name + ": " + array);
  throw BadInput(name + ": no matches are read from the arrays " + joined(arrays.names()) +
                 "; docs/formats.md has the names of those that are");
}

}  // namespace

bool holds_arrays(std::string_view bytes) {
  for (const std::string_view begin :
       {"PK\x03\x04", "PK\x05\x06", "\x89HDF", "\x80\x02", "\x80\x04"})
    if (bytes.substr(0, begin.size()) == begin) return true;
  return is_npy(bytes);
}

MatchList parse_match_arrays(std::string_view bytes, const std::string& name) {
  if (bytes.substr(0, 4) == "\x89HDF")
    throw BadInput(name +
                   " is HDF5, which is not read: save the keypoints and matches of each pair "
                   "with numpy.savez");
  if (bytes.substr(0, 1) == "\x80")
    throw BadInput(name + " is pickled, which is not read: save its arrays with numpy.savez");
  Arrays arrays(bytes, name);
  for (const std::string& member : arrays.names())
    if (member.size() >= 8 && member.substr(member.size() - 8) == "data.pkl")
      throw BadInput(name +
                     " is of torch.save, which is not read: save its arrays with "
                     "numpy.savez");
  MatchList matches = read_arrays(arrays, name);
  if (matches.size() == 0) throw BadInput(name + ": no match in it");
  if (matches.size() > kMaxMatches)
    throw BadInput(name + ": more than " + std::to_string(kMaxMatches) + " matches");
  matches.left_out = arrays.left_out();
  return matches;
}

}  // namespace cli
