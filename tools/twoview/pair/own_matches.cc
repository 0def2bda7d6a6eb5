#include "pair/own_matches.h"

#include <CLI/App.hpp>
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>

#include "base/error.h"
#include "base/two_views.h"
#include "pair/match_reading.h"

namespace cli {
namespace {

constexpr double kMostNormalised = 2;  // beyond this a coordinate is a pixel, and no ray's slope
constexpr size_t kTelling = 20;        // fewer matches may all lie in one corner by chance

std::string size_in_words(cv::Size size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

[[noreturn]] void refuse_match(const std::string& name, size_t match, size_t image,
                               const std::string& what) {
  throw BadInput(name + ": match " + std::to_string(match) + " (the first is 0) " + what +
                 " in image " + std::to_string(image));
}

void require_inside(const std::string& name, const MatchList& matches, size_t image,
                    cv::Size size) {
  const std::vector<double>& pixels = matches.pixels[image];
  for (size_t i = 0; i < matches.size(); ++i) {
    const double x = pixels[2 * i], y = pixels[2 * i + 1];
    if (!std::isfinite(x) || !std::isfinite(y))
      refuse_match(name, i, image, "has a coordinate that is not finite");
    if (x >= -1 && y >= -1 && x <= size.width && y <= size.height) continue;
    char pixel[80];
    std::snprintf(pixel, sizeof pixel, "has the pixel (%g, %g)", x, y);
    refuse_match(name, i, image,
                 std::string(pixel) + ", which is not in the " + size_in_words(size) +
                     " pixels of the picture that was matched,");
  }
}

// Whether the coordinates of an image are normalised.
bool are_normalised(const std::vector<double>& pixels) {
  return std::all_of(pixels.begin(), pixels.end(),
                     [](double value) { return std::abs(value) <= kMostNormalised; });
}

// Whether no match lies in the right half or the lower half of this picture.
bool leaves_most_empty(const MatchList& matches, size_t image, cv::Size size) {
  for (size_t i = 0; i < matches.size(); ++i)
    if (2 * matches.pixels[image][2 * i] >= size.width ||
        2 * matches.pixels[image][2 * i + 1] >= size.height)
      return false;
  return true;
}

void triangulate(const Options& options, const MatchList& matches, Outcome& outcome) {
  OwnArrays& own = outcome.own;
  const tv_camera_pair pair = corrected_pair(outcome);
  const tv_pixel_pairs pixels = pixel_pairs(matches.pixels);
  check(tv_triangulate(&pair, &pixels, static_cast<tv_triangulation>(options.triangulation),
                       own.points.data()),
        "cannot triangulate");
  for (size_t i = 0; i < matches.size(); ++i) {
    if (own.inlier_mask[i] == 0) {
      own.points[i] = tv_point{};
      own.points[i].status = TV_POINT_INVALID;
    }
    outcome.reconstruction.num_points += own.points[i].status == TV_POINT_OK;
  }
}

// The arrays of a reconstruction: match i is of keypoint i of both images.
void fill_arrays(const Options& options, const MatchList& matches, Outcome& outcome) {
  OwnArrays& own = outcome.own;
  const size_t count = matches.size();
  own = {};
  for (size_t v = 0; v < 2; ++v)
    for (size_t i = 0; i < count; ++i) {
      tv_keypoint keypoint{};
      keypoint.x = static_cast<float>(matches.pixels[v][2 * i]);
      keypoint.y = static_cast<float>(matches.pixels[v][2 * i + 1]);
      keypoint.size = options.feature.keypoint_size;
      own.keypoints[v].push_back(keypoint);
    }
  for (size_t i = 0; i < count; ++i) {
    tv_correspondence match{};
    match.idx0 = match.idx1 = static_cast<int32_t>(i);
    match.ratio = matches.ratios.empty() ? 0 : matches.ratios[i];
    own.matches.push_back(match);
  }
  own.inlier_mask.assign(count, 0);
  tv_point no_point{};
  no_point.status = TV_POINT_INVALID;
  own.points.assign(count, no_point);
  tv_reconstruction& r = outcome.reconstruction;
  tv_reconstruction_init(&r);
  for (size_t v = 0; v < 2; ++v) {
    r.num_keypoints[v] = static_cast<int32_t>(count);
    r.keypoints[v] = own.keypoints[v].data();
  }
  r.num_matches = static_cast<int32_t>(count);
  r.matches = own.matches.data();
  r.inlier_mask = own.inlier_mask.data();
  r.points = own.points.data();
}

}  // namespace

void OwnMatchOptions::add_to(CLI::App& verb, const std::string& help, const std::string& type) {
  CLI::Option* const matches = verb.add_option("--matches", path, help);
  matches->type_name(type);
  verb.add_option("--matches-resize", resize,
                  "the longer side to which the other program made the pictures smaller; 0: it "
                  "matched them as they are")
      ->check(CLI::Range(0, 1 << 20))
      ->type_name("L")
      ->default_str("")
      ->needs(matches);
  exclude_matching(verb, *matches);
}

void OwnMatchOptions::add_json(nlohmann::ordered_json& options) const {
  options["matches"] = given() ? nlohmann::ordered_json(path) : nlohmann::ordered_json(nullptr);
  options["matches_resize"] = std::max(resize, 0);
}

void fit_to_pictures(const Picture pictures[2], int resize, const std::string& name,
                     MatchList& matches) {
  cv::Size sizes[2];  // of the pictures that were matched
  for (size_t v = 0; v < 2; ++v)
    sizes[v] = shrunk_size({pictures[v].file_width, pictures[v].file_height}, resize);
  for (size_t v = 0; v < 2; ++v) {
    const bool is_large = std::max(sizes[v].width, sizes[v].height) > 2 * kMostNormalised;
    if (is_large && are_normalised(matches.pixels[v]))
      throw BadInput(name + " has normalised coordinates in image " + std::to_string(v) +
                     " (none is above 2), and pixels are needed: multiply them by the camera's "
                     "matrix, or by the picture's size");
  }
  for (size_t v = 0; v < 2; ++v) require_inside(name, matches, v, sizes[v]);
  if (resize < 0 && matches.size() >= kTelling && leaves_most_empty(matches, 0, sizes[0]) &&
      leaves_most_empty(matches, 1, sizes[1]))
    throw BadInput(name + " has no match in the right or the lower half of either picture (" +
                   size_in_words(sizes[0]) +
                   "): were they matched smaller? --matches-resize L says their longer side then, "
                   "--matches-resize 0 that they were not");
  for (size_t v = 0; v < 2; ++v) {
    const double scale_x = static_cast<double>(pictures[v].luma.cols) / sizes[v].width;
    const double scale_y = static_cast<double>(pictures[v].luma.rows) / sizes[v].height;
    for (size_t i = 0; i < matches.size(); ++i) {
      double* const pixel = &matches.pixels[v][2 * i];
      pixel[0] = (pixel[0] + 0.5) * scale_x - 0.5;
      pixel[1] = (pixel[1] + 0.5) * scale_y - 0.5;
    }
  }
  matches.fit_pictures = require_reading(pictures, resize < 0, name, matches);
}

uint64_t estimate_own_matches(Session& session, const Options& options, const MatchList& matches,
                              Outcome& outcome) {
  const cv::Mat &a = outcome.picture[0].luma, &b = outcome.picture[1].luma;
  tv_context* const context =
      session.context(std::max(a.cols, b.cols), std::max(a.rows, b.rows), matches.size());
  fill_arrays(options, matches, outcome);
  tv_pixel_pairs pairs = pixel_pairs(matches.pixels);
  pairs.ratios = matches.ratios.empty() ? nullptr : matches.ratios.data();
  tv_two_view_init(&outcome.two_view);
  tv_evidence_init(&outcome.evidence);
  const uint64_t start_ns = now_ns();
  check(tv_estimate_two_view(context, outcome.has_cameras ? &outcome.camera[0] : nullptr,
                             outcome.has_cameras ? &outcome.camera[1] : nullptr, &pairs,
                             &options.estimate, &outcome.two_view, &outcome.evidence,
                             outcome.own.inlier_mask.data()),
        "cannot estimate with --method " + method_name(options.estimate.method));
  if (has_full_pose(outcome.two_view)) triangulate(options, matches, outcome);
  return now_ns() - start_ns;
}

std::vector<std::string> own_match_notes(const MatchList& matches, const std::string& name) {
  std::vector<std::string> notes;
  std::string text;
  for (const std::string& part : matches.left_out) text += (text.empty() ? "" : ", ") + part;
  if (!text.empty()) notes.push_back(name + ": not used: " + text);
  if (!matches.fit_pictures)
    notes.push_back(name +
                    ": the pictures look alike at few of the matches, as where a view is far from "
                    "or turned against the other; where it is not, the pixels may be of cut, "
                    "framed or stretched pictures, and the pose wrong");
  return notes;
}

}  // namespace cli
