#include "problem.h"

#include <algorithm>
#include <cstring>
#include <numeric>
#include <random>

namespace bench {
namespace {

constexpr double kPi = 3.14159265358979323846;

struct Maker {
  std::mt19937_64 random;

  double uniform(double from, double to) {
    return std::uniform_real_distribution<double>(from, to)(random);
  }
  double normal() { return std::normal_distribution<double>(0, 1)(random); }

  void direction(double v[3]) {
    double norm = 0;
    for (int k = 0; k < 3; ++k) v[k] = normal(), norm += v[k] * v[k];
    for (int k = 0; k < 3; ++k) v[k] /= std::sqrt(norm);
  }

  void rotation(double R[9]) {
    double n[3];
    direction(n);
    const double angle = uniform(1, 12) * kPi / 180, c = std::cos(angle), s = std::sin(angle);
    const double cross[9] = {0, -n[2], n[1], n[2], 0, -n[0], -n[1], n[0], 0};
    for (int k = 0; k < 9; ++k) {
      R[k] = (k % 4 == 0 ? c : 0) + s * cross[k] + (1 - c) * n[k / 3] * n[k % 3];
    }
  }

  void pixel(const tv_camera& camera, double p[2]) {
    p[0] = uniform(5, camera.width - 6), p[1] = uniform(5, camera.height - 6);
  }

  // Draws a point and its pixels in both views. Returns false if the second view does not see it.
  bool true_match(const Problem& problem, double p0[2], double p1[2]) {
    const tv_camera& camera = problem.camera;
    pixel(camera, p0);
    const double depth = uniform(2, 8);
    const double X[3] = {(p0[0] - camera.cx) / camera.fx * depth,
                         (p0[1] - camera.cy) / camera.fy * depth, depth};
    double Y[3];
    for (int i = 0; i < 3; ++i) {
      const double* row = problem.R + 3 * i;
      Y[i] = row[0] * X[0] + row[1] * X[1] + row[2] * X[2] + problem.t[i];
    }
    return tv_camera_project(&camera, Y, p1, nullptr) == TV_OK && p1[0] > 0 && p1[1] > 0 &&
           p1[0] < camera.width - 1 && p1[1] < camera.height - 1;
  }
};

double angle_deg(double cosine) {
  return std::acos(std::max(-1.0, std::min(1.0, cosine))) * 180 / kPi;
}

}  // namespace

std::vector<double> Problem::unit_rays(int view) const {
  std::vector<double> rays;
  for (size_t k = 0; k < pixels[view].size(); k += 2) {
    const double x = (pixels[view][k] - camera.cx) / camera.fx;
    const double y = (pixels[view][k + 1] - camera.cy) / camera.fy;
    const double norm = std::sqrt(x * x + y * y + 1);
    rays.insert(rays.end(), {x / norm, y / norm, 1 / norm});
  }
  return rays;
}

Problem make_problem(uint64_t seed, int num, int num_true, double noise_px) {
  Problem problem{};
  problem.camera.width = 640, problem.camera.height = 480;
  problem.camera.fx = problem.camera.fy = 500;
  problem.camera.cx = 320, problem.camera.cy = 240;
  Maker maker{std::mt19937_64(seed)};
  maker.rotation(problem.R);
  maker.direction(problem.t);
  std::vector<double> drawn[2];
  for (int tries = 0; static_cast<int>(drawn[0].size()) < 2 * num; ++tries) {
    if (tries == 100 * num) {  // the views overlap too little: draw another motion
      maker.rotation(problem.R);
      maker.direction(problem.t);
      drawn[0].clear(), drawn[1].clear();
      tries = 0;
    }
    const bool wrong = static_cast<int>(drawn[0].size()) >= 2 * num_true;
    double p[2][2];
    if (wrong) {
      for (auto& pixel : p) maker.pixel(problem.camera, pixel);
    } else if (!maker.true_match(problem, p[0], p[1])) {
      continue;
    }
    for (int k = 0; k < 4; ++k) {
      drawn[k / 2].push_back(p[k / 2][k % 2] + (wrong ? 0 : noise_px * maker.normal()));
    }
  }
  std::vector<size_t> order(static_cast<size_t>(num));
  std::iota(order.begin(), order.end(), size_t{0});
  std::shuffle(order.begin(), order.end(), maker.random);
  for (size_t k : order) {
    for (int v = 0; v < 2; ++v) {
      problem.pixels[v].insert(problem.pixels[v].end(), {drawn[v][2 * k], drawn[v][2 * k + 1]});
    }
  }
  return problem;
}

double pose_error_deg(const double R[9], const double t[3], const double true_R[9],
                      const double true_t[3]) {
  double trace = 0, dot = 0, tt = 0, true_tt = 0;
  for (int k = 0; k < 9; ++k) trace += R[k] * true_R[k];
  for (int k = 0; k < 3; ++k) dot += t[k] * true_t[k], tt += t[k] * t[k];
  for (int k = 0; k < 3; ++k) true_tt += true_t[k] * true_t[k];
  return std::max(angle_deg((trace - 1) / 2), angle_deg(dot / std::sqrt(tt * true_tt)));
}

double median(std::vector<double> values) {
  if (values.empty()) return 0;
  std::sort(values.begin(), values.end());
  return values[values.size() / 2];
}

}  // namespace bench
