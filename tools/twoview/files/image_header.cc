#include "files/image_header.h"

#include <cctype>

namespace cli {
namespace {

using Bytes = std::string_view;

// Reads an unsigned integer of either byte order; 0 if it lies beyond the end.
uint64_t number(Bytes bytes, size_t at, int count, bool big_endian) {
  uint64_t value = 0;
  if (at > bytes.size() || bytes.size() - at < static_cast<size_t>(count)) return 0;
  for (int i = 0; i < count; ++i) {
    const int place = big_endian ? i : count - 1 - i;
    value = value << 8 | static_cast<uint8_t>(bytes[at + static_cast<size_t>(place)]);
  }
  return value;
}

bool starts_with(Bytes bytes, Bytes start) { return bytes.substr(0, start.size()) == start; }

ImageHeader read_png(Bytes bytes) {
  ImageHeader header;
  header.width = static_cast<int64_t>(number(bytes, 16, 4, true));
  header.height = static_cast<int64_t>(number(bytes, 20, 4, true));
  header.truncated = true;
  for (size_t at = 8; at + 12 <= bytes.size();) {  // PNG chunk: length, type, data, checksum
    const uint64_t length = number(bytes, at, 4, true);
    if (length > bytes.size() - at - 12) break;
    if (bytes.substr(at + 4, 4) == "acTL")  // animated: the number of frames comes first
      header.has_more = number(bytes, at + 8, 4, true) > 1;
    if (bytes.substr(at + 4, 4) == "IEND") header.truncated = false;
    at += static_cast<size_t>(length) + 12;
  }
  return header;
}

// What Google's GPano schema says in a JPEG's XMP, as an attribute or as an element. 360-degree
// cameras and phones that stitch write it.
Bytes panorama_in(Bytes xmp) {
  constexpr Bytes kId("http://ns.adobe.com/xap/1.0/\0", 29), kName("GPano:ProjectionType");
  if (!starts_with(xmp, kId)) return {};
  const size_t name = xmp.find(kName);
  if (name == Bytes::npos) return {};
  const size_t begin = xmp.find_first_not_of(" \t\r\n=\"'>", name + kName.size());
  if (begin == Bytes::npos) return {};
  size_t end = begin;
  while (end < xmp.size() && std::isalnum(static_cast<unsigned char>(xmp[end])) != 0) ++end;
  return xmp.substr(begin, end - begin);
}

ImageHeader read_jpeg(Bytes bytes) {
  ImageHeader header;
  header.truncated = true;
  size_t at = 2;
  while (at + 4 <= bytes.size()) {
    if (bytes[at] != '\xff') return header;
    const auto marker = static_cast<uint8_t>(bytes[at + 1]);
    if (marker == 0xff) {  // 0xff before a marker is a fill byte
      ++at;
      continue;
    }
    const bool is_size =
        marker >= 0xc0 && marker <= 0xcf && marker != 0xc4 && marker != 0xc8 && marker != 0xcc;
    if (is_size) {
      header.height = static_cast<int64_t>(number(bytes, at + 5, 2, true));
      header.width = static_cast<int64_t>(number(bytes, at + 7, 2, true));
    }
    if (marker == 0xda) {  // start of scan: compressed data follow
      header.truncated = bytes.find("\xff\xd9", at) == Bytes::npos;
      return header;
    }
    const auto length = static_cast<size_t>(number(bytes, at + 2, 2, true));
    if (marker == 0xe1 && length > 2 && header.panorama.empty())
      header.panorama = panorama_in(bytes.substr(at + 4, length - 2));
    at += 2 + length;
  }
  return header;
}

ImageHeader read_bmp(Bytes bytes) {
  ImageHeader header;
  const bool is_core = number(bytes, 14, 4, false) == 12;
  const int count = is_core ? 2 : 4;
  header.width = static_cast<int64_t>(number(bytes, 18, count, false));
  header.height =
      static_cast<int64_t>(number(bytes, 18 + static_cast<size_t>(count), count, false));
  if (!is_core && header.height > INT32_MAX) header.height = (int64_t{1} << 32) - header.height;
  return header;
}

ImageHeader read_pnm(Bytes bytes) {
  ImageHeader header;
  size_t at = 2;
  int64_t values[3] = {0, 0, 1};  // PNM header: width, height, largest sample
  const char kind = bytes[1];
  const int count = kind == '1' || kind == '4' ? 2 : 3;
  for (int i = 0; i < count; ++i) {
    const auto is_space = [&] { return std::isspace(static_cast<unsigned char>(bytes[at])) != 0; };
    while (at < bytes.size() && (is_space() || bytes[at] == '#')) {
      if (bytes[at] == '#')
        while (at < bytes.size() && bytes[at] != '\n') ++at;
      else
        ++at;
    }
    values[i] = 0;
    while (at < bytes.size() && std::isdigit(static_cast<unsigned char>(bytes[at])) != 0 &&
           values[i] < INT32_MAX)
      values[i] = values[i] * 10 + (bytes[at++] - '0');
  }
  header.width = values[0];
  header.height = values[1];
  header.max_sample = count == 3 ? values[2] : 0;
  header.is_binary_pnm = kind == '5' || kind == '6';
  const int64_t sample = values[2] > 255 ? 2 : 1;
  const size_t have = bytes.size() - (at < bytes.size() ? at + 1 : at);
  if (header.width > INT32_MAX || header.height > INT32_MAX) return header;
  const double pixels = static_cast<double>(header.width) * static_cast<double>(header.height);
  if (kind == '4') header.truncated = static_cast<double>(have) * 8 < pixels;
  if (kind == '5') header.truncated = static_cast<double>(have) < pixels * sample;
  if (kind == '6') header.truncated = static_cast<double>(have) < pixels * 3 * sample;
  return header;
}

// A directory of a TIFF file: one picture.
struct TiffPage {
  int64_t width = 0, height = 0;
  bool is_picture = true;  // and not a preview of another page, or its mask
  size_t next = 0;         // where the next page's directory begins; 0: none
};

TiffPage read_tiff_page(Bytes bytes, size_t directory, bool big) {
  TiffPage page;
  const uint64_t count = number(bytes, directory, 2, big);
  for (uint64_t i = 0; i < count; ++i) {
    const size_t at = directory + 2 + static_cast<size_t>(i) * 12;
    const uint64_t tag = number(bytes, at, 2, big);
    const int width = number(bytes, at + 2, 2, big) == 3 ? 2 : 4;  // SHORT: 2 bytes, LONG: 4
    const auto value = static_cast<int64_t>(number(bytes, at + 8, width, big));
    if (tag == 254) page.is_picture = (value & 5) == 0;  // NewSubfileType: 1 reduced, 4 a mask
    if (tag == 256) page.width = value;
    if (tag == 257) page.height = value;
  }
  page.next =
      static_cast<size_t>(number(bytes, directory + 2 + static_cast<size_t>(count) * 12, 4, big));
  return page;
}

ImageHeader read_tiff(Bytes bytes) {
  constexpr int kMostPages = 65536;  // the chain of a damaged file may be a circle
  ImageHeader header;
  const bool big = bytes[0] == 'M';
  TiffPage page = read_tiff_page(bytes, static_cast<size_t>(number(bytes, 4, 4, big)), big);
  header.width = page.width;
  header.height = page.height;
  for (int i = 0; i < kMostPages && page.next != 0 && page.next < bytes.size(); ++i) {
    page = read_tiff_page(bytes, page.next, big);
    header.has_more = header.has_more || (page.is_picture && page.width > 0);
  }
  return header;
}

// Only whether it has more pictures than one: the flag 2 of an extended file's first chunk.
ImageHeader read_webp(Bytes bytes) {
  ImageHeader header;
  if (bytes.substr(12, 4) == "VP8X" && (number(bytes, 20, 1, false) & 2) != 0)
    header.has_more = true;
  return header;
}

}  // namespace

ImageHeader read_image_header(std::string_view bytes) {
  if (bytes.size() < 8) return {};
  if (starts_with(bytes, "\x89PNG\r\n\x1a\n")) return read_png(bytes);
  if (starts_with(bytes, "\xff\xd8\xff")) return read_jpeg(bytes);
  if (starts_with(bytes, "BM")) return read_bmp(bytes);
  if (bytes[0] == 'P' && bytes[1] >= '1' && bytes[1] <= '6') return read_pnm(bytes);
  if (starts_with(bytes, {"II*\0", 4}) || starts_with(bytes, {"MM\0*", 4})) return read_tiff(bytes);
  if (starts_with(bytes, "RIFF") && bytes.substr(8, 4) == "WEBP") return read_webp(bytes);
  return {};
}

}  // namespace cli
