#include "files/exif.h"

#include <libexif/exif-data.h>

#include <algorithm>
#include <cmath>
#include <cstdint>
#include <cstdio>
#include <cstring>
#include <memory>
#include <string>

namespace cli {
namespace {

constexpr double kSameRatio = 0.01;
// The focal lengths of lenses that show straight lines straight, and of telescopes, millimetres as
// for 35 mm film. What is beyond them is no focal length, such as 65535 or that of the lens itself.
constexpr double kShortest = 8, kLongest = 10000;
// The relative standard deviation of a focal length without contradiction, and the largest one.
constexpr double kSigma = 0.1, kMostSigma = 0.5;

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

// Bytes in the file's order as an IEEE number.
template <class Number, class Bits>
double ieee_of(const unsigned char* bytes, ExifByteOrder order) {
  Bits bits = 0;
  for (size_t i = 0; i < sizeof bits; ++i)
    bits = bits << 8 | bytes[order == EXIF_BYTE_ORDER_MOTOROLA ? i : sizeof bits - 1 - i];
  Number number = 0;
  std::memcpy(&number, &bits, sizeof number);
  return static_cast<double>(number);
}

// The first number of a tag; 0 where the tag is missing or a text. Programs write other types than
// the standard's, as Pillow does (13.0: a float becomes a DOUBLE).
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
    case EXIF_FORMAT_SRATIONAL: {
      const ExifSRational value = exif_get_srational(entry->data, order);
      return value.denominator ? static_cast<double>(value.numerator) / value.denominator : 0;
    }
    case EXIF_FORMAT_SSHORT: return exif_get_sshort(entry->data, order);
    case EXIF_FORMAT_SLONG: return exif_get_slong(entry->data, order);
    case EXIF_FORMAT_FLOAT: return ieee_of<float, uint32_t>(entry->data, order);
    case EXIF_FORMAT_DOUBLE: return ieee_of<double, uint64_t>(entry->data, order);
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

bool is_plausible(double focal) { return focal >= kShortest && focal <= kLongest; }

bool differ(double a, double b) { return std::abs(std::log(a / b)) > kSigma; }

// What the readings may mean. of_film and of_sensor: focal lengths as for 35 mm film, 0 where there
// is none. zoom: DigitalZoomRatio, the inverse of the part of the sensor that the picture shows.
// Some cameras multiply their focal length for 35 mm film by it, others do not.
ExifFocal combined(double of_film, double of_sensor, double zoom) {
  const bool has_both = of_film > 0 && of_sensor > 0;
  const double stated = of_film > 0 ? of_film : of_sensor;
  ExifFocal found{stated, kSigma};
  if (has_both && !differ(of_film, of_sensor * zoom)) return found;  // the film's contains it
  const bool contradict = has_both && differ(of_film, of_sensor);
  if (!contradict && !differ(zoom, 1)) return found;
  double shortest = contradict ? std::min(of_film, of_sensor) : stated;
  double longest = contradict ? std::max(of_film, of_sensor) : stated;
  (zoom > 1 ? longest : shortest) *= zoom;
  char text[160];
  if (contradict)
    std::snprintf(
        text, sizeof text,
        "has two focal lengths in EXIF data that contradict each other, %.4g mm for 35 mm "
        "film and %.4g mm by the size of its sensor",
        of_film, of_sensor);
  else
    std::snprintf(
        text, sizeof text,
        "was taken with a digital zoom of %.3g, which the %.4g mm in its EXIF data may or "
        "may not contain",
        zoom, stated);
  found.focal_35mm = std::sqrt(shortest * longest);
  found.sigma = std::hypot(kSigma, 0.5 * std::log(longest / shortest));
  if (found.sigma > kMostSigma) return {0, 0, text};
  found.doubt = text;
  return found;
}

// The text of a tag up to its terminating zero; empty where the tag holds no text.
std::string text_of(ExifData* data, ExifTag tag) {
  ExifEntry* const entry = exif_content_get_entry(data->ifd[EXIF_IFD_EXIF], tag);
  if (!entry || !entry->data || entry->format != EXIF_FORMAT_ASCII) return "";
  const std::string text(reinterpret_cast<const char*>(entry->data), entry->size);
  return text.substr(0, text.find('\0'));
}

}  // namespace

double exif_time_s(std::string_view bytes) {
  const Data data = parsed(bytes);
  if (!data) return 0;
  int year = 0, month = 0, day = 0, hour = 0, minute = 0, second = 0;
  const std::string text = text_of(data.get(), EXIF_TAG_DATE_TIME_ORIGINAL);
  if (std::sscanf(text.c_str(), "%4d:%2d:%2d %2d:%2d:%2d", &year, &month, &day, &hour, &minute,
                  &second) != 6 ||
      year < 1900 || month < 1 || month > 12 || day < 1 || day > 31)
    return 0;
  // Days of months that all have 31: only the order and differences within a day count.
  const double days = day + 31.0 * (month + 12.0 * year);
  double fraction = 0, unit = 0.1;
  for (const char c : text_of(data.get(), EXIF_TAG_SUB_SEC_TIME_ORIGINAL)) {
    if (c < '0' || c > '9') break;
    fraction += unit * (c - '0');
    unit /= 10;
  }
  return ((days * 24 + hour) * 60 + minute) * 60 + second + fraction;
}

std::string focal_option(const ExifFocal& exif) {
  if (!(exif.focal_35mm > 0) || !exif.doubt.empty()) return "--focal-35mm";
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
  if (!data || width < 1 || height < 1) return {0, 0, none};
  const double full_width = number_of(data.get(), EXIF_TAG_PIXEL_X_DIMENSION);
  const double full_height = number_of(data.get(), EXIF_TAG_PIXEL_Y_DIMENSION);
  const double of_lens = number_of(data.get(), EXIF_TAG_FOCAL_LENGTH);
  double of_film = number_of(data.get(), EXIF_TAG_FOCAL_LENGTH_IN_35MM_FILM);
  if (!(of_film > 0 || of_lens > 0)) return {0, 0, none};
  if (is_cropped(full_width, full_height, width, height))
    return {0, 0,
            "was cropped or is of another shape than its EXIF data say, so that their focal "
            "length is not of it"};
  double of_sensor = from_sensor(data.get(), full_width, full_height);
  if (!(of_film > 0 || of_sensor > 0))
    return {0, 0, "has the focal length of its lens in EXIF data, but not the size of its sensor"};
  if (!is_plausible(of_film)) of_film = 0;
  if (!is_plausible(of_sensor)) of_sensor = 0;
  if (!(of_film > 0 || of_sensor > 0))
    return {0, 0, "has a focal length in EXIF data that is none of 8 to 10000 mm for 35 mm film"};
  const double zoom = number_of(data.get(), EXIF_TAG_DIGITAL_ZOOM_RATIO);
  ExifFocal found = combined(of_film, of_sensor, zoom > 0 ? zoom : 1);  // 0: there was none
  if (full_width > 0 && full_height > 0 &&
      std::max(full_width, full_height) != std::max(width, height))
    found.assumed = "is taken as made smaller or larger, not as cropped: EXIF says " +
                    std::to_string(static_cast<int>(full_width)) + "x" +
                    std::to_string(static_cast<int>(full_height));
  return found;
}

}  // namespace cli
