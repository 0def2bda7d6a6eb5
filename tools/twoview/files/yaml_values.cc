#include "files/yaml_values.h"

#include <yaml-cpp/eventhandler.h>

#include <algorithm>
#include <cctype>
#include <charconv>
#include <cmath>
#include <set>
#include <sstream>

#include "base/error.h"

namespace cli {
namespace {

double finite(const YAML::Node& node, const std::string& entry, const std::string& file) {
  double value = 0;
  if (!node.IsScalar() || !parse_number(node.Scalar(), value))
    throw BadInput(file + ": " + entry + " is not a number");
  if (!std::isfinite(value)) throw BadInput(file + ": " + entry + " is not finite");
  return value;
}

// Refuses three things that YAML::Load accepts: a name that occurs twice in a map (it would take
// the first), aliases, with which a small file can expand to an unlimited number of values, and a
// line that is all name, such as `dist_coeffs:[0.1, 0.2]` without a blank behind the colon.
class StrictReader : public YAML::EventHandler {
 public:
  void OnDocumentStart(const YAML::Mark&) override {}
  void OnDocumentEnd() override {}
  void OnNull(const YAML::Mark& mark, YAML::anchor_t) override {
    // Where a name has no colon, yaml-cpp reports a null value at the same place as the name.
    const bool is_value =
        !levels_.empty() && levels_.back().is_block && !levels_.back().name_is_next;
    if (is_value && mark.pos == levels_.back().name_mark.pos)
      refuse(mark, "no name and value (name: value)");
    value(mark, "~");
  }
  void OnAlias(const YAML::Mark& mark, YAML::anchor_t) override {
    refuse(mark, "aliases are not supported");
  }
  void OnScalar(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                const std::string& text) override {
    value(mark, text);
  }
  void OnSequenceStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                       YAML::EmitterStyle::value) override {
    value(mark, "");
    levels_.push_back({});
  }
  void OnSequenceEnd() override { levels_.pop_back(); }
  void OnMapStart(const YAML::Mark& mark, const std::string&, YAML::anchor_t,
                  YAML::EmitterStyle::value style) override {
    value(mark, "");
    levels_.push_back({true, true, style != YAML::EmitterStyle::Flow, {}, {}});
  }
  void OnMapEnd() override { levels_.pop_back(); }

 private:
  struct Level {
    bool is_map = false, name_is_next = false, is_block = false;
    YAML::Mark name_mark;
    std::set<std::string> names;
  };

  // Called for each scalar and at the start of each list and map. In a map names and values
  // alternate; a name that is given twice is refused.
  void value(const YAML::Mark& mark, const std::string& text) {
    if (levels_.empty() || !levels_.back().is_map) return;
    Level& level = levels_.back();
    if (level.name_is_next && !level.names.insert(text).second)
      refuse(mark, text + " is given twice");
    if (level.name_is_next) level.name_mark = mark;
    level.name_is_next = !level.name_is_next;
  }
  [[noreturn]] static void refuse(const YAML::Mark& mark, const std::string& why) {
    throw YAML::ParserException(mark, why);
  }

  std::vector<Level> levels_;
};

YAML::Node find(const YAML::Node& map, const std::string& entry, const std::string& file) {
  const YAML::Node node = map[entry];
  if (!node || node.IsNull()) throw BadInput(file + ": " + entry + " is missing");
  return node;
}

void append(const YAML::Node& list, const std::string& entry, const std::string& file,
            std::vector<double>& values) {
  size_t index = 0;
  for (const YAML::Node& item : list) {
    const std::string name = entry + "[" + std::to_string(index++) + "]";
    if (item.IsSequence())
      append(item, name, file, values);
    else
      values.push_back(finite(item, name, file));
  }
}

}  // namespace

// The syntax is strict except for a leading plus and a trailing point ("0."),
// which OpenCV writes. The words of YAML and OpenCV for NaN and infinity are accepted as such.
bool parse_number(std::string text, double& value) {
  for (char& c : text) c = static_cast<char>(std::tolower(static_cast<unsigned char>(c)));
  if (!text.empty() && text[0] == '+') {
    text.erase(0, 1);
    if (!text.empty() && text[0] == '-') return false;
  }
  const std::string bare = !text.empty() && text[0] == '-' ? text.substr(1) : text;
  if (bare == ".nan" || bare == "nan") return value = NAN, true;
  if (bare == ".inf" || bare == "inf") return value = INFINITY, true;
  const char* const end = text.data() + text.size();
  const auto result = std::from_chars(text.data(), end, value);
  return result.ec == std::errc() && result.ptr == end;
}

