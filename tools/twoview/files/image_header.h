// The size that an image file's header claims, and whether the file is all there: read before
// decoding, so that a small file cannot ask for a huge buffer, and since some decoders fill what is
// missing with grey instead of saying so.
#pragma once

#include <cstdint>
#include <string_view>

namespace cli {

struct ImageHeader {
  int64_t width = 0, height = 0;  // 0: the format is not one that is looked into
  bool truncated = false;         // the end that the format demands is missing
};

// PNG, JPEG, BMP, PNM and TIFF are looked into. Never fails; reads inside `bytes` only.
ImageHeader read_image_header(std::string_view bytes);

}  // namespace cli
