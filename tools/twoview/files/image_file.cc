#include "files/image_file.h"

#include <algorithm>
#include <cctype>
#include <cmath>
#include <filesystem>
#include <fstream>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>

#include "base/error.h"
#include "base/output.h"
#include "base/silence.h"
#include "files/exif.h"
#include "files/image_header.h"

namespace cli {
namespace {

constexpr size_t kMaxFileBytes = size_t{1} << 30;
constexpr const char* kRawWords =
    "is a camera's raw picture, which is not read: develop it to TIFF, PNG or JPEG";

std::string size_text(int64_t width, int64_t height) {
  return std::to_string(width) + "x" + std::to_string(height);
}

bool is_iso_media(std::string_view bytes) {
  return bytes.substr(std::min<size_t>(4, bytes.size()), 4) == "ftyp";
}

// What to do about a film in the place of a picture; empty for what is no film.
std::string film_instead(std::string_view bytes) {
  const bool is_avi =
      bytes.substr(0, 4) == "RIFF" && bytes.substr(std::min<size_t>(8, bytes.size()), 4) == "AVI ";
  if (is_iso_media(bytes) || is_avi || bytes.substr(0, 4) == "\x1a\x45\xdf\xa3")
    return "is a film: take two of its frames (ffmpeg -i FILM -vf fps=2 frame%03d.png), or give it "
           "to twoview odometry";
  return "";
}

// Converts samples so that `low` becomes 0 and `high` 255, rounded; beyond them they are cut off.
template <class Sample>
cv::Mat to_8_bits(const cv::Mat& pixels, int64_t low, int64_t high) {
  cv::Mat result(pixels.size(), CV_MAKETYPE(CV_8U, pixels.channels()));
  const int count = pixels.cols * pixels.channels();
  const int64_t range = high - low;
  for (int y = 0; y < pixels.rows; ++y) {
    const Sample* from = pixels.ptr<Sample>(y);
    uint8_t* to = result.ptr<uint8_t>(y);
    for (int i = 0; i < count; ++i) {
      const int64_t above = std::clamp<int64_t>(from[i] - low, 0, range);
      to[i] = static_cast<uint8_t>((510 * above + range) / (2 * range));
    }
  }
  return result;
}

// The samples of which 0.5 and 99.5 % of all are at most as large (nearest rank).
std::pair<int64_t, int64_t> percentiles(const cv::Mat& pixels) {
  std::vector<int64_t> counts(65536, 0);
  const int row = pixels.cols * pixels.channels();
  for (int y = 0; y < pixels.rows; ++y) {
    const uint16_t* samples = pixels.ptr<uint16_t>(y);
    for (int i = 0; i < row; ++i) ++counts[samples[i]];
  }
  const int64_t all = int64_t{pixels.rows} * row;
  const auto at = [&](int64_t per_mille) {
    const int64_t rank = std::max<int64_t>(1, (per_mille * all + 999) / 1000);
    int64_t sum = 0, value = 0;
    while ((sum += counts[static_cast<size_t>(value)]) < rank) ++value;
    return value;
  };
  return {at(5), at(995)};
}

// 8 bits of 16: over the whole range that the file can hold, or, where the picture uses less than
// half of it (a thermal camera, 12 bits in 16), from the 0.5 to the 99.5 percentile.
cv::Mat reduced(const cv::Mat& pixels, int64_t white, bool& is_stretched) {
  const auto [low, high] = percentiles(pixels);
  is_stretched = high > low && 2 * (high - low) < white;
  return is_stretched ? to_8_bits<uint16_t>(pixels, low, high)
                      : to_8_bits<uint16_t>(pixels, 0, white);
}

bool is_raw_name(const std::string& path) {
  std::string ending = std::filesystem::path(path).extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  for (const char* raw :
       {".dng", ".cr2", ".cr3", ".nef", ".nrw", ".arw", ".raf", ".orf", ".rw2", ".pef", ".srw"})
    if (ending == raw) return true;
  return false;
}

// Decodes all pixels of a file's bytes with the file's depth and channels. Throws BadInput.
cv::Mat decode(const std::string& path, const std::string& bytes) {
  // Many raw files are TIFF files, and OpenCV would decode their small preview.
  if (is_raw_name(path)) throw BadInput("image " + path + " " + kRawWords);
  const ImageHeader header = read_image_header(bytes);
  const auto refuse_huge = [&](int64_t width, int64_t height) {
    if (width > kMaxSide || height > kMaxSide)
      throw BadInput("image " + path + " is too large: " + size_text(width, height) + ", at most " +
                     std::to_string(kMaxSide) + " a side");
  };
  refuse_huge(header.width, header.height);
  if (!header.panorama.empty() && header.panorama != "rectilinear")
    throw BadInput("image " + path + " is a panorama (" + std::string(header.panorama) +
                   ", by its XMP), and no camera here describes it: cut flat views out of it");
  cv::Mat pixels;
  try {
    const StderrSilence silence;  // libpng, libjpeg, libtiff and OpenCV print messages
    const cv::Mat encoded(1, static_cast<int>(bytes.size()), CV_8U,
                          // The cast is safe, since imdecode does not write.
                          const_cast<char*>(bytes.data()));
    pixels = cv::imdecode(encoded, cv::IMREAD_UNCHANGED);
  } catch (const cv::Exception&) {
    pixels.release();
  }
  if (header.truncated) throw BadInput("image " + path + " is truncated");
  if (pixels.empty()) {
    std::string foreign = unread_picture(bytes);
    if (foreign.empty()) foreign = film_instead(bytes);
    if (!foreign.empty()) throw BadInput("image " + path + " " + foreign);
    throw BadInput("image " + path +
                   (header.width > 0 ? " is damaged" : " is no image that can be read"));
  }
  refuse_huge(pixels.cols, pixels.rows);
  // OpenCV (4.6 to 5.0) makes the largest sample of a PNM file's header 255 where its samples are
  // text (P2, P3), and leaves binary ones (P5, P6) as they are: those are scaled here.
  if (header.is_binary_pnm && header.max_sample > 0 && header.max_sample < 255)
    pixels = to_8_bits<uint8_t>(pixels, 0, header.max_sample);
  return pixels;
}

}  // namespace

std::string unread_picture(std::string_view bytes) {
  if (bytes.substr(0, 6) == "GIF87a" || bytes.substr(0, 6) == "GIF89a")
    return "is a GIF picture, which is not read: convert it to PNG";
  if (!is_iso_media(bytes)) return "";
  const std::string_view brand = bytes.substr(std::min<size_t>(8, bytes.size()), 4);
  if (brand == "avif" || brand == "avis")
    return "is an AVIF picture, which is not read: convert it to PNG or JPEG";
  for (const char* heic : {"heic", "heix", "heim", "heis", "hevc", "hevx", "mif1", "msf1"})
    if (brand == heic)
      return "is a HEIC picture, which is not read: convert it to JPEG, or let the phone save JPEG";
  return "";
}

std::string unread_picture_file(const std::string& path) {
  if (is_raw_name(path)) return kRawWords;
  char head[16] = "";
  std::ifstream file(path, std::ios::binary);
  file.read(head, sizeof head);
  return unread_picture({head, static_cast<size_t>(file.gcount())});
}

std::string stored_words(int turn_deg) {
  return std::string("the pictures are used as they are stored, ") +
         (turn_deg == 180 ? "upside down" : "lying on their side");
}

tv_image Picture::view() const {
  return {luma.data, luma.cols, luma.rows, static_cast<int64_t>(luma.step)};
}

tv_image Picture::mask_view() const {
  return {mask.data, mask.cols, mask.rows, static_cast<int64_t>(mask.step)};
}

namespace {

cv::Mat checked_pixels(const std::string& path, const std::string& bytes) {
  const cv::Mat pixels = decode(path, bytes);
  if (pixels.depth() != CV_8U && pixels.depth() != CV_16U)
    throw BadInput("image " + path + " has samples that are not 8 or 16 bits");
  const int channels = pixels.channels();
  if (channels != 1 && channels != 3 && channels != 4)
    throw BadInput("image " + path + " has " + std::to_string(channels) + " channels");
  return pixels;
}

}  // namespace

cv::Mat load_pixels(const std::string& path, bool* has_more) {
  const std::string bytes = read_file(path, kMaxFileBytes);
  if (has_more && read_image_header(bytes).has_more) *has_more = true;
  return checked_pixels(path, bytes);
}

Picture load_picture(const std::string& path) {
  const std::string bytes = read_file(path, kMaxFileBytes);
  cv::Mat pixels = checked_pixels(path, bytes);
  Picture picture;
  if (pixels.channels() == 4) {
    cv::Mat opaque;
    cv::cvtColor(pixels, opaque, cv::COLOR_BGRA2BGR);
    pixels = opaque;
  }
  const ImageHeader header = read_image_header(bytes);
  picture.has_more = header.has_more;
  picture.is_16bit = pixels.depth() == CV_16U;
  if (picture.is_16bit) {
    const int64_t said = header.max_sample;
    pixels = reduced(pixels, said > 255 && said < 65535 ? said : 65535, picture.is_stretched);
  }
  picture.path = path;
  picture.name = std::filesystem::path(path).filename().string();
  if (pixels.channels() == 1) {
    picture.luma = pixels;
    cv::cvtColor(pixels, picture.colour, cv::COLOR_GRAY2BGR);
  } else {
    picture.colour = pixels;
    cv::cvtColor(pixels, picture.luma, cv::COLOR_BGR2GRAY);
  }
  picture.file_width = pixels.cols;
  picture.file_height = pixels.rows;
  picture.exif = exif_focal(bytes, pixels.cols, pixels.rows);
  picture.turn_deg = exif_turn_deg(bytes);
  return picture;
}

cv::Size shrunk_size(cv::Size size, int longer) {
  const int longest = std::max(size.width, size.height);
  if (longer <= 0 || longest <= longer) return size;
  const double scale = static_cast<double>(longer) / longest;
  return {std::max(1, static_cast<int>(std::lround(size.width * scale))),
          std::max(1, static_cast<int>(std::lround(size.height * scale)))};
}

cv::Mat shrunk_mask(const cv::Mat& mask, int longer) {
  const cv::Size size = shrunk_size(mask.size(), longer);
  if (mask.empty() || size == mask.size()) return mask;
  cv::Mat smaller;
  cv::resize(mask, smaller, size, 0, 0, cv::INTER_AREA);
  return smaller == 255;
}

void shrink(Picture& picture, int longer) {
  const cv::Size size = shrunk_size(picture.luma.size(), longer);
  if (size == picture.luma.size()) return;
  cv::Mat luma, colour;
  cv::resize(picture.luma, luma, size, 0, 0, cv::INTER_AREA);
  cv::resize(picture.colour, colour, size, 0, 0, cv::INTER_AREA);
  picture.luma = luma;
  picture.colour = colour;
  picture.mask = shrunk_mask(picture.mask, longer);
}

void turn(Picture& picture, int quarters) {
  constexpr cv::RotateFlags turns[] = {cv::ROTATE_90_COUNTERCLOCKWISE, cv::ROTATE_180,
                                       cv::ROTATE_90_CLOCKWISE};
  quarters &= 3;
  if (quarters == 0) return;
  cv::Mat luma, colour;
  cv::rotate(picture.luma, luma, turns[quarters - 1]);
  cv::rotate(picture.colour, colour, turns[quarters - 1]);
  if (!picture.mask.empty()) {
    cv::Mat mask;  // another one, since the masks of several pictures may share their pixels
    cv::rotate(picture.mask, mask, turns[quarters - 1]);
    picture.mask = mask;
  }
  picture.luma = luma;
  picture.colour = colour;
  if (quarters & 1) std::swap(picture.file_width, picture.file_height);
}

cv::Mat load_depth(const std::string& path) {
  const cv::Mat depth = decode(path, read_file(path, kMaxFileBytes));
  if (depth.type() != CV_32F)
    throw BadInput("depth map " + path + " is not one 32-bit float a pixel");
  return depth;
}

namespace {

std::string encoded(const cv::Mat& picture, const char* kind, const std::vector<int>& parameters) {
  std::vector<uchar> bytes;
  if (!cv::imencode(kind, picture, bytes, parameters))
    throw BadInput("cannot encode a picture as " + std::string(kind + 1));
  return {bytes.begin(), bytes.end()};
}

}  // namespace

std::string png_bytes(const cv::Mat& picture) {
  return encoded(picture, ".png", {cv::IMWRITE_PNG_COMPRESSION, 4});
}

std::string jpeg_bytes(const cv::Mat& picture, int quality) {
  return encoded(picture, ".jpg", {cv::IMWRITE_JPEG_QUALITY, quality});
}

}  // namespace cli
