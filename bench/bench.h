// Shared by the benchmark programs: rows, each with a name and a timed call, and their main
// program.
//
// A row's name is stage/case/system; the system is "twoview", or the peer with its version. The
// rows of a case do the same work, and their counters report what each system found. All
// rows of a program run in random order, so that a change of the machine's speed affects all
// systems alike. scripts/bench reads the JSON output and computes the ratios peer / ours.
#pragma once

#include <functional>
#include <map>
#include <memory>
#include <string>

#include "twoview/twoview.h"

namespace bench {

using Counters = std::map<std::string, double>;

struct Row {
  std::string name;
  std::function<void()> work;       // the timed call; it is called once before the timing
  std::function<Counters()> found;  // counts and errors of the results of the last call of work()
  double units = 1;                 // keypoints, points or samples in a call; rows.py divides by it
};

void add(Row row);

// Adds a row which reports that the peer is not installed on this machine.
void add_missing(const std::string& name);

// The name of our row of a case: stage/case/twoview.
std::string ours(const std::string& stage_case);

tv_kernels kernels_in_use();

struct FreeContext {
  void operator()(tv_context* context) const;
};
using Context = std::unique_ptr<tv_context, FreeContext>;
Context make_context(int width, int height, int max_keypoints, int max_matches = 0);

// Ends the program with an error message if status is not TV_OK.
void require(tv_status status, const char* what);

// Runs all rows. The arguments are those of Google Benchmark. By default each row is repeated 15
// times, in random order among the repetitions of the other rows.
int run(int argc, char** argv);

}  // namespace bench
