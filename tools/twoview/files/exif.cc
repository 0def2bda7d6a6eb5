#include "files/exif.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <memory>
#include <string>

namespace cli {
namespace {

constexpr double kSameRatio = 0.01;
constexpr double kShortest = 1, kLongest = 10000;  // what --focal-35mm accepts, millimetres

struct Unref {
  void operator()(ExifData* data) const { exif_data_unref(data); }
};
using Data = std::unique_ptr<ExifData, Unref>;

// The EXIF data of a PNG file, its chunk eXIf, with the head that libexif looks for; empty if there
// is none.
std::string exif_of_png(std::string_view bytes) {
  const auto length_at = [&](size_t at) {
    size_t value = 0;
    for (size_t i = 0; i < 4; ++i) value = value << 8 | static_cast<uint8_t>(bytes[at + i]);
    return value;
  };
  for (size_t at = 8; at + 12 <= bytes.size();) {
    const size_t length = length_at(at);
    if (length > bytes.size() - at - 12) break;
    if (bytes.substr(at + 4, 4) == "eXIf")
      return std::string("Exif\0\0", 6) + std::string(bytes.substr(at + 8, length));
    at += length + 12;
  }
  return {};
}

Data parsed(std::string_view bytes) {
  std::string of_png;
  if (bytes.substr(0, 8) == "\x89PNG\r\n\x1a\n") {
    of_png = exif_of_png(bytes);
    bytes = of_png;
  } else if (bytes.substr(0, 3) != "\xff\xd8\xff") {
    return nullptr;
  }
  // No EXIF data lie behind the first 64 KiB segments of a JPEG file's head.
  constexpr size_t most = 1 << 20;
  const auto size = static_cast<unsigned>(std::min(bytes.size(), most));
  if (size == 0) return nullptr;
  return Data(exif_data_new_from_data(reinterpret_cast<const unsigned char*>(bytes.data()), size));
}

// The first number of a tag; 0 where the tag is missing or of another type.
double number_of(ExifData* data, ExifTag tag, ExifIfd directory = EXIF_IFD_EXIF) {
  ExifEntry* const entry = exif_content_get_entry(data->ifd[directory], tag);
  if (!entry || !entry->data || entry->components < 1) return 0;
  const unsigned size = exif_format_get_size(entry->format);
  if (size == 0 || entry->size < size) return 0;
  const ExifByteOrder order = exif_data_get_byte_order(data);
  switch (entry->format) {
    case EXIF_FORMAT_SHORT: return exif_get_short(entry->data, order);
    case EXIF_FORMAT_LONG: return exif_get_long(entry->data, order);
    case EXIF_FORMAT_RATIONAL: {
      const ExifRational value = exif_get_rational(entry->data, order);
      return value.denominator ? static_cast<double>(value.numerator) / value.denominator : 0;
    }
    default: return 0;
  }
}

bool is_cropped(double full_width, double full_height, int width, int height) {
  if (!(full_width > 0 && full_height > 0)) return false;
  // A viewer may have turned the picture without turning these tags.
  const double full = std::max(full_width, full_height) / std::min(full_width, full_height);
  const double now = static_cast<double>(std::max(width, height)) / std::min(width, height);
  return std::abs(now / full - 1) > kSameRatio;
}

// The focal length as for 35 mm film from the focal length and the density of the sensor's pixels.
double from_sensor(ExifData* data, double full_width, double full_height) {
  const double focal = number_of(data, EXIF_TAG_FOCAL_LENGTH);
  const double x_density = number_of(data, EXIF_TAG_FOCAL_PLANE_X_RESOLUTION);
  const double y_density = number_of(data, EXIF_TAG_FOCAL_PLANE_Y_RESOLUTION);
  const double unit = number_of(data, EXIF_TAG_FOCAL_PLANE_RESOLUTION_UNIT);
  const double unit_mm = unit == 3 ? 10 : unit == 4 ? 1 : unit == 5 ? 0.001 : 25.4;  // 2: inches
  const double diagonal = unit_mm * std::hypot(full_width / x_density, full_height / y_density);
  if (!(focal > 0 && std::isfinite(diagonal) && diagonal > 0)) return 0;
  return focal * std::hypot(36.0, 24.0) / diagonal;
}

}  // namespace

std::string focal_option(const ExifFocal& exif) {
  if (!(exif.focal_35mm > 0)) return "--focal-35mm";
  char text[48];
  std::snprintf(text, sizeof text, "--focal-35mm %.4g (by EXIF)", exif.focal_35mm);
  return text;
}

int exif_turn_deg(std::string_view bytes) {
  const Data data = parsed(bytes);
  if (!data) return 0;
  switch (static_cast<int>(number_of(data.get(), EXIF_TAG_ORIENTATION, EXIF_IFD_0))) {
    case 3:
    case 4: return 180;
    case 5:
    case 6: return 90;
    case 7:
    case 8: return 270;
    default: return 0;
  }
}

ExifFocal exif_focal(std::string_view bytes, int width, int height) {
  constexpr const char* none = "has no focal length in EXIF data";
  const Data data = parsed(bytes);
  if (!data || width < 1 || height < 1) return {0, none};
  const double full_width = number_of(data.get(), EXIF_TAG_PIXEL_X_DIMENSION);
  const double full_height = number_of(data.get(), EXIF_TAG_PIXEL_Y_DIMENSION);
  const double of_lens = number_of(data.get(), EXIF_TAG_FOCAL_LENGTH);
  double focal = number_of(data.get(), EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (!(focal > 0 || of_lens > 0)) return {0, none};
  if (is_cropped(full_width, full_height, width, height))
    return {0,
            "was cropped or is of another shape than its EXIF data say, so that their focal "
            "length is not of it"};
  if (!(focal > 0)) focal = from_sensor(data.get(), full_width, full_height);
  if (!(focal > 0))
    return {0, "has the focal length of its lens in EXIF data, but not the size of its sensor"};
  if (!(focal >= kShortest && focal <= kLongest)) return {0, none};
  return {focal, ""};
}

}  // namespace cli
