#include "verbs/common.h"

#include <unistd.h>

namespace cli {

void add_common(CLI::App& verb, Common& common, unsigned groups, const std::string& output_help) {
  CLI::Option* output = verb.add_option("-o,--output", common.output, output_help);
  output->required();
  output->type_name("PATH");
  output->check([](const std::string& path) {
    return path.empty() ? std::string("the path is empty") : std::string();
  });
  verb.add_flag("--json", common.json, "print the result alone, as JSON, on stdout");
  verb.add_flag("--quiet", common.quiet, "print nothing on stdout");
  add_options(verb, common.options, groups);
}

Style stdout_style() {
  if (!isatty(STDOUT_FILENO)) return {};
  return {"\033[1m", "\033[2m", "\033[32m", "\033[33m", "\033[31m", "\033[0m"};
}

}  // namespace cli
