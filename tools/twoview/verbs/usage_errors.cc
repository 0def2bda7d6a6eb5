#include "verbs/usage_errors.h"

#include <CLI/App.hpp>
#include <algorithm>

namespace cli {
namespace {

// The least number of letters to insert, leave out or exchange between a and b.
size_t edit_distance(const std::string& a, const std::string& b) {
  std::vector<size_t> row(b.size() + 1);
  for (size_t j = 0; j <= b.size(); ++j) row[j] = j;
  for (size_t i = 1; i <= a.size(); ++i) {
    size_t diagonal = row[0];
    row[0] = i;
    for (size_t j = 1; j <= b.size(); ++j) {
      const size_t exchanged = diagonal + (a[i - 1] == b[j - 1] ? 0 : 1);
      diagonal = row[j];
      row[j] = std::min({exchanged, row[j] + 1, row[j - 1] + 1});
    }
  }
  return row[b.size()];
}

std::vector<std::string> verb_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::App* verb : app.get_subcommands([](const CLI::App*) { return true; }))
    names.push_back(verb->get_name());
  return names;
}

// The message for a word that is no verb of `app`; `path` has the verbs before it.
std::string no_verb(const CLI::App& app, const std::string& path, const std::string& word) {
  return "no verb '" + path + word + "'" + suggestion(word, verb_names(app)) + " (see twoview " +
         path + "--help)";
}

std::vector<std::string> option_names(const CLI::App& app) {
  std::vector<std::string> names;
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
  for (const CLI::Option* option : app.get_options())
    for (const std::string& name : option->get_snames()) names.push_back("-" + name);
  return names;
}

// Whether the word has the form of an option: not a name, "-", or a number such as -1.
bool is_option(const std::string& word) {
  const auto is_letter = [](char c) { return (c >= 'a' && c <= 'z') || (c >= 'A' && c <= 'Z'); };
  if (word.size() < 2 || word[0] != '-') return false;
  return word[1] == '-' ? word.size() > 2 : is_letter(word[1]);
}

// What does the work of an option that only other verbs have; empty where there is nothing.
std::string other_verb(const std::string& path, const std::string& option) {
  const bool has_files = path == "odometry " || path == "drone record " || path == "drone replay ";
  return has_files && option == "--rerun" ? "; twoview rerun DIR FILE.rrd does it afterwards" : "";
}

// "a, b or c"
std::string alternatives(const std::vector<std::string>& names) {
  std::string text;
  for (size_t i = 0; i < names.size(); ++i)
    text += (i == 0 ? "" : i + 1 == names.size() ? " or " : ", ") + names[i];
  return text;
}

}  // namespace

std::vector<std::string> near_names(const std::string& word,
                                    const std::vector<std::string>& known) {
  std::vector<std::string> near;
  for (const std::string& name : known)
    if (name.compare(0, word.size(), word) == 0) near.push_back(name);
  if (!near.empty()) return near;
  for (const std::string& name : known)
    if (name.size() > 3 && word.compare(0, name.size(), name) == 0) near.push_back(name);
  if (!near.empty()) return near;
  size_t nearest = std::min<size_t>(2, word.size() / 3);
  for (const std::string& name : known) {
    const size_t distance = edit_distance(word, name);
    if (distance < nearest) near.clear();
    if (distance > nearest) continue;
    nearest = distance;
    near.push_back(name);
  }
  return near;
}

std::string suggestion(const std::string& word, const std::vector<std::string>& known) {
  constexpr size_t most = 4;  // more are no help: "--m" begins ten options
  const std::vector<std::string> near = near_names(word, known);
  if (near.empty() || near.size() > most) return "";
  return "; did you mean " + alternatives(near) + "?";
}

std::string mistyped_verb(const CLI::App& program, int argc, const char* const* argv) {
  if (argc < 2 || argv[1][0] == '-') return "";
  const std::vector<std::string> verbs = verb_names(program);
  const bool is_verb = std::find(verbs.begin(), verbs.end(), argv[1]) != verbs.end();
  return is_verb ? "" : no_verb(program, "", argv[1]);
}

std::string usage_error(const CLI::App& program, int argc, const char* const* argv,
                        const CLI::ParseError& error) {
  const CLI::App* app = &program;
  std::string path;  // "drone info "
  int rest = 1;      // the first argument behind the verbs
  for (; rest < argc; ++rest) {
    const std::string word = argv[rest];
    const auto named =
        app->get_subcommands([&](const CLI::App* verb) { return verb->get_name() == word; });
    if (named.empty()) break;
    app = named[0];
    path += word + " ";
  }
  const std::string help = " (see twoview " + path + "--help)";
  const std::vector<std::string> verbs = verb_names(*app);
  if (!verbs.empty() && rest < argc && argv[rest][0] != '-') return no_verb(*app, path, argv[rest]);
  const std::vector<std::string> options = option_names(*app);
  for (int i = rest; i < argc; ++i) {
    const std::string word = argv[i];
    if (word == "--") break;
    if (!is_option(word)) continue;
    const bool is_long = word[1] == '-';  // else its value may follow at once: -oFOLDER
    const std::string name = is_long ? word.substr(0, word.find('=')) : word.substr(0, 2);
    if (std::find(options.begin(), options.end(), name) == options.end())
      return "no option " + name + other_verb(path, name) + suggestion(name, options) + help;
  }
  if (!verbs.empty() && rest == argc)
    return "a verb is required" +
           (path.empty() ? "" : " after " + path.substr(0, path.size() - 1)) + ": " +
           alternatives(verbs) + help;
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    std::string extras;
    for (const std::string& word : program.remaining(true)) extras += " " + word;
    return "arguments that are not expected:" + extras + help;
  }
  return error.what() + help;
}

}  // namespace cli
