// The program twoview: parses the command line, runs the chosen verb and reports errors.

#include <CLI/CLI.hpp>
#include <csignal>
#include <cstdio>
#include <cstdlib>
#include <new>
#include <opencv2/core.hpp>
#include <opencv2/core/utils/logger.hpp>

#include "base/error.h"
#include "base/output.h"
#include "verbs/python_verbs.h"
#include "verbs/usage_errors.h"
#include "verbs/verbs.h"
#ifdef TWOVIEW_HAS_DRONE
#include "drone/drone.h"
#endif
#ifdef TWOVIEW_HAS_ODOMETRY
#include "odometry/odometry_verb.h"
#endif
#ifdef TWOVIEW_HAS_SIMULATOR
#include "simulate/simulate.h"
#endif

namespace {

#ifdef TWOVIEW_HAS_SIMULATOR
constexpr cli::AddDroneVerb kAddSimulate = cli::add_drone_simulate;
#elif defined(TWOVIEW_HAS_DRONE)
constexpr cli::AddDroneVerb kAddSimulate = nullptr;
#endif

// Prints an error as one line, even if the message has line breaks, and returns the exit status.
int refuse(std::string message) {
  for (char& c : message)
    if (static_cast<unsigned char>(c) < ' ') c = ' ';
  std::fprintf(stderr, "twoview: %s\n", message.c_str());
  return cli::kExitBadInput;
}

int run_program(int argc, char** argv) {
  CLI::App program("FAST-SIFT matching and two-view geometry", "twoview");
  program.set_version_flag("--version", std::string("twoview ") + tv_version_string());
  program.require_subcommand(1);
  cli::Run run;
  cli::add_reconstruct(program, run);
  cli::add_detect(program, run);
  cli::add_match(program, run);
  cli::add_triangulate(program, run);
  cli::add_undistort(program, run);
  cli::add_calibrate(program, run);
  cli::add_evaluate(program, run);
#ifdef TWOVIEW_HAS_ODOMETRY
  cli::add_odometry(program, run);
  cli::add_map(program, run);
#endif
#ifdef TWOVIEW_HAS_ROOM
  cli::add_room(program, run);
#endif
#ifdef TWOVIEW_HAS_DRONE
  cli::add_drone(program, run, kAddSimulate);
#endif
  cli::add_python_verbs(program);
  const std::string mistyped = cli::mistyped_verb(program, argc, argv);
  if (!mistyped.empty()) return refuse(mistyped);  // also with --help
  try {
    program.parse(argc, argv);
  } catch (const CLI::CallForVersion& e) {
    cli::print(std::string(e.what()) + "\n");
    return 0;
  } catch (const CLI::Success&) {  // thrown for --help
    const CLI::App* chosen = &program;
    std::string path;
    while (!chosen->get_subcommands().empty()) {
      if (!path.empty()) path += ' ';
      path += chosen->get_name();
      chosen = chosen->get_subcommands()[0];
    }
    cli::print(chosen->help(path));
    return 0;
  } catch (const CLI::ParseError& e) {
    return refuse(cli::usage_error(program, argc, argv, e));
  }
  return run();
}

}  // namespace

int main(int argc, char** argv) {
  try {
    cli::hand_over_python_verb(argc, argv);
  } catch (const cli::BadInput& e) {
    return refuse(e.what());
  }
  // With these signals ignored, write() returns an error for a full disk and for a closed pipe.
  std::signal(SIGXFSZ, SIG_IGN);
  std::signal(SIGPIPE, SIG_IGN);
  cli::clean_up_on_signals();
  cv::utils::logging::setLogLevel(cv::utils::logging::LOG_LEVEL_SILENT);
  cv::redirectError([](int, const char*, const char*, const char*, int, void*) { return 0; });
  try {
    return run_program(argc, argv);
  } catch (const cli::BadInput& e) {
    return refuse(e.what());
  } catch (const std::bad_alloc&) {
    return refuse("not enough memory");
  } catch (const std::exception& e) {
    return refuse(e.what());
  }
}
