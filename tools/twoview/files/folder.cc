#include "files/folder.h"

#include <algorithm>
#include <cctype>
#include <fstream>
#include <map>

#include "base/error.h"
#include "files/copies.h"
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

// A step between two names' numbers is a jump where it is above this many times the median one.
constexpr double kJump = 1.5;

std::string ending_of(const fs::path& path) {
  std::string ending = path.extension().string();
  for (char& c : ending) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  return ending;
}

bool ends_as(const fs::path& path, const Endings& endings) {
  return std::find(endings.begin(), endings.end(), ending_of(path)) != endings.end();
}

// Of pictures whose names differ only in their ending, keeps one: that with the ending which most
// pictures of the folder have; on a tie, the ending that comes first in kImages.
void leave_out_second_endings(FolderPictures& pictures) {
  std::map<std::string, size_t> counts;
  for (const std::string& name : pictures.names) ++counts[ending_of(name)];
  const auto is_better = [&](const std::string& a, const std::string& b) {
    const std::string x = ending_of(a), y = ending_of(b);
    if (counts[x] != counts[y]) return counts[x] > counts[y];
    return std::find(kImages.begin(), kImages.end(), x) <
           std::find(kImages.begin(), kImages.end(), y);
  };
  std::map<std::string, std::string> best;  // of each name without its ending
  for (const std::string& name : pictures.names) {
    const auto [at, is_new] = best.emplace(fs::path(name).stem().string(), name);
    if (!is_new && is_better(name, at->second)) at->second = name;
  }
  std::vector<std::string> kept;
  for (std::string& name : pictures.names) {
    if (best[fs::path(name).stem().string()] == name)
      kept.push_back(std::move(name));
    else
      pictures.left_out.push_back({name, "has the name of another picture, but for the ending"});
  }
  pictures.names = std::move(kept);
}

void leave_out_copies(const fs::path& folder, FolderPictures& pictures) {
  const Copies copies = copies_of(folder, pictures.names);
  pictures.note = copies.note;
  std::vector<std::string> kept;
  for (std::string& name : pictures.names) {
    if (std::find(copies.names.begin(), copies.names.end(), name) == copies.names.end())
      kept.push_back(std::move(name));
    else
      pictures.left_out.push_back({name, "is a copy of another picture, by its name and its look"});
  }
  pictures.names = std::move(kept);
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
    const bool leads_nowhere = at->is_symlink(ignored) && !fs::exists(at->path(), ignored);
    if (!leads_nowhere && !fs::is_regular_file(at->path(), ignored)) continue;
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
  leave_out_second_endings(result);
  leave_out_copies(folder, result);
  sort_sequence(result.names);
  for (const std::string& name : unread) {
    const std::string what = unread_picture_file((folder / name).string());
    if (!what.empty()) result.left_out.push_back({name, what});
  }
  return result;
}

bool has_picture_ending(const fs::path& path) { return ends_as(path, kImages); }

namespace {

// Whether this is the last number of a camera's counter: 999, 9999 ...
bool is_all_nines(int64_t number) {
  int64_t last = 999;
  while (last < number) last = 10 * last + 9;
  return last == number;
}

// Where the steps between these numbers are above the usual one.
std::vector<size_t> jumps_of(const std::vector<int64_t>& counters) {
  std::vector<int64_t> steps;
  for (size_t k = 1; k < counters.size(); ++k) steps.push_back(counters[k] - counters[k - 1]);
  std::vector<size_t> jumps;
  if (steps.empty()) return jumps;
  std::vector<int64_t> sorted = steps;
  std::nth_element(sorted.begin(), sorted.begin() + sorted.size() / 2, sorted.end());
  const auto usual = static_cast<double>(sorted[sorted.size() / 2]);
  for (size_t k = 0; k < steps.size() && usual >= 1; ++k)
    if (static_cast<double>(steps[k]) > kJump * usual) jumps.push_back(k + 1);
  return jumps;
}

}  // namespace

size_t begun_anew_at(const std::vector<std::string>& names) {
  const std::vector<int64_t> counters = counters_of(names);
  const std::vector<size_t> jumps = jumps_of(counters);
  return jumps.size() == 1 && counters.front() <= 1 && is_all_nines(counters.back()) ? jumps[0] : 0;
}

std::string jump_words(const std::vector<std::string>& names) {
  const std::vector<size_t> jumps = jumps_of(counters_of(names));
  if (jumps.empty()) return "";
  const size_t k = jumps[0], count = jumps.size();
  if (begun_anew_at(names) > 0)
    return "the pictures' counter seems to have begun anew after " + names.back() + ": " +
           names[k] + " and what follows it then come before " + names.front() +
           ", but were taken after " + names[k - 1] + ": rename them";
  return "the numbers of the pictures' names jump from " + names[k - 1] + " to " + names[k] +
         (count > 1 ? " (and in " + std::to_string(count - 1) +
                          (count > 2 ? " more places)" : " more place)")
                    : "") +
         ": they are taken as evenly spaced in time; where some are missing, list the times in "
         "frames.txt";
}

std::string picture_head(const std::string& path) {
  std::ifstream file(path, std::ios::binary);
  std::string head(kHeaderBytes, '\0');
  file.read(head.data(), static_cast<std::streamsize>(head.size()));
  head.resize(static_cast<size_t>(file.gcount()));
  return head;
}

cv::Size header_size(const std::string& path) {
  const ImageHeader header = read_image_header(picture_head(path));
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
