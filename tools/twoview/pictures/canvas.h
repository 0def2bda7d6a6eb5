// Drawing with OpenCV, made legible: smooth text, see-through lines, two images on one sheet.
#pragma once

#include <opencv2/core.hpp>
#include <string>

namespace cli {

using Colour = cv::Scalar;  // blue green red

namespace ink {
const Colour paper(32, 24, 20), panel(44, 34, 28), grid(72, 60, 52), text(236, 230, 226),
    faint(170, 158, 150), accent(96, 178, 255), bad(92, 92, 235);
}

enum class Align { kLeft, kCentre, kRight };

// The text in the characters that the font of the pictures has, which are ASCII's: Latin letters
// lose their accents, and any other character becomes one underscore. Input is UTF-8; bytes that
// are not become an underscore each.
std::string plain_letters(const std::string& text);

// Text whose capitals are `height` pixels high, its baseline at `at`; drawn large and scaled down.
void put_text(cv::Mat& sheet, const std::string& text, cv::Point2d at, double height,
              const Colour& colour, Align align = Align::kLeft);
double text_width(const std::string& text, double height);

// Cut to a width with "..." in the middle.
std::string fitted(const std::string& text, double height, double width);

// Anti-aliased to a fraction of a pixel.
void put_line(cv::Mat& sheet, cv::Point2d a, cv::Point2d b, const Colour& colour,
              int thickness = 1);
void put_disc(cv::Mat& sheet, cv::Point2d centre, double radius, const Colour& colour);
void put_ring(cv::Mat& sheet, cv::Point2d centre, double radius, const Colour& colour,
              int thickness = 1);
void put_arrow(cv::Mat& sheet, cv::Point2d tail, cv::Point2d tip, const Colour& colour,
               int thickness = 2);

// The Turbo colour map, bright on dark; share in [0, 1].
Colour turbo(double share);
// The i-th of a row of clearly different colours.
Colour distinct(int index);

// Two images side by side, or one above the other where that fills the sheet better, each scaled by
// the same factor, with a caption strip below.
class PairSheet {
 public:
  // dim in (0, 1]: brightness of the images, which are shown in grey.
  PairSheet(const cv::Mat& image0, const cv::Mat& image1, double dim);
  // Sheet position of an image's pixel.
  cv::Point2d at(int image, double x, double y) const;
  cv::Rect frame(int image) const { return frame_[image]; }
  double scale() const { return scale_; }
  cv::Mat& sheet() { return sheet_; }
  // A part of the sheet that holds one image only, sharing its pixels.
  cv::Mat part(int image) { return sheet_(frame_[image]); }
  // The names over the images and one line below.
  void label(const std::string& name0, const std::string& name1, const std::string& caption);

 private:
  cv::Rect frame_[2];
  double scale_ = 1;
  cv::Mat sheet_;
};

}  // namespace cli
