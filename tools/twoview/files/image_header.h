// Reads the image size from a file's header, and finds truncated PNG, JPEG and binary PNM files.
// Both happen before decoding, because a small file must not make the decoder allocate a huge
// buffer, and some decoders fill missing pixels with grey without reporting an error.
#pragma once

#include <cstdint>
#include <string_view>

namespace cli {

struct ImageHeader {
  int64_t width = 0, height = 0;  // 0 if unknown: another format, or cut within the header
  int64_t max_sample = 0;         // PNM: the sample that is white; 0 for other formats
  bool is_binary_pnm = false;     // P5 or P6
  bool has_more = false;          // TIFF: pages but for previews and masks; PNG, WebP: animated
  bool truncated = false;         // the file ends early: PNG, JPEG, binary PNM
  // JPEG: what a panorama's XMP says of its projection, such as "equirectangular"; else empty. It
  // lies in the bytes that were read.
  std::string_view panorama;
};

// Parses the headers of PNG, JPEG, BMP, PNM and TIFF, and whether WebP is animated. It never fails
// and never reads outside `bytes`.
ImageHeader read_image_header(std::string_view bytes);

}  // namespace cli
