#include "files/xml_values.h"

#include <algorithm>
#include <cctype>
#include <sstream>
#include <utility>
#include <vector>

#include "base/error.h"

namespace cli {
namespace {

constexpr int kMaxDepth = 16;
constexpr const char* kBlank = " \t\r\n";

struct Element {
  std::string tag, text;  // `text` up to the first element within
  std::vector<Element> parts;
};

// A reader of elements, text, comments and the five entities; attributes are skipped.
class XmlReader {
 public:
  XmlReader(const std::string& text, const std::string& file) : text_(text), file_(file) {}

  Element document() {
    skip_misc();
    Element root = element(0);
    skip_misc();
    if (at_ != text_.size()) refuse("there is text behind its end");
    return root;
  }

 private:
  [[noreturn]] void refuse(const std::string& why) const {
    const auto line = 1 + std::count(text_.begin(), text_.begin() + static_cast<long>(at_), '\n');
    throw BadInput(file_ + ": no XML: line " + std::to_string(line) + ": " + why);
  }
  bool starts(const char* word) const {
    return text_.compare(at_, std::string(word).size(), word) == 0;
  }
  void skip_blank() { at_ = std::min(text_.find_first_not_of(kBlank, at_), text_.size()); }
  void skip_past(const char* end) {
    const size_t found = text_.find(end, at_);
    if (found == std::string::npos) refuse("it ends early");
    at_ = found + std::string(end).size();
  }
  // Blanks, comments and processing instructions.
  void skip_misc() {
    for (skip_blank(); starts("<!--") || starts("<?"); skip_blank())
      skip_past(starts("<?") ? "?>" : "-->");
  }

  std::string name() {
    const size_t start = at_;
    while (at_ < text_.size()) {
      const unsigned char c = static_cast<unsigned char>(text_[at_]);
      if (std::isalnum(c) == 0 && c != '_' && c != '-' && c != '.' && c != ':' && c < 0x80) break;
      ++at_;
    }
    if (at_ == start) refuse("an element has no name");
    return text_.substr(start, at_ - start);
  }

  // Skips the attributes of a tag. Returns whether the tag is closed at once (<a/>).
  bool attributes() {
    for (skip_blank(); !starts(">") && !starts("/>"); skip_blank()) {
      name();
      skip_blank();
      if (!starts("=")) refuse("an attribute has no value");
      ++at_;
      skip_blank();
      const char quote = at_ < text_.size() ? text_[at_] : ' ';
      if (quote != '"' && quote != '\'') refuse("an attribute has no value");
      ++at_;
      skip_past(quote == '"' ? "\"" : "'");
    }
    const bool is_closed = starts("/>");
    at_ += is_closed ? 2 : 1;
    return is_closed;
  }

  std::string entity() {
    const size_t end = text_.find(';', at_);
    const std::string word = end == std::string::npos ? "" : text_.substr(at_, end + 1 - at_);
    for (const auto& [known, value] :
         {std::pair{"&lt;", "<"}, {"&gt;", ">"}, {"&amp;", "&"}, {"&quot;", "\""}, {"&apos;", "'"}})
      if (word == known) {
        at_ = end + 1;
        return value;
      }
    refuse("an entity that is not known");
  }

  Element element(int depth) {
    if (depth > kMaxDepth) refuse("elements are nested too deeply");
    if (!starts("<")) refuse("no element");
    ++at_;
    Element result{name(), "", {}};
    if (attributes()) return result;
    for (;;) {
      if (at_ >= text_.size()) refuse(result.tag + " is not closed");
      if (starts("<!--")) {
        skip_past("-->");
      } else if (starts("<?")) {
        skip_past("?>");
      } else if (starts("</")) {
        at_ += 2;
        if (name() != result.tag) refuse(result.tag + " is not closed");
        skip_blank();
        if (!starts(">")) refuse(result.tag + " is not closed");
        ++at_;
        return result;
      } else if (starts("<")) {
        result.parts.push_back(element(depth + 1));
      } else {
        const std::string piece = starts("&") ? entity() : std::string(1, text_[at_++]);
        if (result.parts.empty()) result.text += piece;
      }
    }
  }

  const std::string& text_;
  const std::string& file_;
  size_t at_ = 0;
};

YAML::Node words_of(const std::string& text) {
  YAML::Node list(YAML::NodeType::Sequence);
  std::istringstream stream(text);
  for (std::string word; stream >> word;) list.push_back(word);
  return list;
}

std::string stripped(const std::string& text, const char* of) {
  const size_t first = text.find_first_not_of(of);
  if (first == std::string::npos) return "";
  return text.substr(first, text.find_last_not_of(of) + 1 - first);
}

// The element as a YAML map, list or scalar.
YAML::Node value_of(const Element& element, const std::string& file) {
  if (element.parts.empty()) {
    const std::string text = stripped(element.text, kBlank);
    const bool is_text = !text.empty() && text[0] == '"';
    const bool is_list = element.tag == "data" || element.tag == "sizes" ||
                         text.find_first_of(kBlank) != std::string::npos;
    if (is_list && !is_text) return words_of(text);
    const std::string word = stripped(text, "\"");
    return word.empty() ? YAML::Node() : YAML::Node(word);
  }
  YAML::Node result;
  if (std::all_of(element.parts.begin(), element.parts.end(),
                  [](const Element& part) { return part.tag == "_"; })) {
    for (const Element& part : element.parts) result.push_back(value_of(part, file));
    return result;
  }
  for (const Element& part : element.parts) {
    if (result[part.tag]) throw BadInput(file + ": " + part.tag + " is given twice");
    result[part.tag] = value_of(part, file);
  }
  return result;
}

}  // namespace

bool is_xml(const std::string& text) {
  const size_t first = text.find_first_not_of(kBlank);
  return first != std::string::npos && text[first] == '<';
}

YAML::Node parse_xml(const std::string& text, const std::string& file) {
  for (size_t at = 0; (at = text.find("<!", at)) != std::string::npos; ++at)
    if (text.compare(at, 4, "<!--") != 0)
      throw BadInput(file + ": declarations of XML are not supported");
  const Element root = XmlReader(text, file).document();
  if (root.tag != "opencv_storage")
    throw BadInput(file + ": XML of " + root.tag.substr(0, 40) +
                   ", not OpenCV's opencv_storage (Metashape saves this as OpenCV Calibration)");
  const YAML::Node values = value_of(root, file);
  return values.IsMap() ? values : YAML::Node(YAML::NodeType::Map);
}

}  // namespace cli
