// Five-point solvers on samples without noise: essential matrices from five matched rays, by our
// solver, OpenGV's three and OpenCV's. The error is the median over samples of the distance from
// the true matrix to the nearest solution. Our solver has two rows: eight samples a call, as the
// robust estimate calls it, and one sample a call. OpenGV's and OpenCV's copies of the matches are
// made outside of the timed work.
#include <algorithm>
#include <cmath>
#include <opencv2/calib3d.hpp>

#include "bench.h"
#include "kernels/kernels.h"
#include "problem.h"
#ifdef BENCH_HAS_OPENGV
#include "opengv_peer.h"
#endif

namespace {

using bench::Counters;
using Solutions = std::vector<std::vector<double>>;  // [sample]: 9 numbers for each solution

constexpr int kNumSamples = 200;
static_assert(kNumSamples % TVK_WIDTH == 0, "whole groups");

struct Samples {
  // For each sample, five unit rays in each view (15 numbers a view), and the true essential matrix
  // (9 numbers).
  std::vector<double> rays[2], essentials;
  Solutions solutions = Solutions(kNumSamples);
};

std::shared_ptr<Samples> make_samples() {
  const auto samples = std::make_shared<Samples>();
  for (int s = 0; s < kNumSamples; ++s) {
    const bench::Problem problem = bench::make_problem(static_cast<uint64_t>(s), 5, 5, 0);
    for (int v = 0; v < 2; ++v) {
      const std::vector<double> rays = problem.unit_rays(v);
      samples->rays[v].insert(samples->rays[v].end(), rays.begin(), rays.end());
    }
    const double *t = problem.t, *R = problem.R;
    const double cross[9] = {0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0};
    for (int k = 0; k < 9; ++k) {
      const int row = k / 3 * 3, column = k % 3;
      samples->essentials.push_back(cross[row] * R[column] + cross[row + 1] * R[3 + column] +
                                    cross[row + 2] * R[6 + column]);
    }
  }
  return samples;
}

// The distance between two matrices scaled to norm 1: the smallest over both signs of `m` and over
// `truth` and its transpose, since a solver may exchange the views.
double distance(const double* m, const double* truth) {
  double norm = 0, true_norm = 0;
  for (int k = 0; k < 9; ++k) norm += m[k] * m[k], true_norm += truth[k] * truth[k];
  double off[4] = {0, 0, 0, 0};
  for (int k = 0; k < 9; ++k) {
    const double a = m[k] / std::sqrt(norm), b = truth[k] / std::sqrt(true_norm);
    const double c = truth[k % 3 * 3 + k / 3] / std::sqrt(true_norm);
    off[0] += (a - b) * (a - b), off[1] += (a + b) * (a + b);
    off[2] += (a - c) * (a - c), off[3] += (a + c) * (a + c);
  }
  return std::sqrt(*std::min_element(off, off + 4));
}

Counters errors_of(const Samples& samples) {
  std::vector<double> nearest;
  double count = 0;
  for (size_t s = 0; s < samples.solutions.size(); ++s) {
    const std::vector<double>& found = samples.solutions[s];
    double least = 2;
    for (size_t k = 0; k < found.size(); k += 9) {
      least = std::min(least, distance(found.data() + k, samples.essentials.data() + 9 * s));
    }
    nearest.push_back(least);
    count += static_cast<double>(found.size()) / 9;
  }
  return {{"solutions", count / kNumSamples},
          {"error", bench::median(nearest)},
          {"lost",
           1.0 * std::count_if(nearest.begin(), nearest.end(), [](double e) { return e > 1e-3; })}};
}

void add_ours(const std::string& name, const std::shared_ptr<Samples>& samples, int at_once) {
  const tvk_geometry_table* kernels = tvk_geometry_of(tvk_select(bench::kernels_in_use()));
  const auto essentials = std::make_shared<std::vector<double>>(9 * TVK_RELPOSE_MODELS * TVK_WIDTH);
  const auto solve = [=](int first, bool keep) {
    double rays[30 * TVK_WIDTH];
    int32_t counts[TVK_WIDTH];
    for (int s = 0; s < TVK_WIDTH; ++s) {
      const int sample = first + s % at_once;
      for (int k = 0; k < 30; ++k) {  // k: match k / 6, view k / 3 % 2, coordinate k % 3
        rays[TVK_WIDTH * k + s] =
            samples->rays[k / 3 % 2][static_cast<size_t>(15 * sample + k / 6 * 3 + k % 3)];
      }
    }
    kernels->relpose_5pt(rays, at_once, essentials->data(), counts);
    for (int s = 0; keep && s < at_once; ++s) {
      const double* found = essentials->data() + 9 * TVK_RELPOSE_MODELS * s;
      samples->solutions[static_cast<size_t>(first + s)].assign(found, found + 9 * counts[s]);
    }
  };
  const auto solve_all = [=](bool keep) {
    for (int first = 0; first < kNumSamples; first += at_once) solve(first, keep);
  };
  bench::add({bench::ours(name), [=] { solve_all(false); },
              [=] {
                solve_all(true);
                return errors_of(*samples);
              },
              1.0 * kNumSamples});
}

void add_opencv(const std::string& name, const std::shared_ptr<Samples>& samples) {
  const auto points = std::make_shared<std::vector<std::vector<cv::Point2d>>>(2 * kNumSamples);
  for (size_t k = 0; k < points->size(); ++k) {
    for (size_t i = 0; i < 5; ++i) {
      const double* ray = samples->rays[k % 2].data() + 15 * (k / 2) + 3 * i;
      (*points)[k].emplace_back(ray[0] / ray[2], ray[1] / ray[2]);
    }
  }
  const auto solve_all = [=] {
    for (size_t s = 0; s < kNumSamples; ++s) {
      const cv::Mat found = cv::findEssentialMat((*points)[2 * s], (*points)[2 * s + 1],
                                                 cv::Matx33d::eye(), cv::RANSAC);
      if (found.empty())
        samples->solutions[s].clear();
      else
        samples->solutions[s].assign(found.begin<double>(), found.end<double>());
    }
  };
  bench::add({name + "/OpenCV " CV_VERSION " findEssentialMat", solve_all,
              [=] {
                solve_all();
                return errors_of(*samples);
              },
              1.0 * kNumSamples});
}

#ifdef BENCH_HAS_OPENGV
void add_opengv(const std::string& name, const std::shared_ptr<Samples>& samples,
                bench::OpengvSolver solver, const char* solver_name) {
  const auto matches = std::make_shared<bench::OpengvMatches>(samples->rays[0], samples->rays[1]);
  const auto solve_all = [=] {
    for (int s = 0; s < kNumSamples; ++s) {
      std::vector<double>& found = samples->solutions[static_cast<size_t>(s)];
      found.clear();
      matches->solve_five_point(solver, 5 * s, &found);
    }
  };
  const bool rotations = solver == bench::OpengvSolver::kKneip;
  bench::add({name + "/" + bench::kOpengvName + " " + solver_name, solve_all,
              [=] {
                solve_all();
                return rotations ? Counters() : errors_of(*samples);
              },
              1.0 * kNumSamples});
}
#endif

}  // namespace

int main(int argc, char** argv) {
  const std::shared_ptr<Samples> samples = make_samples();
  add_ours("relpose/five-point", samples, TVK_WIDTH);
  add_opencv("relpose/five-point", samples);
  add_ours("relpose/five-point, one sample a call", samples, 1);
#ifdef BENCH_HAS_OPENGV
  for (const char* name : {"relpose/five-point", "relpose/five-point, one sample a call"}) {
    add_opengv(name, samples, bench::OpengvSolver::kStewenius, "Stewenius");
    add_opengv(name, samples, bench::OpengvSolver::kNister, "Nister");
  }
  add_opengv("relpose/five-point", samples, bench::OpengvSolver::kKneip, "Kneip");
#else
  bench::add_missing("relpose/five-point/OpenGV");
#endif
  return bench::run(argc, argv);
}
