#include "pictures/canvas.h"

#include <algorithm>
#include <cmath>
#include <opencv2/imgproc.hpp>

namespace cli {
namespace {

constexpr int kFont = cv::FONT_HERSHEY_DUPLEX;
constexpr double kCapital = 21;  // height of the font's capitals at scale 1, pixels
// Text is drawn this many times larger, then reduced, so that it is smooth.
constexpr int kOver = 4;
constexpr int kShift = 4;  // fractional bits of OpenCV's drawing coordinates

cv::Point fixed_point(cv::Point2d p) {
  const double unit = 1 << kShift;
  const auto clamped = [&](double v) {
    return static_cast<int>(std::lround(std::min(std::max(v, -30000.0), 30000.0) * unit));
  };
  return {clamped(p.x), clamped(p.y)};
}

void blend(cv::Vec3b& pixel, const Colour& colour, double share) {
  for (int c = 0; c < 3; ++c)
    pixel[c] = cv::saturate_cast<uint8_t>(pixel[c] + share * (colour[c] - pixel[c]));
}

// Decodes the first UTF-8 character of `text` and sets `length` to its number of bytes. For an
// invalid byte it returns -1 with a length of one byte.
int32_t front_character(const char* text, size_t size, size_t& length) {
  const auto byte = [&](size_t i) { return static_cast<uint8_t>(text[i]); };
  const uint8_t first = byte(0);
  length = first < 0x80   ? 1
           : first < 0xC2 ? 0
           : first < 0xE0 ? 2
           : first < 0xF0 ? 3
           : first < 0xF5 ? 4
                          : 0;
  bool is_whole = length > 0 && length <= size;
  int32_t character = length == 1 ? first : first & (0x7F >> length);
  for (size_t i = 1; is_whole && i < length; ++i) {
    is_whole = (byte(i) & 0xC0) == 0x80;
    character = character << 6 | (byte(i) & 0x3F);
  }
  if (is_whole) return character;
  length = 1;
  return -1;
}

}  // namespace

std::string plain_letters(const std::string& text) {
  // The ASCII replacement of each letter from U+00C0 to U+017F, in order.
  static const char letters[] =
      "AAAAAAACEEEEIIIIDNOOOOOxOUUUUYTsaaaaaaaceeeeiiiidnooooo_ouuuuyty"
      "AaAaAaCcCcCcCcDdDdEeEeEeEeEeGgGgGgGgHhHhIiIiIiIiIiIiJjKkkLlLlLlLlLlNnNnNnnNnOoOoOoOoRrRrRr"
      "SsSsSsSsTtTtTtUuUuUuUuUuUuWwYyYZzZzZzs";
  static_assert(sizeof letters == 0x180 - 0xC0 + 1, "one letter each");
  std::string plain;
  for (size_t at = 0, length; at < text.size(); at += length) {
    const int32_t character = front_character(text.data() + at, text.size() - at, length);
    if (character >= ' ' && character < 0x7F)
      plain += static_cast<char>(character);
    else if (character >= 0xC0 && character < 0x180)
      plain += letters[character - 0xC0];
    // A combining accent (U+0300 to U+036F) is dropped.
    else if (character < 0x300 || character >= 0x370)
      plain += '_';
  }
  return plain;
}

double text_width(const std::string& text, double height) {
  int baseline = 0;
  const double large = height * kOver / kCapital;
  return cv::getTextSize(text, kFont, large, kOver, &baseline).width / static_cast<double>(kOver);
}

void put_text(cv::Mat& sheet, const std::string& text, cv::Point2d at, double height,
              const Colour& colour, Align align) {
  if (text.empty()) return;
  const double large = height * kOver / kCapital;
  const int thickness = std::max(1, static_cast<int>(std::lround(height * kOver / 11)));
  int descent = 0;
  const cv::Size size = cv::getTextSize(text, kFont, large, thickness, &descent);
  const double width = size.width / static_cast<double>(kOver);
  if (align == Align::kCentre) at.x -= width / 2;
  if (align == Align::kRight) at.x -= width;
  const int margin = 2 * kOver;
  const cv::Point corner(static_cast<int>(std::floor(at.x)) - 2,
                         static_cast<int>(std::floor(at.y - size.height / double(kOver))) - 2);
  cv::Mat mask(cv::Size((size.width + 2 * margin) / kOver + 2,
                        (size.height + descent + 2 * margin) / kOver + 3) *
                   kOver,
               CV_8U, cv::Scalar(0));
  cv::putText(mask, text,
              cv::Point(static_cast<int>((at.x - corner.x) * kOver),
                        static_cast<int>((at.y - corner.y) * kOver)),
              kFont, large, cv::Scalar(255), thickness, cv::LINE_AA);
  cv::resize(mask, mask, mask.size() / kOver, 0, 0, cv::INTER_AREA);
  const cv::Rect whole(0, 0, sheet.cols, sheet.rows);
  const cv::Rect place = cv::Rect(corner, mask.size()) & whole;
  for (int y = place.y; y < place.y + place.height; ++y)
    for (int x = place.x; x < place.x + place.width; ++x) {
      const double share = mask.at<uint8_t>(y - corner.y, x - corner.x) / 255.0;
      blend(sheet.at<cv::Vec3b>(y, x), colour, share);
    }
}

std::string fitted(const std::string& text, double height, double width) {
  if (text_width(text, height) <= width) return text;
  for (size_t keep = text.size(); keep > 4; --keep) {
    const std::string cut =
        text.substr(0, keep / 2) + "..." + text.substr(text.size() - (keep - keep / 2));
    if (text_width(cut, height) <= width) return cut;
  }
  return "...";
}

void put_line(cv::Mat& sheet, cv::Point2d a, cv::Point2d b, const Colour& colour, int thickness) {
  cv::line(sheet, fixed_point(a), fixed_point(b), colour, thickness, cv::LINE_AA, kShift);
}

void put_disc(cv::Mat& sheet, cv::Point2d centre, double radius, const Colour& colour) {
  // Each pixel is covered by its distance from the centre, because OpenCV draws a small disc as a
  // diamond.
  const int left = std::max(0, static_cast<int>(std::floor(centre.x - radius - 1)));
  const int top = std::max(0, static_cast<int>(std::floor(centre.y - radius - 1)));
  const int right = std::min(sheet.cols - 1, static_cast<int>(std::ceil(centre.x + radius + 1)));
  const int bottom = std::min(sheet.rows - 1, static_cast<int>(std::ceil(centre.y + radius + 1)));
  for (int y = top; y <= bottom; ++y)
    for (int x = left; x <= right; ++x) {
      const double cover = radius + 0.5 - std::hypot(x - centre.x, y - centre.y);
      blend(sheet.at<cv::Vec3b>(y, x), colour, std::min(std::max(cover, 0.0), 1.0));
    }
}

void put_ring(cv::Mat& sheet, cv::Point2d centre, double radius, const Colour& colour,
              int thickness) {
  cv::circle(sheet, fixed_point(centre), static_cast<int>(std::lround(radius * (1 << kShift))),
             colour, thickness, cv::LINE_AA, kShift);
}

void put_arrow(cv::Mat& sheet, cv::Point2d tail, cv::Point2d tip, const Colour& colour,
               int thickness) {
  const cv::Point2d along = tip - tail;
  const double length = std::hypot(along.x, along.y);
  if (length == 0) return;
  const cv::Point2d forward = along / length, side(-forward.y, forward.x);
  const double head = std::min(14.0, length / 2);
  put_line(sheet, tail, tip - head * 0.7 * forward, colour, thickness);
  const cv::Point corners[] = {fixed_point(tip),
                               fixed_point(tip - head * forward + head * 0.45 * side),
                               fixed_point(tip - head * forward - head * 0.45 * side)};
  cv::fillConvexPoly(sheet, corners, 3, colour, cv::LINE_AA, kShift);
}

Colour turbo(double share) {
  // OpenCV makes the whole map for each call, a third of the time of `reconstruct`.
  static const cv::Mat map = [] {
    cv::Mat levels(1, 256, CV_8U), colours;
    for (int k = 0; k < 256; ++k) levels.at<uchar>(0, k) = uchar(k);
    cv::applyColorMap(levels, colours, cv::COLORMAP_TURBO);
    return colours;
  }();
  const int level = int(std::lround(30 + 205 * std::min(std::max(share, 0.0), 1.0)));
  const cv::Vec3b bgr = map.at<cv::Vec3b>(0, level);
  return {double(bgr[0]), double(bgr[1]), double(bgr[2])};
}

Colour distinct(int index) {
  static const Colour colours[] = {
      {90, 200, 255},  {255, 190, 70},  {120, 230, 120}, {200, 120, 255}, {80, 130, 255},
      {240, 240, 110}, {150, 255, 210}, {255, 140, 180}, {60, 230, 230},  {255, 160, 120},
      {170, 170, 255}, {110, 255, 170}, {235, 205, 235}, {120, 190, 190}, {255, 215, 160}};
  constexpr int count = sizeof colours / sizeof *colours;
  return colours[index % count];
}

PairSheet::PairSheet(const cv::Mat& image0, const cv::Mat& image1, double dim) {
  constexpr int gap = 8, top = 34, bottom = 40, margin = 12;
  const bool stacked = image0.cols + image1.cols > 4.2 * std::max(image0.rows, image1.rows);
  const double across = stacked ? std::max(image0.cols, image1.cols) : image0.cols + image1.cols;
  scale_ = std::min(1600 / across, 3.0);
  const auto scaled = [&](const cv::Mat& image) {
    return cv::Size(std::max(1, static_cast<int>(std::lround(image.cols * scale_))),
                    std::max(1, static_cast<int>(std::lround(image.rows * scale_))));
  };
  const cv::Size size0 = scaled(image0), size1 = scaled(image1);
  frame_[0] = {cv::Point(margin, top), size0};
  frame_[1] = {stacked ? cv::Point(margin, top + size0.height + top)
                       : cv::Point(margin + size0.width + gap, top),
               size1};
  const int width = std::max({frame_[0].br().x, frame_[1].br().x, 560}) + margin;
  const int height = std::max(frame_[0].br().y, frame_[1].br().y) + bottom;
  sheet_ = cv::Mat(height, width, CV_8UC3, ink::paper);
  const cv::Mat* images[] = {&image0, &image1};
  for (int i = 0; i < 2; ++i) {
    cv::Mat grey, shown;
    cv::resize(*images[i], grey, frame_[i].size(), 0, 0,
               scale_ < 1 ? cv::INTER_AREA : cv::INTER_LINEAR);
    grey.convertTo(grey, CV_8U, dim);
    cv::cvtColor(grey, shown, cv::COLOR_GRAY2BGR);
    shown.copyTo(sheet_(frame_[i]));
  }
}

cv::Point2d PairSheet::at(int image, double x, double y) const {
  return {frame_[image].x + (x + 0.5) * scale_ - 0.5, frame_[image].y + (y + 0.5) * scale_ - 0.5};
}

void PairSheet::label(const std::string& name0, const std::string& name1,
                      const std::string& caption) {
  const std::string names[] = {plain_letters(name0), plain_letters(name1)};
  for (int i = 0; i < 2; ++i)
    put_text(sheet_, fitted(names[i], 11, std::max(frame_[i].width, 200)),
             {double(frame_[i].x), frame_[i].y - 11.0}, 11, ink::text);
  put_text(sheet_, fitted(caption, 11, sheet_.cols - 24), {12, sheet_.rows - 15.0}, 11, ink::text);
}

}  // namespace cli
