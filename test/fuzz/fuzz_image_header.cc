// Headers of image files: the first bytes of each file type, followed by any bytes.
#include <iterator>
#include <string>

#include "files/image_header.h"
#include "fuzz.h"

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  using namespace std::string_literals;
  static const std::string beginnings[] = {
      ""s,
      "\x89PNG\r\n\x1a\n\0\0\0\rIHDR\0\0\1\2\0\0\0\7\b\0\0\0\0CCCC"s,
      "\x89PNG\r\n\x1a\n"s,
      "\xff\xd8\xff\xe0\0\4xx\xff\xc2\0\x0b\b\0\7\1\2\1\1\x11\0"s,
      "\xff\xd8"s,
      "P5 #c\n"s,
      "P6 2 3 255\n"s,
      "BM............\x28\0\0\0"s,
      "II*\0\b\0\0\0\2\0"s,
      "MM\0*\0\0\0\b\0\2"s};
  if (size == 0) return 0;
  const std::string rest(reinterpret_cast<const char*>(data) + 1, size - 1);
  const std::string bytes = beginnings[data[0] % std::size(beginnings)] + rest;
  const cli::ImageHeader header = cli::read_image_header(bytes);
  FUZZ_REQUIRE(header.width >= 0 && header.height >= 0);
  return 0;
}
