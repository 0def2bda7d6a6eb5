// Robust estimates of the essential matrix from 500 simulated matches (problem.h), of which 30, 50
// or 80 per cent are true, with 0.5 px of noise and without descriptor ratios: ours with default
// options, OpenCV's USAC and OpenGV's RANSAC, all with a threshold of 1 px. A call solves all
// problems, and the time is the mean over them; the errors are reported with it. PoseLib is
// compared in bench/python_peers.py.
#include <opencv2/calib3d.hpp>

#include "bench.h"
#include "opencv_peer.h"
#include "problem.h"
#ifdef BENCH_HAS_OPENGV
#include "opengv_peer.h"
#endif

namespace {

using bench::Counters;

constexpr int kNumMatches = 500;
constexpr double kNoisePx = 0.5, kMaxErrorPx = 1, kConfidence = 0.9999;
constexpr int kNumProblems = 10;

using Problems = std::shared_ptr<std::vector<bench::Problem>>;
using Errors = std::shared_ptr<std::vector<double>>;  // [problem], degrees; 180: no pose

Problems make_problems(int share) {
  const auto problems = std::make_shared<std::vector<bench::Problem>>();
  for (int k = 0; k < kNumProblems; ++k) {
    problems->push_back(bench::make_problem(static_cast<uint64_t>(1000 * share + k), kNumMatches,
                                            kNumMatches * share / 100, kNoisePx));
  }
  return problems;
}

Counters counters_of(const Errors& errors) {
  double far_off = 0;
  for (double e : *errors) far_off += e > 5;
  return {{"error_deg", bench::median(*errors)}, {"above_5deg", far_off}};
}

// Adds a row. solve(k) estimates the pose of problem k and returns its error in degrees.
template <typename Solve>
void add(const std::string& name, const Problems& problems, Solve solve) {
  const auto errors = std::make_shared<std::vector<double>>(problems->size());
  bench::add({name,
              [=] {
                for (size_t k = 0; k < problems->size(); ++k) (*errors)[k] = solve(k);
              },
              [=] { return counters_of(errors); }, 1.0 * kNumProblems});
}

void add_ours(const std::string& name, const Problems& problems) {
  const std::shared_ptr<tv_context> context = bench::make_context(64, 64, 1, kNumMatches);
  add(bench::ours(name), problems, [=](size_t k) {
    const bench::Problem& p = (*problems)[k];
    tv_two_view pose;
    tv_two_view_init(&pose);
    tv_pixel_pairs pairs;
    tv_pixel_pairs_init(&pairs);
    pairs.num = p.size();
    pairs.pixels0 = p.pixels[0].data();
    pairs.pixels1 = p.pixels[1].data();
    bench::require(tv_estimate_two_view(context.get(), &p.camera, &p.camera, &pairs, nullptr, &pose,
                                        nullptr, nullptr),
                   "tv_estimate_two_view");
    return pose.has_R && pose.has_t ? bench::pose_error_deg(pose.R, pose.t, p.R, p.t) : 180;
  });
}

std::vector<cv::Point2d> points_of(const std::vector<double>& pixels) {
  std::vector<cv::Point2d> points;
  for (size_t k = 0; k < pixels.size(); k += 2) points.emplace_back(pixels[k], pixels[k + 1]);
  return points;
}

void add_opencv(const std::string& name, const Problems& problems, int method) {
  std::vector<std::vector<cv::Point2d>> points;
  for (const bench::Problem& p : *problems) {
    for (const std::vector<double>& pixels : p.pixels) points.push_back(points_of(pixels));
  }
  add(name, problems, [=](size_t k) {
    const bench::Problem& p = (*problems)[k];
    const tv_camera cameras[2] = {p.camera, p.camera};
    const bench::OpencvPose pose = bench::opencv_estimate(points[2 * k], points[2 * k + 1], cameras,
                                                          method, kConfidence, kMaxErrorPx);
    return pose.R.empty()
               ? 180
               : bench::pose_error_deg(pose.R.ptr<double>(), pose.t.ptr<double>(), p.R, p.t);
  });
}

#ifdef BENCH_HAS_OPENGV
void add_opengv(const std::string& name, const Problems& problems, bool refine) {
  std::vector<std::shared_ptr<bench::OpengvMatches>> matches;
  for (const bench::Problem& p : *problems) {
    matches.push_back(std::make_shared<bench::OpengvMatches>(p.unit_rays(0), p.unit_rays(1)));
  }
  add(name, problems, [=](size_t k) {
    const bench::Problem& p = (*problems)[k];
    double R[9], t[3];
    const bool found =
        matches[k]->estimate(std::atan(kMaxErrorPx / p.camera.fx), kConfidence, 1000, refine, R, t);
    return found ? bench::pose_error_deg(R, t, p.R, p.t) : 180;
  });
}
#endif

}  // namespace

int main(int argc, char** argv) {
  for (int share : {30, 50, 80}) {
    const std::string name = "robust/500 matches, " + std::to_string(share) + " % true";
    const std::string opencv = name + "/OpenCV " CV_VERSION " ";
    const Problems problems = make_problems(share);
    add_ours(name, problems);
    add_opencv(opencv + "USAC_DEFAULT", problems, cv::USAC_DEFAULT);
    add_opencv(opencv + "USAC_ACCURATE", problems, cv::USAC_ACCURATE);
    add_opencv(opencv + "USAC_MAGSAC", problems, cv::USAC_MAGSAC);
#ifdef BENCH_HAS_OPENGV
    const std::string opengv = name + "/" + bench::kOpengvName + " ";
    add_opengv(opengv + "Nister, 1000 samples", problems, false);
    add_opengv(opengv + "Nister, 1000 samples, refined", problems, true);
#else
    bench::add_missing(name + "/OpenGV");
#endif
  }
  return bench::run(argc, argv);
}
