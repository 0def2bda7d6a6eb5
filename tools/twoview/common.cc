#include <unistd.h>

#include "error.h"
#include "verbs.h"

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

uint64_t reconstruct_pair(Session& session, const Options& options, Outcome& outcome) {
  const Picture &p0 = outcome.picture[0], &p1 = outcome.picture[1];
  tv_context* context =
      session.context(std::max(p0.luma.cols, p1.luma.cols), std::max(p0.luma.rows, p1.luma.rows));
  tv_view views[2];
  for (int i = 0; i < 2; ++i) {
    tv_view_init(&views[i]);
    views[i].image = outcome.picture[i].view();
    views[i].camera = outcome.has_cameras ? &outcome.camera[i] : nullptr;
  }
  tv_two_view_init(&outcome.two_view);
  tv_reconstruction_init(&outcome.reconstruction);
  tv_reconstruct_options stages;
  tv_reconstruct_options_init(&stages);
  stages.triangulation = options.triangulation;
  stages.guided_matching = options.guided_matching;
  stages.bundle_adjustment = options.bundle_adjustment;
  stages.feature = &options.feature;
  stages.match = &options.match;
  stages.estimate = &options.estimate;
  const uint64_t start_ns = now_ns();
  const tv_status status = tv_reconstruct(context, &views[0], &views[1], &stages, &outcome.two_view,
                                          &outcome.reconstruction);
  const uint64_t total_ns = now_ns() - start_ns;
  if (status != TV_OK)
    throw BadInput("cannot reconstruct " + p0.path + " and " + p1.path + " with --method " +
                   method_name(options.estimate.method) + ": " + tv_status_string(status));
  return total_ns;
}

Style stdout_style() {
  if (!isatty(STDOUT_FILENO)) return {};
  return {"\033[1m", "\033[2m", "\033[32m", "\033[33m", "\033[31m", "\033[0m"};
}

}  // namespace cli
