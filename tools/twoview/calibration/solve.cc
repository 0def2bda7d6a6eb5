#include "calibration/solve.h"

#include <algorithm>
#include <cmath>
#include <numeric>
#include <opencv2/calib3d.hpp>

#include "base/error.h"
#include "base/median.h"
#include "calibration/two_cameras.h"

namespace cli {
namespace {

constexpr double kDegrees = 57.29577951308232;  // degrees in a radian
// A view is rejected if its error is above kOutlierRatio times the median error and is also more
// than kOutlierPx pixels above it.
constexpr double kOutlierRatio = 3, kOutlierPx = 0.3;
constexpr int kOutlierRounds = 5;
// A warning is given for fewer views than kFewViews, for fewer than kTiltedViews views that are
// tilted by at least kTiltedDeg, for corners in a smaller share of the 8 x 8 cells of the image
// than kLittleCoverage, and for an RMS outside the last two limits.
constexpr size_t kFewViews = 10, kTiltedViews = 4;
constexpr double kTiltedDeg = 15, kLittleCoverage = 0.6, kHighRmsPx = 0.5, kLowRmsPx = 0.1;
// A larger standard deviation gives a warning: those of fx and fy as a share of these, and those of
// cx and cy as a share of the image width.
constexpr double kLargeFocalSigma = 0.005, kLargeCentreSigma = 0.005;
constexpr int kPose = 6;  // parameters of a view's pose

std::vector<cv::Point3f> corners_of(const Board& board) {
  std::vector<cv::Point3f> corners;
  for (int r = 0; r < board.inner.height; ++r)
    for (int c = 0; c < board.inner.width; ++c)
      corners.emplace_back(float(c * board.square), float(r * board.square), 0.0F);
  return corners;
}

// The output of OpenCV's calibration functions.
struct Answer {
  cv::Matx33d K = cv::Matx33d::eye();
  cv::Mat distortion;
  std::vector<cv::Mat> rotations, translations;
};

// The squared residuals of each view as a function of the camera. With J = [A | B], where A holds
// the derivatives by the camera and B those by the view's own pose, the view's information is
// A'A - A'B (B'B)^-1 B'A.
std::vector<ViewForm> forms_of(const std::vector<cv::Point3f>& board,
                               const std::vector<Corners>& seen, const Answer& answer, Lens lens) {
  const int shared = 4 + static_cast<int>(distortion_names(lens).size());
  const std::vector<cv::Point3d> points(board.begin(), board.end());
  std::vector<ViewForm> forms(seen.size());
  for (size_t i = 0; i < seen.size(); ++i) {
    std::vector<cv::Point2d> projected;
    cv::Mat J, A, B;
    const cv::Mat &rotation = answer.rotations[i], &translation = answer.translations[i];
    if (lens == Lens::kKannalaBrandt) {
      cv::fisheye::projectPoints(points, projected, rotation, translation, answer.K,
                                 answer.distortion, 0, J);
      A = J.colRange(0, shared);  // columns of J: camera, pose, skew
      B = J.colRange(shared, shared + kPose);
    } else {
      cv::projectPoints(points, rotation, translation, answer.K, answer.distortion, projected, J);
      B = J.colRange(0, kPose);
      A = J.colRange(kPose, kPose + shared);
    }
    std::vector<cv::Point2d> residuals;
    for (size_t j = 0; j < projected.size(); ++j)
      residuals.push_back(cv::Point2d(seen[i][j]) - projected[j]);
    const cv::Mat r = cv::Mat(residuals).reshape(1, 2 * static_cast<int>(residuals.size()));
    const cv::Mat across = A.t() * B * (B.t() * B).inv(cv::DECOMP_SVD);
    forms[i].information = A.t() * A - across * (B.t() * A);
    forms[i].gradient = A.t() * r - across * (B.t() * r);
    forms[i].sum_sq = r.dot(r);
  }
  return forms;
}

// Standard deviations of fx fy cx cy and the distortion. OpenCV's own values are not used:
// cv::fisheye does not return them, and those of calibrateCamera are too large up to OpenCV 4.6,
// which counts a corner as one measurement.
std::vector<double> sigma_of(const std::vector<ViewForm>& forms, size_t num_corners) {
  const int shared = forms[0].gradient.rows;
  cv::Mat information = cv::Mat::zeros(shared, shared, CV_64F);
  double sum_sq = 0;
  for (const ViewForm& form : forms) {
    information += form.information;
    sum_sq += form.sum_sq;
  }
  const double num_values =
      static_cast<double>(forms.size()) * (2.0 * static_cast<double>(num_corners) - kPose);
  const cv::Mat covariance =
      information.inv(cv::DECOMP_SVD) * (sum_sq / std::max(1.0, num_values - shared));
  std::vector<double> sigma;
  for (int i = 0; i < shared; ++i) sigma.push_back(std::sqrt(covariance.at<double>(i, i)));
  return sigma;
}

Answer solve_fisheye(const std::vector<cv::Point3f>& board, const std::vector<Corners>& seen,
                     cv::Size image) {
  Answer answer;
  const std::vector<cv::Point3d> precise(board.begin(), board.end());
  const std::vector<std::vector<cv::Point3d>> points(seen.size(), precise);
  std::vector<std::vector<cv::Point2d>> pixels;
  for (const Corners& corners : seen) pixels.emplace_back(corners.begin(), corners.end());
  cv::Mat K;
  cv::fisheye::calibrate(
      points, pixels, image, K, answer.distortion, answer.rotations, answer.translations,
      cv::fisheye::CALIB_RECOMPUTE_EXTRINSIC | cv::fisheye::CALIB_FIX_SKEW,
      cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-12));
  answer.K = K;
  return answer;
}

Answer solve_pinhole(const std::vector<cv::Point3f>& board, const std::vector<Corners>& seen,
                     cv::Size image, Lens lens) {
  Answer answer;
  const std::vector<std::vector<cv::Point3f>> points(seen.size(), board);
  cv::Mat K;
  cv::calibrateCamera(
      points, seen, image, K, answer.distortion, answer.rotations, answer.translations,
      lens == Lens::kRational ? cv::CALIB_RATIONAL_MODEL : 0,
      cv::TermCriteria(cv::TermCriteria::COUNT + cv::TermCriteria::EPS, 200, 1e-12));
  answer.K = K;
  return answer;
}

tv_camera camera_of(const Answer& answer, cv::Size image, Lens lens) {
  tv_camera camera{};
  camera.model = lens == Lens::kKannalaBrandt ? TV_CAMERA_KANNALA_BRANDT : TV_CAMERA_BROWN_CONRADY;
  camera.width = image.width;
  camera.height = image.height;
  camera.fx = answer.K(0, 0);
  camera.fy = answer.K(1, 1);
  camera.cx = answer.K(0, 2);
  camera.cy = answer.K(1, 2);
  const size_t count = distortion_names(lens).size();
  for (size_t i = 0; i < count; ++i) camera.k[i] = answer.distortion.at<double>(int(i));
  return camera;
}

// The pose, tilt and residuals of one view. They are computed with the library's projection, so
// that the reported residuals are valid for the lens model that twoview uses.
ViewFit fit_of(const tv_camera& camera, const std::vector<cv::Point3f>& board, const Corners& seen,
               const cv::Mat& rotation, const cv::Mat& translation) {
  ViewFit fit;
  cv::Rodrigues(rotation, fit.R);
  fit.t =
      cv::Vec3d(translation.at<double>(0), translation.at<double>(1), translation.at<double>(2));
  std::vector<cv::Vec3d> points;
  for (const cv::Point3f& corner : board)
    points.push_back(fit.R * cv::Vec3d(corner.x, corner.y, corner.z) + fit.t);
  std::vector<cv::Vec2d> pixels(points.size());
  std::vector<uint8_t> inside(points.size());
  check(tv_camera_project_points(&camera, points[0].val, static_cast<int32_t>(points.size()),
                                 pixels[0].val, inside.data()),
        "cannot project the board");
  double sum_sq = 0;
  cv::Vec3d middle;
  for (size_t i = 0; i < points.size(); ++i) {
    middle += points[i];
    if (!inside[i])
      throw BadInput(
          "the lens that was fitted does not reach the board's corners: photograph the "
          "board in more places, or try another --model");
    const cv::Point2d residual(seen[i].x - pixels[i][0], seen[i].y - pixels[i][1]);
    fit.residuals.push_back(residual);
    sum_sq += residual.dot(residual);
  }
  fit.rms_px = std::sqrt(sum_sq / static_cast<double>(points.size()));
  const cv::Vec3d normal(fit.R(0, 2), fit.R(1, 2), fit.R(2, 2));
  fit.tilt_deg =
      kDegrees * std::acos(std::min(1.0, std::abs(normal.dot(middle)) / cv::norm(middle)));
  return fit;
}

Calibration solve_once(const std::vector<BoardView>& views, const Board& board, cv::Size image,
                       Lens lens, std::vector<ViewForm>& forms) {
  std::vector<Corners> seen;
  std::vector<size_t> indices;
  for (size_t i = 0; i < views.size(); ++i) {
    if (!views[i].is_used()) continue;
    seen.push_back(views[i].corners);
    indices.push_back(i);
  }
  const std::vector<cv::Point3f> corners = corners_of(board);
  Calibration result;
  result.lens = lens;
  Answer answer;
  try {
    answer = lens == Lens::kKannalaBrandt ? solve_fisheye(corners, seen, image)
                                          : solve_pinhole(corners, seen, image, lens);
  } catch (const cv::Exception&) {
    throw BadInput(
        std::string("no ") + lens_name(lens) +
        " camera explains these views: tilt the board in more directions, or try another "
        "--model");
  }
  result.camera = camera_of(answer, image, lens);
  check(tv_camera_check(&result.camera), "no camera explains these views");
  forms = forms_of(corners, seen, answer, lens);
  result.sigma = sigma_of(forms, corners.size());
  double sum_sq = 0;
  for (size_t i = 0; i < seen.size(); ++i) {
    ViewFit fit =
        fit_of(result.camera, corners, seen[i], answer.rotations[i], answer.translations[i]);
    fit.view = indices[i];
    sum_sq += fit.rms_px * fit.rms_px;
    result.fits.push_back(std::move(fit));
  }
  result.rms_px = std::sqrt(sum_sq / static_cast<double>(seen.size()));
  return result;
}

// Marks views whose error is above the limit of kOutlierRatio and kOutlierPx, the worst first, as
// long as kMinViews and two thirds of num_at_first views remain. Returns true if a view was marked.
bool reject_outliers(std::vector<BoardView>& views, Calibration& calibration, size_t num_at_first) {
  std::vector<double> errors;
  for (const ViewFit& fit : calibration.fits) errors.push_back(fit.rms_px);
  const double usual = median_of(errors);
  const double limit = std::max(kOutlierRatio * usual, usual + kOutlierPx);
  size_t left = calibration.fits.size();
  std::sort(calibration.fits.begin(), calibration.fits.end(),
            [](const ViewFit& a, const ViewFit& b) { return a.rms_px > b.rms_px; });
  bool is_any = false;
  for (const ViewFit& fit : calibration.fits) {
    if (fit.rms_px <= limit || 3 * (left - 1) < 2 * num_at_first || left - 1 < kMinViews) break;
    char text[64];
    std::snprintf(text, sizeof text, "%.2f px, the median is %.2f", fit.rms_px, usual);
    views[fit.view].reason = Reason::kOutlier;
    views[fit.view].detail = text;
    --left;
    is_any = true;
  }
  return is_any;
}

std::string formatted(const char* format, double a, double b = 0) {
  char text[240];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

// The names of views, at most kNamed of them, such as "a.png, b.png and 4 more".
std::string names_of(const std::vector<BoardView>& views, const std::vector<size_t>& indices) {
  constexpr size_t kNamed = 8;
  std::string text;
  for (size_t i = 0; i < std::min(indices.size(), kNamed); ++i)
    text += (i ? ", " : "") + views[indices[i]].name;
  if (indices.size() <= kNamed) return text;
  return text + " and " + std::to_string(indices.size() - kNamed) + " more";
}

// Marks a part of at most a third of the views that another camera saw as outliers, and describes
// it where it is more than one view. Throws BadInput if the part is larger. Returns false if one
// camera explains the views, or they are too few to tell.
bool set_aside_second_camera(std::vector<BoardView>& views, const Calibration& c,
                             const std::vector<ViewForm>& forms, std::string& description) {
  if (c.fits.size() < kFewViews) return false;
  const SecondCamera second = find_second_camera(forms);
  if (second.views.empty()) return false;
  std::vector<size_t> indices;
  for (const size_t i : second.views) indices.push_back(c.fits[i].view);
  char change[120];
  std::snprintf(change, sizeof change,
                "about (%.0f, %.0f) px in the centre, (%.1f, %.1f) %% in fx and fy",
                second.change[2], second.change[3], 100 * second.change[0] / c.camera.fx,
                100 * second.change[1] / c.camera.fy);
  const std::string text =
      std::to_string(indices.size()) + " of " + std::to_string(forms.size()) +
      " views contradict the others, " + change + ": " + names_of(views, indices) +
      " (cropped, shifted, turned, mirrored, stretched, zoomed, or of another camera?)";
  if (3 * indices.size() > forms.size())
    throw BadInput(text + "; one camera for all is that of neither: calibrate each part by itself");
  for (const size_t i : indices) {
    views[i].reason = Reason::kOutlier;
    views[i].detail = std::string("contradicts the others, ") + change;
  }
  if (indices.size() > 1) description = text + ": they are left out";
  return true;
}

// Returns true if the four corner pixels of the image have rays.
bool reaches_the_image_corners(const tv_camera& camera) {
  for (const double x : {0.0, camera.width - 1.0})
    for (const double y : {0.0, camera.height - 1.0}) {
      const double pixel[2] = {x, y};
      double ray[3];
      if (tv_camera_unproject(&camera, pixel, ray, nullptr) != TV_OK) return false;
    }
  return true;
}

}  // namespace

const char* lens_name(Lens lens) {
  constexpr const char* names[] = {"brown-conrady", "rational", "kannala-brandt"};
  return names[static_cast<int>(lens)];
}

std::vector<std::string> distortion_names(Lens lens) {
  if (lens == Lens::kKannalaBrandt) return {"k1", "k2", "k3", "k4"};
  if (lens == Lens::kBrownConrady) return {"k1", "k2", "p1", "p2", "k3"};
  return {"k1", "k2", "p1", "p2", "k3", "k4", "k5", "k6"};
}

std::vector<int> corners_by_cell(const std::vector<BoardView>& views, cv::Size image) {
  std::vector<int> counts(kCells * kCells, 0);
  for (const BoardView& view : views) {
    if (!view.is_used()) continue;
    for (const cv::Point2f& corner : view.corners) {
      const int column = std::clamp(int((corner.x + 0.5) * kCells / image.width), 0, kCells - 1);
      const int row = std::clamp(int((corner.y + 0.5) * kCells / image.height), 0, kCells - 1);
      ++counts[static_cast<size_t>(row * kCells + column)];
    }
  }
  return counts;
}

Calibration calibrate_camera(std::vector<BoardView>& views, const Board& board, cv::Size image,
                             Lens lens) {
  std::vector<ViewForm> forms;
  Calibration result = solve_once(views, board, image, lens, forms);
  std::string contradiction;
  if (set_aside_second_camera(views, result, forms, contradiction))
    result = solve_once(views, board, image, lens, forms);
  const size_t num_at_first = result.fits.size();
  for (int round = 0; round < kOutlierRounds; ++round) {
    if (!reject_outliers(views, result, num_at_first)) break;
    result = solve_once(views, board, image, lens, forms);
  }
  result.contradiction = contradiction;
  std::sort(result.fits.begin(), result.fits.end(),
            [](const ViewFit& a, const ViewFit& b) { return a.view < b.view; });
  const std::vector<int> cells = corners_by_cell(views, image);
  const auto num_filled = std::count_if(cells.begin(), cells.end(), [](int n) { return n > 0; });
  result.coverage = static_cast<double>(num_filled) / static_cast<double>(cells.size());
  return result;
}

std::vector<Warning> warnings_of(const Calibration& c) {
  std::vector<Warning> warnings;
  if (!c.contradiction.empty()) warnings.push_back({"contradicting_views", c.contradiction});
  const double num_views = static_cast<double>(c.fits.size());
  if (c.fits.size() < kFewViews)
    warnings.push_back(
        {"few_views", formatted("%.0f views: take at least 10, 15 are better", num_views)});
  if (c.coverage < kLittleCoverage)
    warnings.push_back(
        {"poor_coverage",
         formatted("corners in %.0f %% of the image: bring the board to the edges and corners that "
                   "coverage.png shows empty",
                   100 * c.coverage)});
  const auto num_tilted = std::count_if(
      c.fits.begin(), c.fits.end(), [](const ViewFit& fit) { return fit.tilt_deg >= kTiltedDeg; });
  if (static_cast<size_t>(num_tilted) < kTiltedViews)
    warnings.push_back(
        {"little_tilt", formatted("%.0f views tilted by %.0f degrees or more: without tilt focal "
                                  "length and distance are one; tilt the board by 20 to 45 degrees "
                                  "in each direction",
                                  static_cast<double>(num_tilted), kTiltedDeg)});
  if (c.rms_px > kHighRmsPx)
    warnings.push_back(
        {"high_rms", formatted("RMS %.2f px, usual are 0.1 to 0.5: a bent board, blur, a rolling "
                               "shutter, a zoom that moved, or a lens that wants another --model",
                               c.rms_px)});
  if (c.rms_px < kLowRmsPx)
    warnings.push_back({"low_rms", formatted("RMS %.3f px, usual are 0.1 to 0.5: are these "
                                             "photographs, and different ones?",
                                             c.rms_px)});
  const double focal_sigma = std::max(c.sigma[0] / c.camera.fx, c.sigma[1] / c.camera.fy);
  if (!(focal_sigma <= kLargeFocalSigma))
    warnings.push_back(
        {"uncertain_focal_length",
         formatted("standard deviation %.1f %%: more views, tilted and near", 100 * focal_sigma)});
  const double centre_sigma = std::max(c.sigma[2], c.sigma[3]);
  if (!(centre_sigma <= kLargeCentreSigma * c.camera.width))
    warnings.push_back({"uncertain_centre",
                        formatted("standard deviation %.1f px: more views, tilted left, right, up "
                                  "and down, and some with the camera rolled",
                                  centre_sigma)});
  if (!reaches_the_image_corners(c.camera))
    warnings.push_back({"lens_ends_early",
                        "the fitted lens turns back within the image: bring the board into the "
                        "image's corners, or try another --model"});
  return warnings;
}

}  // namespace cli
