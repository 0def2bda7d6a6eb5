#include "files/folder.h"

#include <algorithm>
#include <cctype>
#include <fstream>

#include "base/error.h"
#include "files/image_file.h"
#include "files/image_header.h"
#include "files/natural_order.h"

namespace cli {
namespace {

namespace fs = std::filesystem;
using Endings = std::vector<std::string>;
const Endings kImages = {".jpg", ".jpeg", ".jpe", ".png",  ".bmp",  ".pgm", ".ppm",
                         ".pnm", ".pbm",  ".tif", ".tiff", ".webp", ".jp2"};
const Endings kUnreadImages = {".heic", ".heif", ".avif", ".gif", ".dng", ".cr2", ".cr3", ".nef",
                               ".nrw",  ".arw",  ".raf",  ".orf", ".rw2", ".pef", ".srw"};
// The size stands in the first bytes, in JPEG behind EXIF data with a small picture.
constexpr size_t kHeaderBytes = size_t{1} << 18;

bool ends_as(const fs::path& path, const Endings& endings) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return std::find(endings.begin(), endings.end(), ending) != endings.end();
}

std::string size_text(cv::Size size) {
  return std::to_string(size.width) + "x" + std::to_string(size.height);
}

}  // namespace

std::string left_out_words(const std::vector<LeftOut>& left_out, const std::string& where) {
  std::vector<std::pair<LeftOut, size_t>> kinds;  // the first of each reason, and their number
  for (const LeftOut& file : left_out) {
    const auto same = std::find_if(kinds.begin(), kinds.end(), [&](const auto& kind) {
      return kind.first.reason == file.reason;
    });
    if (same == kinds.end())
      kinds.emplace_back(file, 1);
    else
      ++same->second;
  }
  std::string text;
  for (const auto& [first, count] : kinds) {
    text += (text.empty() ? "" : "; ") + first.name + " " + first.reason;
    if (count > 1) text += " (so are " + std::to_string(count - 1) + " more)";
  }
  if (text.empty()) return text;
  const size_t count = left_out.size();
  return std::to_string(count) + (count == 1 ? " picture of " : " pictures of ") + where +
         (count == 1 ? " is left out: " : " are left out: ") + text;
}

FolderPictures pictures_of(const fs::path& folder) {
  FolderPictures result;
  std::vector<std::string> names, unread;
  std::error_code error;
  for (fs::directory_iterator at(folder, error), end; !error && at != end; at.increment(error)) {
    std::error_code ignored;
    if (!fs::is_regular_file(at->path(), ignored)) continue;
    const std::string name = at->path().filename().string();
    if (ends_as(name, kImages)) names.push_back(name);
    if (ends_as(name, kUnreadImages)) unread.push_back(name);
  }
  if (error) throw BadInput("cannot read folder " + folder.string() + ": " + error.message());
  std::sort(names.begin(), names.end(), comes_before);
  std::sort(unread.begin(), unread.end(), comes_before);
  for (const std::string& name : names) {
    if (name[0] == '.')
      result.left_out.push_back({name, "is a hidden file (its name begins with a dot)"});
    else
      result.names.push_back(name);
  }
  for (const std::string& name : unread) {
    const std::string what = unread_picture_file((folder / name).string());
    if (!what.empty()) result.left_out.push_back({name, what});
  }
  return result;
}

cv::Size header_size(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string head(kHeaderBytes, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<size_t>(file.gcount()));
  const ImageHeader header = read_image_header(head);
  const auto is_side = [](int64_t side) { return side > 0 && side <= INT32_MAX; };
  if (!is_side(header.width) || !is_side(header.height)) return {};
  return {static_cast<int>(header.width), static_cast<int>(header.height)};
}

cv::Size most_frequent(const std::vector<cv::Size>& sizes) {
  cv::Size best;
  int64_t most = 0;
  for (size_t i = 0; i < sizes.size(); ++i) {
    if (sizes[i].area() == 0 || sizes[i] == best) continue;
    const int64_t count = std::count(sizes.begin(), sizes.end(), sizes[i]);
    if (count <= most) continue;
    most = count;
    best = sizes[i];
  }
  return best;
}

std::string other_size_words(cv::Size own, cv::Size usual) {
  return "is " + size_text(own) + ", not " + size_text(usual) + " as most are";
}

}  // namespace cli
