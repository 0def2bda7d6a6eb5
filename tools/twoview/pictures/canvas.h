// Drawing on top of OpenCV: smooth text and lines, and sheets with two images.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace cli {

using Colour = cv::Scalar;  // in the order blue, green, red

namespace ink {
const Colour paper(32, 24, 20), panel(44, 34, 28), grid(72, 60, 52), text(236, 230, 226),
    faint(170, 158, 150), accent(96, 178, 255), bad(92, 92, 235);
}

enum class Align { kLeft, kCentre, kRight };

// Converts UTF-8 text to the ASCII characters that the font has. Latin letters lose their accents,
// and combining accents are dropped; any other character, and each invalid byte, becomes one
// underscore.
std::string plain_letters(const std::string& text);

// Draws text with capitals `height` pixels high and its baseline at `at`. The text is drawn large
// and reduced, which makes it smooth.
void put_text(cv::Mat& sheet, const std::string& text, cv::Point2d at, double height,
              const Colour& colour, Align align = Align::kLeft);
double text_width(const std::string& text, double height);

// Returns the text, shortened by "..." in its middle if it is wider than `width` pixels.
std::string fitted(const std::string& text, double height, double width);

// Draws an anti-aliased line with end points of sub-pixel precision.
void put_line(cv::Mat& sheet, cv::Point2d a, cv::Point2d b, const Colour& colour,
              int thickness = 1);
void put_disc(cv::Mat& sheet, cv::Point2d centre, double radius, const Colour& colour);
void put_ring(cv::Mat& sheet, cv::Point2d centre, double radius, const Colour& colour,
              int thickness = 1);
void put_arrow(cv::Mat& sheet, cv::Point2d tail, cv::Point2d tip, const Colour& colour,
               int thickness = 2);

// The Turbo colour map for bright colours on a dark background; `share` is in [0, 1].
Colour turbo(double share);
// The i-th of 15 clearly different colours, which repeat.
Colour distinct(int index);

// A sheet with two images and a caption strip below. The images stand side by side, or one above
// the other if they are very wide, and are scaled by the same factor.
class PairSheet {
 public:
  // The images are shown in grey with the brightness `dim`, in (0, 1].
  PairSheet(const cv::Mat& image0, const cv::Mat& image1, double dim);
  // The position on the sheet of a pixel of an image.
  cv::Point2d at(int image, double x, double y) const;
  cv::Rect frame(int image) const { return frame_[image]; }
  double scale() const { return scale_; }
  cv::Mat& sheet() { return sheet_; }
  // The part of the sheet that holds one image. It shares the sheet's pixels, so drawing on it is
  // clipped to the image.
  cv::Mat part(int image) { return sheet_(frame_[image]); }
  // Draws the name above each image and the caption below.
  void label(const std::string& name0, const std::string& name1, const std::string& caption);

 private:
  cv::Rect frame_[2];
  double scale_ = 1;
  cv::Mat sheet_;
};

}  // namespace cli
