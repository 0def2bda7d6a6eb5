#include "files/copies.h"

#include <algorithm>
#include <fstream>
#include <map>
#include <opencv2/imgcodecs.hpp>
#include <opencv2/imgproc.hpp>
#include <regex>
#include <set>

#include "base/silence.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

const std::string kWords =
    "(?:copy|copie|copia|cópia|kopie|kopia|kopio|kopi|копия|コピー|副本|복사본)";
const std::string kCount = "\\(?[0-9]{1,3}\\)?";

// From this correlation of the brightness of blocks of 8 x 8 pixels on, two pictures are the same
// picture: stored with other settings (measured: above 0.999 down to JPEG's quality 30), or edited,
// where a word in the name says that it is a copy.
constexpr double kSameStored = 0.995, kSameEdited = 0.8;
constexpr int kBlock = 8;

struct Pattern {
  CopyMark mark;
  std::regex name;
};

const std::vector<Pattern>& patterns() {
  const auto icase = std::regex::ECMAScript | std::regex::icase;
  static const std::vector<Pattern> all = {
      {CopyMark::kWord,
       std::regex("(.+?)(?:(?: - | — |[ _.-])\\(?|\\()(?:(?:another|[0-9]+(?:st|nd|rd|th)) )?" +
                      kWords + "(?: ?" + kCount + ")?\\)?",
                  icase)},
      {CopyMark::kWord, std::regex("(.+?) ?\\([^()]*" + kWords + "[^()]*\\)", icase)},
      {CopyMark::kWord,
       std::regex(kWords + "(?: " + kCount + ")? (?:of|von|de|di|av) (.+)", icase)},
      {CopyMark::kWord, std::regex("(.+)\\.sync-conflict-[0-9]{8}-[0-9]{6}(?:-[A-Z0-9]+)?")},
      {CopyMark::kNumber, std::regex("(.+?) ?\\([0-9]{1,3}\\)")},
      {CopyMark::kNumber, std::regex("(.+)~[0-9]{1,3}")},
      {CopyMark::kBareNumber, std::regex("(.+)[ _-][0-9]{1,3}")}};
  return all;
}

// Mean brightness of blocks of 8 x 8 pixels; empty where the picture cannot be read.
cv::Mat blocks_of(const fs::path& path) {
  const StderrSilence silence;
  cv::Mat grey;
  try {
    grey = cv::imread(path.string(),
                      cv::IMREAD_GRAYSCALE | cv::IMREAD_ANYDEPTH | cv::IMREAD_IGNORE_ORIENTATION);
  } catch (const cv::Exception&) {
  }
  if (grey.empty()) return {};
  cv::Mat blocks;
  const cv::Size size(std::max(1, grey.cols / kBlock), std::max(1, grey.rows / kBlock));
  cv::resize(grey, blocks, size, 0, 0, cv::INTER_AREA);
  blocks.convertTo(blocks, CV_32F);
  return blocks;
}

// The correlation, -1 to 1; -1 where the pictures cannot be compared.
double correlation(const fs::path& a, const fs::path& b) {
  const cv::Mat x = blocks_of(a), y = blocks_of(b);
  if (x.empty() || x.size() != y.size()) return -1;
  cv::Scalar mean_x, mean_y, sigma_x, sigma_y;
  cv::meanStdDev(x, mean_x, sigma_x);
  cv::meanStdDev(y, mean_y, sigma_y);
  const double sigmas = sigma_x[0] * sigma_y[0];
  if (sigmas == 0) return sigma_x[0] == sigma_y[0] ? 1 : -1;
  return cv::mean((x - mean_x[0]).mul(y - mean_y[0]))[0] / sigmas;
}

// A picture whose name has a mark of a copy, and whether it shows the same as the original.
struct Marked {
  std::string name, original;
  CopyMark mark = CopyMark::kNone;
  bool has_same_bytes = false, shows_the_same = false;
};

using Names = std::set<std::string>;

