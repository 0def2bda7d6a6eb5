#include "verbs/python_verbs.h"

#include <sys/wait.h>
#include <unistd.h>
#include <CLI/App.hpp>

#include <cerrno>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <filesystem>
#include <string>
#include <vector>

#include "base/error.h"

namespace cli {
namespace {

namespace fs = std::filesystem;

struct PythonVerb {
  const char *name, *script, *help;
};
constexpr PythonVerb kVerbs[] = {
    {"compare", "compare_colmap", "the same pairs beside COLMAP, OpenGV, OpenCV and PoseLib"},
    {"colmap", "twoview_colmap", "COLMAP databases and models, in and out"},
    {"import", "twoview_bags", "a bag of ROS 1, ROS 2 or MCAP as a folder for odometry"},
    {"export", "twoview_bags", "path and map of odometry as a bag of ROS 1, ROS 2 or MCAP"},
    {"rerun", "twoview_rerun", "a result or a recording as a file for Rerun's viewer"},
};

// The root of the Python verbs: the nearest folder above this program that contains
// TWOVIEW_PYTHON_VERBS (CMakeLists.txt), either itself (the source tree) or in its share/twoview
// (an installation). Empty if there is none.
fs::path tree_of(const fs::path& program) {
  for (fs::path folder = program.parent_path(); folder != folder.root_path();
       folder = folder.parent_path())
    for (const fs::path& tree : {folder, folder / TWOVIEW_DATA_DIR})
      if (std::error_code none; fs::is_directory(tree / TWOVIEW_PYTHON_VERBS, none)) return tree;
  return {};
}

// The Python to run: TWOVIEW_PYTHON, else the one that scripts/bootstrap installed, else the one in
// the PATH.
std::string python_of(const fs::path& tree) {
  const char* const named = std::getenv("TWOVIEW_PYTHON");
  if (named && *named) return named;
  const fs::path bootstrapped = tree / ".cache" / "venv" / "bin" / "python";
  return access(bootstrapped.c_str(), X_OK) == 0 ? bootstrapped.string() : "python3";
}

// Makes the package twoview load this program's library, unless the caller named another one. The
// name without a version is there only with the headers.
void name_library(const fs::path& program) {
  const fs::path prefix = program.parent_path().parent_path();
  for (const char* folder : {"lib", TWOVIEW_LIB_DIR}) {
    for (const char* name : {"libtwoview.so", "libtwoview.so." TWOVIEW_SOVERSION}) {
      const fs::path library = prefix / folder / name;
      if (std::error_code none; !fs::is_regular_file(library, none)) continue;
      setenv("TWOVIEW_LIBRARY", library.c_str(), 0);
      return;
    }
  }
}

// Replaces this process by the verb's Python program.
[[noreturn]] void become(const PythonVerb& verb, const std::vector<std::string>& given) {
  std::error_code error;
  const fs::path program = fs::read_symlink("/proc/self/exe", error);
  const fs::path tree = tree_of(program);
  const fs::path script = tree / TWOVIEW_PYTHON_VERBS / verb.script;
  if (tree.empty() || !fs::is_regular_file(script, error))
    throw BadInput(
        std::string(verb.name) +
        " needs the package python3-twoview (" TWOVIEW_DATA_DIR "/" TWOVIEW_PYTHON_VERBS "/" +
        verb.script + " of an installation or the source tree, above " + program.string() + ")");
  name_library(program);
  setenv("TWOVIEW_VERB", (std::string("twoview ") + verb.name).c_str(), 1);

  std::string python = python_of(tree), path = script.string();
  std::vector<std::string> texts = given;
  std::vector<char*> arguments{python.data(), path.data()};
  for (std::string& text : texts) arguments.push_back(text.data());
  arguments.push_back(nullptr);
  execvp(python.c_str(), arguments.data());
  throw BadInput("cannot run " + python + ": " + std::strerror(errno) +
                 " (Debian's package python3, or scripts/bootstrap test, installs one; "
                 "TWOVIEW_PYTHON names another)");
}

}  // namespace

void add_python_verbs(CLI::App& program) {
  for (const PythonVerb& verb : kVerbs) program.add_subcommand(verb.name, verb.help);
}

void hand_over_python_verb(int argc, char** argv) {
  for (const PythonVerb& verb : kVerbs)
    if (argc > 1 && std::strcmp(argv[1], verb.name) == 0) become(verb, {argv + 2, argv + argc});
}

int run_python_verb(const std::string& name, const std::vector<std::string>& arguments) {
  const pid_t child = fork();
  if (child < 0) throw BadInput(std::string("cannot start a process: ") + std::strerror(errno));
  if (child == 0) {
    try {
      for (const PythonVerb& verb : kVerbs)
        if (name == verb.name) become(verb, arguments);
    } catch (const std::exception& e) {
      std::fprintf(stderr, "twoview: %s\n", e.what());
    }
    _exit(kExitBadInput);
  }
  int status = 0;
  while (waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  return WIFEXITED(status) ? WEXITSTATUS(status) : kExitBadInput;
}

}  // namespace cli
