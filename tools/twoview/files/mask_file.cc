#include "files/mask_file.h"

#include <cstdio>
#include <filesystem>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "files/image_file.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

cv::Mat load_mask(const std::string& path) {
  cv::Mat pixels;
  try {
    pixels = load_pixels(path);
  } catch (const BadInput& e) {
    throw BadInput(std::string("--mask: ") + e.what());
  }
  std::vector<cv::Mat> channels;
  cv::split(pixels, channels);
  if (channels.size() == 4) {
    double least = 0;
    cv::minMaxLoc(channels[3], &least);
    if (least < (pixels.depth() == CV_8U ? 255 : 65535))
      throw BadInput("--mask: " + path +
                     " has transparent pixels: save it without, black where it leaves out");
    channels.pop_back();
  }
  cv::Mat used = channels[0] != 0;
  for (size_t k = 1; k < channels.size(); ++k) used |= channels[k] != 0;
  if (cv::countNonZero(used) == 0)
    throw BadInput("--mask: " + path + " is black all over, so it leaves nothing of a picture");
  return used;
}

}  // namespace

std::string Masks::file_of(const std::string& name) const {
  std::error_code error;
  if (!fs::is_directory(path, error)) return path;
  const fs::path folder(path), whole(name), file = whole.filename();
  fs::path stem = whole;
  stem.replace_extension();
  for (const fs::path& tried : {whole, stem, file, file.stem()}) {
    const fs::path candidate = folder / (tried.relative_path().string() + ".png");
    if (fs::is_regular_file(candidate, error)) return candidate.string();
  }
  throw BadInput("--mask: " + path + " has no mask of " + name + ": " + file.string() + ".png or " +
                 file.stem().string() + ".png");
}

cv::Mat Masks::of(const std::string& name, int width, int height) const {
  if (!given()) return {};
  cv::Mat mask = only_;
  const std::string file = file_of(name);
  if (mask.empty()) {
    mask = load_mask(file);
    files_.push_back(file);
    if (file == path) only_ = mask;
  }
  if (mask.cols != width || mask.rows != height)
    throw BadInput("--mask: " + file + " is " + std::to_string(mask.cols) + "x" +
                   std::to_string(mask.rows) + ", and picture " + name + " " +
                   std::to_string(width) + "x" + std::to_string(height));
  return mask;
}

double masked_share(const cv::Mat& mask) {
  if (mask.empty()) return 0;
  return 1 - static_cast<double>(cv::countNonZero(mask)) / static_cast<double>(mask.total());
}

std::string mask_note(const Masks& masks, double masked_share, const std::string& pictures) {
  constexpr double kMuch = 0.5;
  if (!masks.given()) return "";
  if (masked_share == 0)
    return "the mask of " + pictures + " leaves nothing out: it has no black pixel";
  if (masked_share < kMuch) return "";
  char text[32];
  std::snprintf(text, sizeof text, "%.3g", 100 * masked_share);
  return "the mask of " + pictures + " leaves " + text +
         " % of the picture out: black is what is left out, is it inverted?";
}

}  // namespace cli
