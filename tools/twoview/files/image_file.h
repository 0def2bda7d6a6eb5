// Image files: any that OpenCV reads, checked before and after decoding.
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>

#include "twoview/image.h"

namespace cli {

constexpr int kMaxSide = 16384;  // pixels, the library's limit

// An image as the library and the pictures need it.
struct Picture {
  std::string path;
  std::string name;                     // without the folder
  cv::Mat luma;                         // 8 bits
  cv::Mat colour;                       // 8-bit BGR, of the same size
  int file_width = 0, file_height = 0;  // before resizing

  tv_image view() const;
  // Pixels of this image for one pixel of the file: 1 unless resized.
  double scale_x() const { return static_cast<double>(luma.cols) / file_width; }
  double scale_y() const { return static_cast<double>(luma.rows) / file_height; }
};

// Reads and decodes. Luma is OpenCV's BGR2GRAY, 0.299 R + 0.587 G + 0.114 B; 16-bit samples are
// divided by 257 and rounded; alpha is dropped; an EXIF orientation is ignored, since intrinsics
// belong to the pixels as they are stored. Throws BadInput for what is missing, empty, no image,
// truncated, above kMaxSide a side (from the header where it is known), or of another depth.
Picture load_picture(const std::string& path);

// Every pixel as the file has it: 8 or 16 bits, 1, 3 (BGR) or 4 (BGRA) channels. Throws BadInput as
// load_picture.
cv::Mat load_pixels(const std::string& path);

// Scales down by area averaging so that the longer side is `longer` pixels. An image that is not
// longer stays as it is, and so does every image when `longer` is 0.
void shrink(Picture& picture, int longer);

// Turns by quarter turns counter-clockwise.
void turn(Picture& picture, int quarters);

// A depth map: one 32-bit float a pixel (TIFF or PFM). Throws BadInput.
cv::Mat load_depth(const std::string& path);

// An 8-bit BGR picture encoded as a file. JPEG, a tenth of PNG's size, is only for photographs that
// people look at.
std::string png_bytes(const cv::Mat& picture);
std::string jpeg_bytes(const cv::Mat& picture);

}  // namespace cli
