// The size in an image file's header, and whether the file is complete. Both are read before
// decoding: a small file must not make the decoder allocate a huge buffer, and some decoders fill
// missing pixels with grey without an error.
#pragma once

#include <cstdint>
#include <string_view>

namespace cli {

struct ImageHeader {
  int64_t width = 0, height = 0;  // 0 when the format is not one of those below
  bool truncated = false;         // the end mark that the format requires is missing
};

// Parses the headers of PNG, JPEG, BMP, PNM and TIFF. Never fails, and reads inside `bytes` only.
ImageHeader read_image_header(std::string_view bytes);

}  // namespace cli
