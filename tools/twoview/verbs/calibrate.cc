// twoview calibrate: estimates a camera from pictures of a chessboard and reports how reliable it
// is.

#include <CLI/App.hpp>
#include <algorithm>
#include <charconv>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <numeric>

#include "base/error.h"
#include "base/output.h"
#include "base/terminal.h"
#include "calibration/pictures.h"
#include "calibration/source.h"
#include "files/camera_file.h"
#include "files/image_file.h"
#include "files/mixed_names.h"
#include "pair/result.h"
#include "verbs/verbs.h"

namespace cli {
namespace {

constexpr int kMinSide = 3, kMaxBoardSide = 100;     // inner corners in a row; 3: OpenCV's minimum
constexpr int kImageSeconds = 5, kFrameSeconds = 2;  // CPU limit of one search
// So many views of another board, and none of the requested one, suggest that the given size is
// wrong.
constexpr int kTellingViews = 2;

const std::vector<std::string> kFiles = {"camera.yaml",    "camera_info.yaml", "calibration.json",
                                         "detections.png", "coverage.png",     "residuals.png"};

struct Arguments {
  Common common;
  std::vector<std::string> images;
  std::string video, model = "brown-conrady", board_text;
  Board board;
  bool has_square = false;
  int max_views = 60;
  double duration_s = 60;
};

using Json = nlohmann::ordered_json;

std::string board_name(cv::Size inner) {
  return std::to_string(inner.width) + "x" + std::to_string(inner.height);
}

// Parses a text such as "9x6"; an empty size for anything else.
cv::Size parse_board(const std::string& text) {
  cv::Size inner;
  const char* const end = text.data() + text.size();
  const auto width = std::from_chars(text.data(), end, inner.width);
  if (width.ec != std::errc() || width.ptr == end || *width.ptr != 'x') return {};
  const auto height = std::from_chars(width.ptr + 1, end, inner.height);
  const auto is_good = [](int side) { return side >= kMinSide && side <= kMaxBoardSide; };
  if (height.ec != std::errc() || height.ptr != end) return {};
  return is_good(inner.width) && is_good(inner.height) ? inner : cv::Size();
}

Lens lens_of(const std::string& model) {
  for (const Lens lens : {Lens::kRational, Lens::kKannalaBrandt})
    if (model == lens_name(lens)) return lens;
  return Lens::kBrownConrady;
}

size_t count_of(const std::vector<BoardView>& views, Reason reason) {
  return static_cast<size_t>(std::count_if(
      views.begin(), views.end(), [=](const BoardView& view) { return view.reason == reason; }));
}

// The number of rejected views by reason, such as "(11 no_board, 2 blurred)"; empty if all views
// are used.
std::string reasons_text(const std::vector<BoardView>& views) {
  std::string text;
  for (int i = 1; i <= static_cast<int>(Reason::kOtherSize); ++i) {
    const auto reason = static_cast<Reason>(i);
    const size_t count = count_of(views, reason);
    if (count > 0)
      text += (text.empty() ? "" : ", ") + std::to_string(count) + " " + reason_name(reason);
  }
  return text.empty() ? text : " (" + text + ")";
}

// The size, other than the given one, of the board that was found in most views, and in how many
// views.
std::pair<cv::Size, int> other_board(const std::vector<BoardView>& views) {
  std::map<std::pair<int, int>, int> counts;
  for (const BoardView& view : views)
    if (view.seen.area() > 0) ++counts[{view.seen.width, view.seen.height}];
  std::pair<cv::Size, int> best{{}, 0};
  for (const auto& [sides, count] : counts)
    if (count > best.second) best = {cv::Size(sides.first, sides.second), count};
  return best;
}

// Throws BadInput with advice to the user if there are too few views for a calibration.
void require_views(const std::vector<BoardView>& views, const Arguments& a) {
  const std::string board = board_name(a.board.inner);
  const bool is_one = views.size() == 1;
  const std::string what = a.video.empty() ? (is_one ? " image" : " images")
                                           : (is_one ? " frame looked at" : " frames looked at");
  const std::string all = std::to_string(views.size()) + what;
  const size_t num_used = count_of(views, Reason::kUsed);
  const size_t num_alike = count_of(views, Reason::kDuplicate);
  if (views.empty()) throw BadInput("video " + a.video + " has no frames");
  if (num_used >= kMinViews) return;
  const auto [seen, times] = other_board(views);
  const std::string only = "only " + std::to_string(num_used) + " different view" +
                           (num_used == 1 ? "" : "s") + " of the " + board + " board in " + all;
  if (times > static_cast<int>(num_used) && 4 * times > static_cast<int>(views.size()))
    throw BadInput((num_used == 0 ? "no whole " + board + " board in " + all : only) + ", but " +
                   board_name(seen) + " inner corners in " + std::to_string(times) +
                   " of them: is it --board " + board_name(seen) + ", or is a part hidden?");
  if (num_used == 0)
    throw BadInput("no " + board + " board that can be used in " + all + reasons_text(views) +
                   ": --board counts inner corners; show the whole board, sharp and evenly lit");
  if (num_used == 1 && num_alike > 0)
    throw BadInput("all " + std::to_string(1 + num_alike) + " views of the board are alike, of " +
                   all + reasons_text(views) + ": move and tilt the board between pictures");
  throw BadInput(only + reasons_text(views) +
                 (a.video.empty() ? "" : " of the video, which ended too soon") +
                 ": at least 3 are needed, 15 are better, each tilted another way");
}

// Notes that views were left out because they show a larger board than the others do: in the others
// a part of that board was found and used.
void note_larger_board(const std::vector<BoardView>& views, Common& common) {
  const auto [seen, times] = other_board(views);
  const size_t num_left_out = count_of(views, Reason::kOtherBoard);
  if (num_left_out == 0 || times == 0) return;
  common.note(std::to_string(num_left_out) + (num_left_out == 1 ? " view shows" : " views show") +
              " a board of " + board_name(seen) + " inner corners: is it --board " +
              board_name(seen) + "?");
}

// Notes a square that was given in millimetres or centimetres. The camera does not depend on it.
void note_large_square(Arguments& a) {
  constexpr double kLarge_m = 1;
  if (!a.has_square || a.board.square < kLarge_m) return;
  char text[120];
  std::snprintf(text, sizeof text, "squares of %g m: is --square in metres? The views' poses are",
                a.board.square);
  a.common.note(text);
}

// Whether at least kTellingViews views show one other board while none shows the requested one. It
// may be the requested board partly hidden.
bool is_other_board_likely(const std::vector<BoardView>& views) {
  return count_of(views, Reason::kUsed) == 0 && other_board(views).second >= kTellingViews;
}

std::vector<BoardView> find_views(Arguments& a, cv::Size& image) {
  std::vector<BoardView> views;
  int num_found = 0;
  const bool live = is_live(a.video);
  const int seconds = a.video.empty() ? kImageSeconds : kFrameSeconds;
  const Progress progress(!a.common.quiet && !live);
  const std::string of = a.video.empty() ? " of " + std::to_string(a.images.size()) : "";
  const auto take = [&](const cv::Mat& luma, const std::string& name) {
    progress.tell("looking for the board: " + std::to_string(views.size() + 1) + of + ", " + name);
    if (image.area() > 0 && luma.size() != image)
      throw BadInput("video " + a.video + " changes its frames' size at " + name);
    image = luma.size();
    views.push_back(find_board(luma, name, a.board.inner, is_other_board_likely(views), seconds));
    if (!views.back().is_used() || !live) return true;
    reject_duplicates(views, image);  // of a live source only different views count
    num_found += views.back().is_used();
    if (a.common.speaks() && views.back().is_used())
      print("view " + std::to_string(num_found) + " of " + std::to_string(a.max_views) +
            "; move the board (Ctrl-C: enough)\n");
    return num_found < a.max_views;
  };
  const auto leave_out = [&](const std::string& name, bool is_unreadable,
                             const std::string& detail) {
    BoardView view;
    view.name = name;
    view.reason = is_unreadable ? Reason::kUnreadable : Reason::kOtherSize;
    view.detail = detail;
    view.thumbnail = cv::Mat::zeros(3, 4, CV_8U);
    views.push_back(view);
  };
  if (a.video.empty()) {
    for (const std::string& note : read_images(a.images, take, leave_out)) a.common.note(note);
    if (const std::string kinds = mixed_names(a.images); !kinds.empty())
      a.common.note("there are pictures with the same numbers " + kinds +
                    ": of two cameras? The camera is then that of neither");
  } else if (live) {
    read_live(a.video, a.duration_s, take);
  } else {
    for (const std::string& note : read_video_file(a.video, take)) a.common.note(note);
  }
  reject_blurred(views);
  reject_duplicates(views, image);
  reject_surplus(views, a.max_views);
  return views;
}

std::vector<std::string> intrinsic_names(Lens lens) {
  std::vector<std::string> names = {"fx", "fy", "cx", "cy"};
  for (const std::string& name : distortion_names(lens)) names.push_back(name);
  return names;
}

std::vector<double> intrinsic_values(const Calibration& c) {
  std::vector<double> values = {c.camera.fx, c.camera.fy, c.camera.cx, c.camera.cy};
  const size_t count = distortion_names(c.lens).size();
  values.insert(values.end(), c.camera.k, c.camera.k + count);
  return values;
}

std::string shortest_text(double value) {
  char digits[32];
  return {digits, std::to_chars(digits, digits + sizeof digits, value).ptr};
}

// The camera in ROS's camera_info format, as ROS's camera_calibration writes it for a single
// camera.
std::string camera_info_yaml(const Calibration& c) {
  const auto matrix = [](const char* name, int rows, int cols, const std::vector<double>& values) {
    std::string text = std::string(name) + ":\n  rows: " + std::to_string(rows) +
                       "\n  cols: " + std::to_string(cols) + "\n  data: [";
    for (size_t i = 0; i < values.size(); ++i) text += (i ? ", " : "") + shortest_text(values[i]);
    return text + "]\n";
  };
  const tv_camera& camera = c.camera;
  const size_t count = distortion_names(c.lens).size();
  const char* const model = c.lens == Lens::kKannalaBrandt ? "equidistant"
                            : c.lens == Lens::kRational    ? "rational_polynomial"
                                                           : "plumb_bob";
  return "image_width: " + std::to_string(camera.width) +
         "\nimage_height: " + std::to_string(camera.height) + "\ncamera_name: camera\n" +
         matrix("camera_matrix", 3, 3,
                {camera.fx, 0, camera.cx, 0, camera.fy, camera.cy, 0, 0, 1}) +
         "distortion_model: " + model + "\n" +
         matrix("distortion_coefficients", 1, static_cast<int>(count),
                {camera.k, camera.k + count}) +
         matrix("rectification_matrix", 3, 3, {1, 0, 0, 0, 1, 0, 0, 0, 1}) +
         matrix("projection_matrix", 3, 4,
                {camera.fx, 0, camera.cx, 0, 0, camera.fy, camera.cy, 0, 0, 0, 1, 0});
}

const ViewFit* fit_of(const Calibration& c, size_t view) {
  for (const ViewFit& fit : c.fits)
    if (fit.view == view) return &fit;
  return nullptr;
}

Json view_json(const BoardView& view, const ViewFit* fit) {
  Json json;
  json["name"] = view.name;
  json["status"] = reason_name(view.reason);
  json["detail"] = view.detail;
  json["edge_rise_px"] = view.has_board() ? Json(shortest(float(view.edge_rise_px))) : Json();
  json["rms_px"] = fit ? Json(fit->rms_px) : Json();
  json["tilt_deg"] = fit ? Json(fit->tilt_deg) : Json();
  json["R"] = fit ? Json(std::vector<double>(fit->R.val, fit->R.val + 9)) : Json();
  json["t"] = fit ? Json(std::vector<double>(fit->t.val, fit->t.val + 3)) : Json();
  Json corners = Json::array();
  for (const cv::Point2f& corner : view.corners)
    corners.push_back({shortest(corner.x), shortest(corner.y)});
  json["corners"] = corners;
  return json;
}

Json calibration_json(const std::vector<BoardView>& views, const Calibration& c,
                      const std::vector<Warning>& warnings, const Arguments& a) {
  Json json;
  json["model"] = lens_name(c.lens);
  json["image_size"] = {c.camera.width, c.camera.height};
  const std::vector<std::string> names = intrinsic_names(c.lens);
  const std::vector<double> values = intrinsic_values(c);
  for (size_t i = 0; i < names.size(); ++i) {
    json["intrinsics"][names[i]] = values[i];
    json["sigma"][names[i]] = finite_or_null(c.sigma[i]);
  }
  json["rms_px"] = c.rms_px;
  json["num_views"] = c.fits.size();
  json["coverage"] = c.coverage;
  json["trusted"] = warnings.empty();
  json["warnings"] = Json::array();
  for (const Warning& warning : warnings)
    json["warnings"].push_back({{"name", warning.name}, {"words", warning.words}});
  json["views"] = Json::array();
  for (size_t i = 0; i < views.size(); ++i)
    json["views"].push_back(view_json(views[i], fit_of(c, i)));
  json["options"] = {{"board", {a.board.inner.width, a.board.inner.height}},
                     {"square", a.has_square ? Json(a.board.square) : Json()},
                     {"model", a.model},
                     {"max_views", a.max_views},
                     {"video", a.video.empty() ? Json() : Json(a.video)}};
  json["version"] = tv_version_string();
  return json;
}

// The entries focal_sigma and center_sigma of the camera file: what the calibration's own standard
// deviations are, as take_sigmas (files/camera_entries.h) reads them.
std::string sigmas_yaml(const Calibration& c) {
  if (c.sigma.size() < 4) return "";
  const double focal = std::max(c.sigma[0] / c.camera.fx, c.sigma[1] / c.camera.fy);
  const double center = std::max(c.sigma[2] / c.camera.fx, c.sigma[3] / c.camera.fy);
  if (!(focal >= 0 && focal <= 0.5 && center >= 0 && center <= 0.5)) return "";
  char text[80];
  std::snprintf(text, sizeof text, "focal_sigma: %.3g\ncenter_sigma: %.3g\n", focal, center);
  return text;
}

std::string with_sigma(const std::string& name, double value, double sigma, int digits) {
  char text[96];
  std::snprintf(text, sizeof text, "%s %.*f +- %.*f", name.c_str(), digits, value, digits, sigma);
  return text;
}

std::string views_table(const std::vector<BoardView>& views, const Calibration& c,
                        const Style& style) {
  size_t width = 4;
  for (const BoardView& view : views)
    width = std::max(width, std::min<size_t>(view.name.size(), 40));
  char row[256];
  std::snprintf(row, sizeof row, "%s%-*s  RMS px  tilt  edge px%s\n", style.dim,
                static_cast<int>(width), "view", style.off);
  std::string text = row;
  for (size_t i = 0; i < views.size(); ++i) {
    const BoardView& view = views[i];
    const ViewFit* fit = fit_of(c, i);
    const int pad = static_cast<int>(width);
    if (fit) {
      std::snprintf(row, sizeof row, "%-*.40s  %6.3f  %4.0f  %7.1f\n", pad, view.name.c_str(),
                    fit->rms_px, fit->tilt_deg, view.edge_rise_px);
      text += row;
      continue;
    }
    std::snprintf(row, sizeof row, "%-*.40s  %s%s%s", pad, view.name.c_str(), style.fair,
                  reason_words(view.reason), style.off);
    text += row + (view.detail.empty() ? "" : ": " + view.detail) + "\n";
  }
  return text;
}

std::string summary(const std::vector<BoardView>& views, const Calibration& c,
                    const std::vector<Warning>& warnings, const std::string& notes,
                    const OutputSet& files) {
  const Style style = stdout_style();
  std::string text = views_table(views, c, style);
  char line[256];
  std::snprintf(line, sizeof line, "\n%sviews        %zu of %zu used%s\n", style.bold,
                c.fits.size(), views.size(), style.off);
  text += line + notes;
  const std::vector<std::string> names = intrinsic_names(c.lens);
  const std::vector<double> values = intrinsic_values(c);
  std::snprintf(line, sizeof line, "camera       %s, %dx%d\n", lens_name(c.lens), c.camera.width,
                c.camera.height);
  text += line;
  for (size_t i = 0; i < names.size(); ++i) {
    const bool begins = i == 0 || i == 4 || i == 8;
    text += begins ? std::string(i == 4   ? "distortion   "
                                 : i == 0 ? "pixels       "
                                          : "             ")
                   : ", ";
    text += with_sigma(names[i], values[i], c.sigma[i], i < 4 ? 2 : 4);
    if (i == 3 || i == 7 || i + 1 == names.size()) text += "\n";
  }
  double flattest = 90, steepest = 0;
  for (const ViewFit& fit : c.fits) {
    flattest = std::min(flattest, fit.tilt_deg);
    steepest = std::max(steepest, fit.tilt_deg);
  }
  std::snprintf(line, sizeof line,
                "RMS          %.3f px\ncoverage     %.0f %% of the image, tilt %.0f to %.0f deg\n",
                c.rms_px, 100 * c.coverage, flattest, steepest);
  text += line;
  for (const Warning& warning : warnings)
    text += std::string("warning      ") + style.poor + warning.name + style.off + ": " +
            warning.words + "\n";
  if (warnings.empty())
    text += std::string("verdict      ") + style.good + "good" + style.off + ", no warnings\n";
  text += "files        " + files.folder().string() + ":";
  for (const std::string& name : files.names()) text += " " + name;
  return text + "\n";
}

int calibrate(Arguments& a) {
  if (a.images.empty() == a.video.empty())
    throw BadInput("give either images or --video (see twoview calibrate --help)");
  a.board.inner = parse_board(a.board_text);
  for (const std::string& image : a.images)
    if (std::error_code error; std::filesystem::is_directory(image, error))
      throw BadInput(image + " is a folder: name the pictures in it, as " + image + "/*.jpg does");
  OutputSet files(a.common.output);
  for (const std::string& image : a.images) files.keep(image);
  if (!a.video.empty()) files.keep(a.video);
  files.require_own({"calibrate", kFiles, {"calibration.json"}, {}});
  // The searches run in forked processes, in which OpenCV's threads would not exist.
  cv::setNumThreads(1);
  cv::Size image;
  std::vector<BoardView> views = find_views(a, image);
  require_views(views, a);
  note_larger_board(views, a.common);
  const Calibration calibration = calibrate_camera(views, a.board, image, lens_of(a.model));
  const std::vector<Warning> warnings = warnings_of(calibration);

  files.add("camera.yaml", camera_yaml(calibration.camera) + sigmas_yaml(calibration));
  files.add("camera_info.yaml", camera_info_yaml(calibration));
  const Json json = calibration_json(views, calibration, warnings, a);
  files.add("calibration.json", json_text(json));
  files.add("detections.png", png_bytes(detections_picture(views, a.board)));
  files.add("coverage.png", png_bytes(coverage_picture(views, a.board, calibration)));
  files.add("residuals.png", png_bytes(residuals_picture(views, calibration)));
  if (a.common.json) print(json_text(json));
  note_large_square(a);
  const std::string notes = a.common.note_lines();
  if (a.common.speaks()) print(summary(views, calibration, warnings, notes, files));
  files.commit();
  return 0;
}

}  // namespace

void add_calibrate(CLI::App& program, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb =
      program.add_subcommand("calibrate", "a camera from pictures of a chessboard, with warnings");
  verb->add_option("IMAGE", a->images, "pictures of the board by one camera")->type_name("IMAGE");
  verb->add_option("--video", a->video,
                   "a video file, a camera's number, /dev/videoN, or an address")
      ->type_name("FILE|DEVICE");
  verb->add_option("--board", a->board_text, "inner corners of the board, columns x rows")
      ->required()
      ->check([](const std::string& text) {
        return parse_board(text).area() > 0
                   ? std::string()
                   : "'" + text + "' is not like 9x6, with 3 to 100 inner corners a side";
      })
      ->type_name("9x6");
  add_number(*verb, "square", &a->board.square, 1e-6, 100,
             "side of a square in metres, the unit of the views' poses; else they are in squares")
      ->each([a](const std::string&) { a->has_square = true; })
      ->type_name("METRES")
      ->default_str("");
  verb->add_option("--model", a->model,
                   "brown-conrady: k1 k2 p1 p2 k3; rational: and k4 k5 k6; "
                   "kannala-brandt: for fisheye lenses")
      ->check(CLI::IsMember({"brown-conrady", "rational", "kannala-brandt"}))
      ->capture_default_str();
  verb->add_option("--max-views", a->max_views, "use at most so many, the most different ones")
      ->check(CLI::Range(kMinViews, 200))
      ->capture_default_str();
  add_number(*verb, "duration", &a->duration_s, 1, 3600, "of a live source, seconds");
  add_common(*verb, a->common, 0, "folder for camera.yaml, camera_info.yaml and the pictures");
  verb->final_callback([a, &run] { run = [a] { return calibrate(*a); }; });
}

}  // namespace cli