namespace {

// Refuses documents behind the first one that say something else than it does. Messages of ROS as
// they are printed, one document each, differ in their headers.
void refuse_documents(const std::vector<YAML::Node>& documents, const std::string& file) {
  const auto text_of = [](const YAML::Node& document) {
    YAML::Node rest = YAML::Clone(document);
    if (rest.IsMap()) rest.remove("header");
    return YAML::Dump(rest);
  };
  for (size_t k = 1; k < documents.size(); ++k)
    if (!documents[k].IsNull() && text_of(documents[k]) != text_of(documents[0]))
      throw BadInput(file + ": " + std::to_string(documents.size()) +
                     " documents (---) that say different things: keep one");
}

}  // namespace

YAML::Node parse_yaml(const std::string& text, const std::string& file) {
  std::string body = text;
  if (body.compare(0, 3, "\xef\xbb\xbf") == 0) body.erase(0, 3);
  // OpenCV's "%YAML:1.0" becomes a comment of the same length, so that line numbers in messages
  // stay correct.
  if (body.compare(0, 5, "%YAML") == 0) body[0] = '#';
  // JSON may be indented by tabs, YAML may not.
  const size_t first = body.find_first_not_of(" \t\r\n");
  if (first != std::string::npos && body[first] == '{')
    std::replace(body.begin(), body.end(), '\t', ' ');
  YAML::Node root;
  try {
    std::istringstream stream(body);
    StrictReader reader;
    YAML::Parser parser(stream);
    // Each document takes at least one line; in a damaged text yaml-cpp may find documents without
    // end.
    auto lines = std::count(body.begin(), body.end(), '\n') + 1;
    while (parser.HandleNextDocument(reader))
      if (lines-- == 0) throw BadInput(file + ": no YAML, whose documents (---) have an end");
    const std::vector<YAML::Node> documents = YAML::LoadAll(body);
    if (!documents.empty()) root = documents[0];
    refuse_documents(documents, file);
  } catch (const YAML::Exception& e) {
    const std::string where =
        e.mark.is_null() ? "" : "line " + std::to_string(e.mark.line + 1) + ": ";
    throw BadInput(file + ": " + where + e.msg);
  }
  if (!root.IsMap()) throw BadInput(file + ": no YAML map of names and values");
  return root;
}

double number_at(const YAML::Node& map, const std::string& entry, const std::string& file) {
  return finite(find(map, entry, file), entry, file);
}

double number_of(const YAML::Node& value, const std::string& entry, const std::string& file) {
  if (value.IsNull()) throw BadInput(file + ": " + entry + " is missing");
  return finite(value, entry, file);
}

int32_t side_of(double value, const std::string& entry, const std::string& file) {
  if (value == 0) throw BadInput(file + ": " + entry + " is 0");
  if (value != std::floor(value) || value < 1 || value > 1e6)
    throw BadInput(file + ": " + entry + " is not a number of pixels");
  return static_cast<int32_t>(value);
}

void require_focal(double value, const std::string& entry, const std::string& file) {
  if (value == 0) throw BadInput(file + ": " + entry + " is 0");
  if (value < 0) throw BadInput(file + ": " + entry + " is negative");
}

std::vector<double> shape_of(const YAML::Node& value, const std::string& entry,
                             const std::string& file) {
  std::vector<double> shape;
  if (!value.IsMap()) return shape;
  if (value["sizes"]) {
    const YAML::Node sizes = value["sizes"];
    if (sizes.IsSequence())
      append(sizes, entry + ".sizes", file, shape);
    else
      shape.push_back(finite(sizes, entry + ".sizes", file));
  } else if (value["rows"] && value["cols"]) {
    for (const char* side : {"rows", "cols"})
      shape.push_back(number_at(value, side, file + ": " + entry));
  }
  return shape;
}

std::vector<double> numbers_at(const YAML::Node& map, const std::string& entry,
                               const std::string& file) {
  return numbers_of(find(map, entry, file), entry, file);
}

std::vector<double> numbers_of(const YAML::Node& value, const std::string& entry,
                               const std::string& file) {
  YAML::Node list = value;
  if (value.IsMap()) {
    const YAML::Node data = value["data"];
    if (!data) throw BadInput(file + ": " + entry + " has no data");
    list.reset(data);
  }
  if (!list.IsSequence()) throw BadInput(file + ": " + entry + " is not a list of numbers");
  std::vector<double> values;
  append(list, entry, file, values);
  const std::vector<double> shape = shape_of(value, entry, file);
  double count = 1;
  for (const double side : shape) count *= side;
  const bool is_ros278 = shape == std::vector<double>{1, 5} && values.size() == 8;
  if (shape.empty() || count == static_cast<double>(values.size()) || is_ros278) return values;
  std::string sides;
  for (const double side : shape)
    sides += (sides.empty() ? "" : " x ") + std::to_string(static_cast<long>(side));
  throw BadInput(file + ": " + entry + " has " + std::to_string(values.size()) + " numbers, not " +
                 (value["sizes"] ? "sizes" : "rows x cols") + " = " + sides);
}

}  // namespace cli
