// The line for a command line that does not parse: it names what was mistyped, and what is near it.
#pragma once

#include <CLI/CLI.hpp>
#include <string>
#include <vector>

namespace cli {

// Those of `known` that `word` was probably meant to be: the ones that begin with it, else those
// that it begins with, else those that differ from it in the fewest letters (inserted, left out,
// exchanged), where these are at most two and at most a third of the word. In the order of `known`;
// empty if there are none.
std::vector<std::string> near_names(const std::string& word, const std::vector<std::string>& known);

// Continues a message: "; did you mean --focal-35mm or --focal-sigma?", or nothing.
std::string suggestion(const std::string& word, const std::vector<std::string>& known);

// The message for a first argument that is neither an option nor a verb; empty if there is none.
std::string mistyped_verb(const CLI::App& program, int argc, const char* const* argv);

// The message of a parse error. An option that the verb does not have is named before all else that
// is missing, since it is often the reason.
std::string usage_error(const CLI::App& program, int argc, const char* const* argv,
                        const CLI::ParseError& error);

}  // namespace cli