// Judges the picture `name`. Where the original is in `series` (another picture with a mark of the
// same kind shows something else, so that the marks are numbers of a series), the two are not
// decoded and compared.
Marked marked(const fs::path& folder, const std::string& name,
              const std::map<std::string, std::string>& by_stem, const Names& series) {
  Marked result;
  result.name = name;
  CopyName copy = copy_name(fs::path(name).stem().string());
  for (; copy.mark != CopyMark::kNone; copy = copy_name(copy.original)) {
    // Of several marks, as in "a - Copy (2)", the plainest one counts.
    if (result.mark == CopyMark::kNone || copy.mark < result.mark) result.mark = copy.mark;
    const auto at = by_stem.find(copy.original);
    if (at == by_stem.end()) continue;
    result.original = at->second;
    break;
  }
  if (result.original.empty()) return result;
  const fs::path a = folder / name, b = folder / result.original;
  result.has_same_bytes = have_same_bytes(a, b);
  result.shows_the_same = result.has_same_bytes;
  const bool is_one_of_many = series.count(result.original) != 0 && result.mark != CopyMark::kWord;
  if (result.has_same_bytes || result.mark == CopyMark::kBareNumber || is_one_of_many)
    return result;
  result.shows_the_same =
      correlation(a, b) > (result.mark == CopyMark::kWord ? kSameEdited : kSameStored);
  return result;
}

std::string kept_note(const std::vector<Marked>& kept) {
  if (kept.empty()) return "";
  const size_t more = kept.size() - 1;
  return kept[0].name + (more > 0 ? " (and " + std::to_string(more) + " more)" : "") +
         " has the name of a copy of " + kept[0].original +
         ", but shows something else: it is taken as a picture of its own; where the folder holds "
         "two films, move one of them away";
}

}  // namespace

CopyName copy_name(const std::string& stem) {
  for (const Pattern& pattern : patterns()) {
    std::smatch match;
    if (std::regex_match(stem, match, pattern.name)) return {pattern.mark, match[1].str()};
  }
  return {};
}

bool have_same_bytes(const fs::path& a, const fs::path& b) {
  std::error_code error;
  const uintmax_t size = fs::file_size(a, error);
  if (error || size != fs::file_size(b, error) || error) return false;
  std::ifstream x(a, std::ios::binary), y(b, std::ios::binary);
  std::vector<char> p(size_t{1} << 16), q(p.size());
  for (uintmax_t left = size; left > 0;) {
    const auto count = static_cast<std::streamsize>(std::min<uintmax_t>(left, p.size()));
    if (!x.read(p.data(), count) || !y.read(q.data(), count)) return false;
    if (!std::equal(p.begin(), p.begin() + count, q.begin())) return false;
    left -= static_cast<uintmax_t>(count);
  }
  return true;
}

Copies copies_of(const fs::path& folder, const std::vector<std::string>& names) {
  std::map<std::string, std::string> by_stem;
  for (const std::string& name : names) by_stem.emplace(fs::path(name).stem().string(), name);
  std::vector<Marked> all;
  Names series;  // originals of which a marked picture shows something else
  bool has_series = false;
  for (const std::string& name : names) {
    Marked picture = marked(folder, name, by_stem, series);
    if (picture.original.empty()) continue;
    if (!picture.shows_the_same && picture.mark != CopyMark::kWord) {
      series.insert(picture.original);
      has_series = has_series || picture.mark == CopyMark::kNumber;
    }
    all.push_back(std::move(picture));
  }
  Copies copies;
  std::vector<Marked> kept_words, kept_numbers;
  Names numbered;
  for (const Marked& picture : all) {
    const bool is_copy =
        picture.shows_the_same &&
        (picture.mark == CopyMark::kWord ||
         (picture.has_same_bytes ? series.count(picture.original) == 0 : !has_series));
    if (is_copy) {
      copies.names.push_back(picture.name);
    } else if (picture.mark == CopyMark::kWord) {
      kept_words.push_back(picture);
    } else if (picture.mark == CopyMark::kNumber) {
      kept_numbers.push_back(picture);
      numbered.insert(picture.original);
    }
  }
  // Where one original alone has copies with numbers, these are a series, and no note is needed.
  if (numbered.size() > 1)
    kept_words.insert(kept_words.end(), kept_numbers.begin(), kept_numbers.end());
  copies.note = kept_note(kept_words);
  return copies;
}

}  // namespace cli
