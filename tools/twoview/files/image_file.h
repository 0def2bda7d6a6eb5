// Reading, checking, resizing and writing image files of any format that OpenCV supports.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <string_view>

#include "files/exif.h"
#include "twoview/image.h"

namespace cli {

constexpr int kMaxSide = 16384;  // largest width or height, pixels: the library's limit

// An image in the forms that the library and the pictures of the report need.
struct Picture {
  std::string path;
  std::string name;                     // the file name without the folder
  cv::Mat luma;                         // 8-bit grey
  cv::Mat colour;                       // 8-bit BGR, of the size of luma
  cv::Mat mask;                         // of the size of luma, 0 where it is left out; may be empty
  int file_width = 0, file_height = 0;  // pixels, before resizing
  ExifFocal exif;
  int turn_deg = 0;           // how far a viewer turns it clockwise, which is not done here
  bool is_16bit = false;      // in its file
  bool has_more = false;      // pictures in its file, of which it is the first
  bool is_stretched = false;  // 16-bit samples that use less than half of their range

  tv_image view() const;
  tv_image mask_view() const;  // null data without a mask
  // The number of pixels of this image for one pixel of the file: 1 unless it was resized.
  double scale_x() const { return static_cast<double>(luma.cols) / file_width; }
  double scale_y() const { return static_cast<double>(luma.rows) / file_height; }
};

// Reads and decodes an image. Luma is OpenCV's BGR2GRAY, 0.299 R + 0.587 G + 0.114 B. 16-bit
// samples are scaled so that white (65535, a PNM file's own largest sample) becomes 255, or, where
// a picture uses less than half of that range, so that its 0.5 and 99.5 percentiles become 0 and
// 255; alpha is dropped. An EXIF orientation is ignored, since intrinsics refer to the pixels as
// they are stored. Throws BadInput for a file that is missing, empty, no image, truncated, of
// another depth or number of channels, or larger than kMaxSide on a side (checked in the header
// where the format is known).
Picture load_picture(const std::string& path);

// How pictures lie that a viewer turns by this many degrees: "the pictures are used as they are
// stored, lying on their side".
std::string stored_words(int turn_deg);

// The note on pictures that are stretched.
constexpr const char* kStretchedNote =
    "16-bit pictures that use less than half of their range are stretched to 8 bits, each from its "
    "0.5 to its 99.5 percentile";

// The note on files that hold more than the picture that is used.
constexpr const char* kMoreNote =
    "there are files that hold several pictures (pages of a TIFF, frames of an animation): the "
    "first of each is used";

// Decodes all pixels without conversion: 8 or 16 bits, 1, 3 (BGR) or 4 (BGRA) channels. Throws
// BadInput like load_picture. has_more, if given: set where the file holds more pictures than this.
cv::Mat load_pixels(const std::string& path, bool* has_more = nullptr);

// For the bytes of a HEIC, AVIF or GIF picture, which are not read: what it is and what to do, such
// as "is a HEIC picture, which is not read: convert it to JPEG". Empty for any other bytes.
std::string unread_picture(std::string_view bytes);
// The same for a file; empty if the file cannot be read.
std::string unread_picture_file(const std::string& path);

// The size to which shrink() brings an image of this size.
cv::Size shrunk_size(cv::Size size, int longer);

// Reduces the image by area averaging so that its longer side has `longer` pixels. It never
// enlarges; 0 means no resizing. A pixel is used where all pixels under it are, by the mask.
void shrink(Picture& picture, int longer);
// The same of a mask (255 used, 0 left out) alone.
cv::Mat shrunk_mask(const cv::Mat& mask, int longer);

// Rotates the image counter-clockwise by this number of quarter turns.
void turn(Picture& picture, int quarters);

// Reads a depth map: one 32-bit float a pixel (TIFF or PFM). Throws BadInput.
cv::Mat load_depth(const std::string& path);

// Encode an 8-bit BGR picture. Use JPEG, which is about ten times smaller than PNG, only for
// photographs that are shown to people.
std::string png_bytes(const cv::Mat& picture);
std::string jpeg_bytes(const cv::Mat& picture, int quality = 88);

}  // namespace cli
