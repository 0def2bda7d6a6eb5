#include "bench.h"

#include <benchmark/benchmark.h>

#include <cstdio>
#include <cstdlib>
#include <opencv2/core.hpp>
#include <vector>

#include "twoview/alloc.h"

// The timed work. It has a C name and is not inlined, so that callgrind can count its instructions.
extern "C" [[gnu::noinline]] void bench_measured(const std::function<void()>& work) { work(); }

namespace bench {
namespace {

tv_kernels kernels_asked_for() {
  const char* name = std::getenv("TWOVIEW_KERNELS");
  if (!name) return TV_KERNELS_AUTO;
  for (int set = TV_KERNELS_AUTO; set <= TV_KERNELS_NEON; ++set) {
    if (name == std::string(tv_kernels_string(static_cast<tv_kernels>(set)))) {
      return static_cast<tv_kernels>(set);
    }
  }
  std::fprintf(stderr, "TWOVIEW_KERNELS: no kernel set is named %s\n", name);
  std::exit(2);
}

// The value N of TWOVIEW_BENCH_CALLS: each row makes exactly N calls, for instruction counts and
// for profilers. 0 if it is not set.
int calls_asked_for() {
  const char* text = std::getenv("TWOVIEW_BENCH_CALLS");
  return text ? std::atoi(text) : 0;
}

}  // namespace

void require(tv_status status, const char* what) {
  if (status == TV_OK) return;
  std::fprintf(stderr, "%s: %s\n", what, tv_status_string(status));
  std::exit(1);
}

void FreeContext::operator()(tv_context* context) const { tv_context_free(context); }

Context make_context(int width, int height, int max_keypoints, int max_matches) {
  tv_limits limits;
  tv_limits_init(&limits);
  limits.max_width = width;
  limits.max_height = height;
  limits.max_keypoints = max_keypoints;
  limits.max_matches = max_matches;
  limits.kernels = kernels_asked_for();
  tv_context* context = nullptr;
  require(tv_context_new(&context, &limits), "tv_context_new");
  return Context(context);
}

tv_kernels kernels_in_use() { return tv_context_kernels(make_context(64, 64, 1).get()); }

std::string ours(const std::string& stage_case) { return stage_case + "/twoview"; }

void add(Row row) {
  const auto measure = [row](benchmark::State& state) {
    row.work();
    for (auto _ : state) bench_measured(row.work);
    for (const auto& [name, value] : row.found ? row.found() : Counters()) {
      state.counters[name] = value;
    }
    state.counters["units"] = row.units;
  };
  auto* registered = benchmark::RegisterBenchmark(row.name.c_str(), measure);
  // The CPU time of the process, which includes the threads that a peer starts.
  registered->MeasureProcessCPUTime()->Unit(benchmark::kMicrosecond);
  if (const int calls = calls_asked_for()) registered->Iterations(calls)->Repetitions(1);
}

void add_missing(const std::string& name) {
  benchmark::RegisterBenchmark(name.c_str(),
                               [](benchmark::State& state) { state.SkipWithError("peer missing"); })
      ->Iterations(1)
      ->Repetitions(1);
}

int run(int argc, char** argv) {
  cv::setNumThreads(1);
  std::vector<std::string> arguments = {
      argv[0], "--benchmark_repetitions=15", "--benchmark_min_time=0.02",
      "--benchmark_enable_random_interleaving=true", "--benchmark_display_aggregates_only=true"};
  arguments.insert(arguments.end(), argv + 1, argv + argc);
  std::vector<char*> pointers;
  for (std::string& argument : arguments) pointers.push_back(argument.data());
  int count = static_cast<int>(pointers.size());
  benchmark::AddCustomContext("kernels", tv_kernels_string(kernels_in_use()));
  benchmark::AddCustomContext("compiler", BENCH_COMPILER);
  benchmark::AddCustomContext("twoview", tv_version_string());
  benchmark::Initialize(&count, pointers.data());
  if (benchmark::ReportUnrecognizedArguments(count, pointers.data())) return 2;
  return benchmark::RunSpecifiedBenchmarks() > 0 ? 0 : 1;
}

}  // namespace bench
