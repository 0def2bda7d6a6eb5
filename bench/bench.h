// What the benchmark programs share: rows with a name, one timed call each, and main.
//
// A row's name is stage/case/system; the system is "twoview", or the peer with its version. The
// rows of a case are to do the same work, and their counters say how much of it each has found. All
// rows of a program run in random order, so that a change of the machine's speed affects all
// systems alike. scripts/bench reads the JSON and divides.
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
  std::function<void()> work;       // timed; called once untimed beforehand
  std::function<Counters()> found;  // counts and errors of the last call's results
  double units = 1;                 // keypoints, points, samples .. that one call works on
};

void add(Row row);

// A peer that this machine lacks: a row that says so.
void add_missing(const std::string& name);

// stage/case/twoview, with the kernel set where TWOVIEW_KERNELS asks for one.
std::string ours(const std::string& stage_case);

tv_kernels kernels_in_use();

struct FreeContext {
  void operator()(tv_context* context) const;
};
using Context = std::unique_ptr<tv_context, FreeContext>;
Context make_context(int width, int height, int max_keypoints, int max_matches = 0);

// Ends the program where a call that cannot fail has failed.
void require(tv_status status, const char* what);

// Runs all rows. Arguments are Google Benchmark's; its defaults here are 15 repetitions, which
// are run in random order with those of the other rows.
int run(int argc, char** argv);

}  // namespace bench
