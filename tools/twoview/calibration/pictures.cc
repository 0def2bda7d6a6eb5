#include "calibration/pictures.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

#include "pictures/canvas.h"

namespace cli {
namespace {

using Pixel = cv::Point2d;
constexpr int kGap = 16, kText = 11, kTitle = 40;
constexpr size_t kMaxThumbnails = 60;
const Colour kGood(140, 220, 130);

std::string words(const char* format, double a, double b = 0) {
  char text[160];
  std::snprintf(text, sizeof text, format, a, b);
  return text;
}

void put_panel(cv::Mat& sheet, cv::Rect place, const Colour& colour = ink::panel) {
  cv::rectangle(sheet, place, colour, cv::FILLED);
}

void put_title(cv::Mat& sheet, const std::string& text) {
  put_text(sheet, fitted(text, kText, sheet.cols - 2 * kGap), {double(kGap), 26}, kText, ink::text);
}

// The frame of the image on a sheet, and the scale from image to sheet.
struct ImagePanel {
  cv::Rect place;
  double scale;
  Pixel at(Pixel pixel) const {
    return {place.x + (pixel.x + 0.5) * scale - 0.5, place.y + (pixel.y + 0.5) * scale - 0.5};
  }
};

ImagePanel image_panel(const Calibration& c, cv::Point corner, int longer) {
  const double scale = longer / static_cast<double>(std::max(c.camera.width, c.camera.height));
  return {
      cv::Rect(corner, cv::Size(cvRound(c.camera.width * scale), cvRound(c.camera.height * scale))),
      scale};
}

// Draws the rows of the board as connected lines in reading order, with a ring around the first
// corner.
void put_board(cv::Mat& part, const BoardView& view, const Board& board, double scale) {
  const auto place = [&](size_t i) {
    return Pixel((view.corners[i].x + 0.5) * scale - 0.5, (view.corners[i].y + 0.5) * scale - 0.5);
  };
  for (size_t i = 0; i < view.corners.size(); ++i) {
    const Colour colour = distinct(static_cast<int>(i) / board.inner.width);
    if (i > 0) put_line(part, place(i - 1), place(i), colour);
    put_disc(part, place(i), 2.2, colour);
  }
  put_ring(part, place(0), 6, {255, 255, 255});
}

// The views that are drawn, in their original order. If not all fit, used views are preferred.
std::vector<const BoardView*> shown_views(const std::vector<BoardView>& views) {
  std::vector<const BoardView*> shown;
  for (const BoardView& view : views) shown.push_back(&view);
  if (shown.size() > kMaxThumbnails) {
    std::stable_sort(shown.begin(), shown.end(), [](const BoardView* a, const BoardView* b) {
      return static_cast<int>(a->reason) < static_cast<int>(b->reason);
    });
    shown.resize(kMaxThumbnails);
    // Pointers into one vector, so that this restores the original order.
    std::sort(shown.begin(), shown.end());
  }
  return shown;
}

// Draws the tilt of the board in each view as seen from the camera: the length is the tilt angle,
// and the direction is the one in which the board's face is turned.
void put_tilts(cv::Mat& sheet, cv::Rect place, const Calibration& c) {
  put_panel(sheet, place);
  const Pixel middle(place.x + place.width / 2.0, place.y + place.height / 2.0);
  constexpr double most = 60;  // tilt at the rim of the plot, degrees
  const double unit = (std::min(place.width, place.height) / 2.0 - 34) / most;
  for (const double ring : {15.0, 30.0, 45.0, 60.0}) {
    put_ring(sheet, middle, ring * unit, ink::grid);
    put_text(sheet, words("%.0f", ring), middle + Pixel(4, -ring * unit + 13), 8, ink::faint);
  }
  put_line(sheet, middle - Pixel(most * unit, 0), middle + Pixel(most * unit, 0), ink::grid);
  put_line(sheet, middle - Pixel(0, most * unit), middle + Pixel(0, most * unit), ink::grid);
  for (const ViewFit& fit : c.fits) {
    cv::Vec3d normal(fit.R(0, 2), fit.R(1, 2), fit.R(2, 2));
    if (normal.dot(fit.t) > 0) normal = -normal;  // the normal must point to the camera
    const double across = std::hypot(normal[0], normal[1]);
    const double reach = std::min(fit.tilt_deg, most) * unit;
    const Pixel way = across > 0 ? Pixel(normal[0], normal[1]) / across : Pixel(0, 0);
    put_disc(sheet, middle + reach * way, 5, ink::paper);
    put_disc(sheet, middle + reach * way, 3.6, distinct(static_cast<int>(fit.view)));
  }
  put_text(sheet, "tilt of the board, degrees", Pixel(place.x + 12.0, place.y + 22.0), kText,
           ink::text);
}

void put_cells(cv::Mat& sheet, const ImagePanel& panel, const std::vector<int>& counts) {
  const int most = *std::max_element(counts.begin(), counts.end());
  for (int row = 0; row < kCells; ++row)
    for (int column = 0; column < kCells; ++column) {
      const auto edge = [](int length, int i) { return length * i / kCells; };
      const cv::Point corner(edge(panel.place.width, column), edge(panel.place.height, row));
      const cv::Point end(edge(panel.place.width, column + 1), edge(panel.place.height, row + 1));
      const cv::Rect cell(panel.place.tl() + corner, panel.place.tl() + end);
      const int count = counts[static_cast<size_t>(row * kCells + column)];
      const double share = std::sqrt(count / std::max(1.0, double(most)));
      put_panel(
          sheet, cell,
          count ? ink::panel + share * (Colour(120, 96, 40) - ink::panel) : Colour(38, 30, 84));
      cv::rectangle(sheet, cell, ink::grid);
    }
}

// Draws all residuals around zero. The rings have radii of one and two times the RMS.
void put_scatter(cv::Mat& sheet, cv::Rect place, const Calibration& c) {
  put_panel(sheet, place);
  const Pixel middle(place.x + place.width / 2.0, place.y + place.height / 2.0);
  const double rms = std::max(c.rms_px, 1e-6);
  const double unit = (std::min(place.width, place.height) / 2.0 - 16) / (4 * rms);
  put_line(sheet, middle - Pixel(4 * rms * unit, 0), middle + Pixel(4 * rms * unit, 0), ink::grid);
  put_line(sheet, middle - Pixel(0, 4 * rms * unit), middle + Pixel(0, 4 * rms * unit), ink::grid);
  const cv::Rect whole(place);
  cv::Mat part = sheet(whole);
  for (const ViewFit& fit : c.fits)
    for (const Pixel& residual : fit.residuals)
      put_disc(part, middle - Pixel(place.tl()) + unit * residual, 1.6,
               distinct(static_cast<int>(fit.view)));
  for (const double times : {1.0, 2.0})
    put_ring(part, middle - Pixel(place.tl()), times * rms * unit, ink::text);
  put_text(sheet, words("all residuals; rings at %.2f and %.2f px", rms, 2 * rms),
           Pixel(place.x + 12.0, place.y + 22.0), kText, ink::text);
}

// Draws a bar for each view; the line is the RMS over all views.
void put_bars(cv::Mat& sheet, cv::Rect place, const std::vector<BoardView>& views,
              const Calibration& c) {
  put_panel(sheet, place);
  double most = 1e-6;
  for (const ViewFit& fit : c.fits) most = std::max(most, fit.rms_px);
  const double left = place.x + 12, right = place.br().x - 12;
  const double bottom = place.br().y - 28, top = place.y + 52;
  const double step = (right - left) / static_cast<double>(c.fits.size());
  const double line = bottom - (bottom - top) * c.rms_px / most;
  for (size_t i = 0; i < c.fits.size(); ++i) {
    const ViewFit& fit = c.fits[i];
    const double x = left + static_cast<double>(i) * step;
    const double y = bottom - (bottom - top) * fit.rms_px / most;
    cv::rectangle(sheet, cv::Point(cvRound(x + 0.12 * step), cvRound(y)),
                  cv::Point(cvRound(x + 0.88 * step), cvRound(bottom)),
                  distinct(static_cast<int>(fit.view)), cv::FILLED);
    if (step < 34) continue;
    // The number is written above its bar; where the line would then cross the number, above the
    // line.
    const bool is_crossed = line < y && line > y - 18;
    put_text(sheet, words("%.2f", fit.rms_px), {x + step / 2, (is_crossed ? line : y) - 6}, 8,
             ink::text, Align::kCentre);
    put_text(sheet, fitted(plain_letters(views[fit.view].name), 8, step - 6),
             {x + step / 2, bottom + 17}, 8, ink::faint, Align::kCentre);
  }
  put_line(sheet, {left, line}, {right, line}, ink::text);
  put_text(sheet, words("RMS by view, px; the line is that of all, %.2f", c.rms_px),
           Pixel(place.x + 12.0, place.y + 22.0), kText, ink::text);
}

}  // namespace

cv::Mat detections_picture(const std::vector<BoardView>& views, const Board& board) {
  const std::vector<const BoardView*> shown = shown_views(views);
  constexpr int width = 300, label = 44;
  int height = 1;
  for (const BoardView* view : shown)
    height = std::max(height, width * view->thumbnail.rows / view->thumbnail.cols);
  const int columns = std::clamp(static_cast<int>(std::ceil(std::sqrt(shown.size() * 1.6))), 1, 8);
  const int rows = (static_cast<int>(shown.size()) + columns - 1) / columns;
  cv::Mat sheet(kTitle + rows * (height + label) + kGap,
                std::max(columns, 2) * (width + kGap) + kGap, CV_8UC3, ink::paper);
  const auto num_used = std::count_if(views.begin(), views.end(),
                                      [](const BoardView& view) { return view.is_used(); });
  put_title(sheet, words("%.0f of %.0f views used", static_cast<double>(num_used),
                         static_cast<double>(views.size())) +
                       (shown.size() < views.size() ? ", not all are shown" : ""));
  for (size_t i = 0; i < shown.size(); ++i) {
    const BoardView& view = *shown[i];
    const cv::Point corner(kGap + static_cast<int>(i) % columns * (width + kGap),
                           kTitle + static_cast<int>(i) / columns * (height + label));
    const int own_height = std::max(1, width * view.thumbnail.rows / view.thumbnail.cols);
    cv::Mat grey, part = sheet(cv::Rect(corner, cv::Size(width, own_height)));
    cv::resize(view.thumbnail, grey, part.size(), 0, 0, cv::INTER_AREA);
    grey.convertTo(grey, CV_8U, view.is_used() ? 0.85 : 0.5);
    cv::cvtColor(grey, part, cv::COLOR_GRAY2BGR);
    const double scale = view.thumbnail_scale * width / view.thumbnail.cols;
    if (view.has_board()) put_board(part, view, board, scale);
    const Colour colour = view.is_used() ? kGood : ink::bad;
    cv::rectangle(sheet, cv::Rect(corner, part.size()), colour, view.is_used() ? 1 : 2);
    const double text_y = corner.y + own_height + 15;
    put_text(sheet, fitted(plain_letters(view.name), 9, width * 0.5), {double(corner.x), text_y}, 9,
             ink::text);
    put_text(sheet, fitted(reason_words(view.reason), 9, width * 0.48),
             {double(corner.x + width), text_y}, 9, colour, Align::kRight);
  }
  return sheet;
}

cv::Mat coverage_picture(const std::vector<BoardView>& views, const Board& board,
                         const Calibration& c) {
  const ImagePanel panel = image_panel(c, {kGap, kTitle}, 960);
  const int side = std::clamp(panel.place.height, 300, 480);
  cv::Mat sheet(kTitle + std::max(panel.place.height, side) + kGap,
                panel.place.br().x + kGap + side + kGap, CV_8UC3, ink::paper);
  const cv::Size image(c.camera.width, c.camera.height);
  put_cells(sheet, panel, corners_by_cell(views, image));
  cv::Mat part = sheet(panel.place);
  const Pixel origin(panel.place.tl());
  for (const ViewFit& fit : c.fits) {
    const Corners& corners = views[fit.view].corners;
    const Colour colour = distinct(static_cast<int>(fit.view));
    const size_t width = static_cast<size_t>(board.inner.width);
    const size_t rim[] = {0, width - 1, corners.size() - 1, corners.size() - width, 0};
    for (int i = 0; i < 4; ++i)
      put_line(part, panel.at(corners[rim[i]]) - origin, panel.at(corners[rim[i + 1]]) - origin,
               colour * 0.6);
    for (const cv::Point2f& corner : corners)
      put_disc(part, panel.at(corner) - origin, 1.8, colour);
  }
  put_tilts(sheet, cv::Rect(panel.place.br().x + kGap, kTitle, side, side), c);
  put_title(sheet, words("corners in %.0f %% of the image's 8 x 8 cells; red cells have none",
                         100 * c.coverage));
  return sheet;
}

cv::Mat residuals_picture(const std::vector<BoardView>& views, const Calibration& c) {
  const ImagePanel panel = image_panel(c, {kGap, kTitle}, 900);
  const int side = 440, bars = 220, top = std::max(panel.place.height, side);
  cv::Mat sheet(kTitle + top + kGap + bars + kGap, panel.place.br().x + kGap + side + kGap, CV_8UC3,
                ink::paper);
  put_panel(sheet, panel.place);
  cv::Mat part = sheet(panel.place);
  const Pixel origin(panel.place.tl());
  // Residuals are drawn enlarged by this factor: their root mean square is 12 pixels of the sheet.
  const double enlarged = 12 / std::max(c.rms_px, 1e-6);
  for (const ViewFit& fit : c.fits)
    for (size_t i = 0; i < fit.residuals.size(); ++i) {
      const Pixel from = panel.at(views[fit.view].corners[i]) - origin;
      put_line(part, from, from + enlarged * fit.residuals[i],
               distinct(static_cast<int>(fit.view)));
    }
  put_scatter(sheet, cv::Rect(panel.place.br().x + kGap, kTitle, side, side), c);
  put_bars(sheet, cv::Rect(kGap, kTitle + top + kGap, sheet.cols - 2 * kGap, bars), views, c);
  put_title(sheet, words("residuals where they lie in the image, %.0f times enlarged; %.2f px RMS. "
                         "Lines that agree in a place mean a lens model that does not fit there",
                         enlarged / panel.scale, c.rms_px));
  return sheet;
}

}  // namespace cli
