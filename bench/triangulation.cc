// Table 1 of the paper again: the seven methods of triangulation, their time and their errors, over
// noise and three geometries, with OpenCV beside them. Markdown, or with --json one object.
//
//   bench_triangulation [--json] [--points N]
#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <random>
#include <string>
#include <vector>

#include "twoview/twoview.h"

#ifdef BENCH_HAS_OPENCV
#include <opencv2/calib3d.hpp>
#endif

namespace {

struct Method {
  const char* name;
  double paper;  // relative time of Table 1; 0 when it is not there
  int method;    // a tv_triangulation, or one of the peers below
};

enum Peer { kPeerLinear = 100, kPeerOptimal };

const Method kMethods[] = {{"Poly", 14, TV_TRIANGULATION_POLY},
                           {"Poly-Abs", 30, TV_TRIANGULATION_POLY_ABS},
                           {"Linear-Eigen", 3, TV_TRIANGULATION_LINEAR_EIGEN},
                           {"Linear-LS", 2, TV_TRIANGULATION_LINEAR_LS},
                           {"Iterative-Eigen", 5, TV_TRIANGULATION_ITERATIVE_EIGEN},
                           {"Iterative-LS", 3, TV_TRIANGULATION_ITERATIVE_LS},
                           {"Midpoint", 2, TV_TRIANGULATION_MIDPOINT},
#ifdef BENCH_HAS_OPENCV
                           {"OpenCV triangulatePoints", 0, kPeerLinear},
                           {"OpenCV correctMatches + triangulatePoints", 0, kPeerOptimal},
#endif
};
constexpr int kNumMethods = sizeof kMethods / sizeof kMethods[0];

const double kNoisePx[] = {0.1, 0.5, 1, 2};
const char* const kGeometries[] = {"sideways", "forward", "converging"};

struct Scene {
  tv_camera camera;
  double R[9], t[3];
  std::vector<double> points;     // truth, in camera 0
  std::vector<double> exact[2];   // pixels without noise
  std::vector<double> pixels[2];
  int size() const { return static_cast<int>(points.size() / 3); }
};

// 640x480, f = 500, |t| = 1. Sideways and forward: 4 to 20 baselines away. Converging: cameras that
// look at the same place 1.2 baselines away from 45 degrees apart.
Scene make_scene(int geometry, double noise_px, int num_points) {
  Scene scene{};
  scene.camera.model = TV_CAMERA_PINHOLE;
  scene.camera.width = 640, scene.camera.height = 480;
  scene.camera.fx = scene.camera.fy = 500, scene.camera.cx = 319.5, scene.camera.cy = 239.5;
  const double angle = geometry == 2 ? 0.785398163397448 : 0.0;
  const double c = std::cos(angle), s = std::sin(angle);
  const double R[9] = {c, 0, s, 0, 1, 0, -s, 0, c};
  std::memcpy(scene.R, R, sizeof R);
  const double center[3][3] = {{1, 0, 0}, {0, 0, 1}, {0.9238795325112867, 0, 0.3826834323650898}};
  for (int i = 0; i < 3; ++i) {
    scene.t[i] = 0;
    for (int k = 0; k < 3; ++k) scene.t[i] -= R[3 * i + k] * center[geometry][k];
  }
  std::mt19937_64 random(7);
  std::uniform_real_distribution<double> uniform(0, 1);
  std::normal_distribution<double> normal(0, noise_px);
  while (scene.size() < num_points) {
    const double depth = geometry == 2 ? 0.9 + 0.6 * uniform(random) : 4 + 16 * uniform(random);
    const double pixel0[2] = {640 * uniform(random), 480 * uniform(random)};
    const double X[3] = {(pixel0[0] - scene.camera.cx) / 500 * depth,
                         (pixel0[1] - scene.camera.cy) / 500 * depth, depth};
    double Y[3], pixel1[2];
    for (int i = 0; i < 3; ++i) {
      Y[i] = R[3 * i] * X[0] + R[3 * i + 1] * X[1] + R[3 * i + 2] * X[2] + scene.t[i];
    }
    if (tv_camera_project(&scene.camera, Y, pixel1, nullptr) != TV_OK) continue;
    if (pixel1[0] < 0 || pixel1[0] > 640 || pixel1[1] < 0 || pixel1[1] > 480) continue;
    scene.points.insert(scene.points.end(), X, X + 3);
    for (int k = 0; k < 2; ++k) {
      scene.exact[0].push_back(pixel0[k]);
      scene.exact[1].push_back(pixel1[k]);
      scene.pixels[0].push_back(pixel0[k] + normal(random));
      scene.pixels[1].push_back(pixel1[k] + normal(random));
    }
  }
  return scene;
}

#ifdef BENCH_HAS_OPENCV
void triangulate_by_opencv(bool optimal, const Scene& scene, std::vector<tv_point>* points) {
  const int n = scene.size();
  const cv::Matx33d K(500, 0, scene.camera.cx, 0, 500, scene.camera.cy, 0, 0, 1);
  const double *R = scene.R, *t = scene.t;
  const cv::Matx34d P0 = K * cv::Matx34d::eye();
  const cv::Matx34d P1 = K * cv::Matx34d(R[0], R[1], R[2], t[0], R[3], R[4], R[5], t[1], R[6],
                                         R[7], R[8], t[2]);
  cv::Mat x0(1, n, CV_64FC2, const_cast<double*>(scene.pixels[0].data()));
  cv::Mat x1(1, n, CV_64FC2, const_cast<double*>(scene.pixels[1].data()));
  if (optimal) {
    const cv::Matx33d skew(0, -t[2], t[1], t[2], 0, -t[0], -t[1], t[0], 0);
    const cv::Matx33d F = K.inv().t() * skew * cv::Matx33d(R) * K.inv();
    cv::Mat y0, y1;
    cv::correctMatches(F, x0, x1, y0, y1);
    x0 = y0, x1 = y1;
  }
  cv::Mat X;
  cv::triangulatePoints(P0, P1, x0, x1, X);
  for (int i = 0; i < n; ++i) {
    const double w = X.at<double>(3, i);
    double* position = (*points)[static_cast<size_t>(i)].position;
    for (int k = 0; k < 3; ++k) position[k] = X.at<double>(k, i) / w;
  }
}
#endif

void triangulate(int method, const Scene& scene, std::vector<tv_point>* points) {
#ifdef BENCH_HAS_OPENCV
  if (method >= kPeerLinear) return triangulate_by_opencv(method == kPeerOptimal, scene, points);
#endif
  if (tv_triangulate(static_cast<tv_triangulation>(method), &scene.camera, &scene.camera, scene.R,
                     scene.t, scene.pixels[0].data(), scene.pixels[1].data(), scene.size(),
                     points->data()) != TV_OK) {
    std::fprintf(stderr, "tv_triangulate failed\n");
    std::exit(1);
  }
}

struct Errors {
  double cost_px;   // root mean square distance to the given pixels, of points before both cameras
  double truth_px;  // and to those without noise
  double percent_50, percent_95;  // the error in space, of the distance from camera 0, of all
  double percent_behind;          // points that a camera does not see
};

Errors errors_of(const Scene& scene, const std::vector<tv_point>& points) {
  double cost = 0, truth = 0;
  int seen = 0;
  std::vector<double> percent;
  for (size_t i = 0; i < points.size(); ++i) {
    const double* X = points[i].position;
    const double* T = &scene.points[3 * i];
    double Y[3], off = 0, range = 0;
    for (int k = 0; k < 3; ++k) {
      Y[k] = scene.R[3 * k] * X[0] + scene.R[3 * k + 1] * X[1] + scene.R[3 * k + 2] * X[2] +
             scene.t[k];
      off += (X[k] - T[k]) * (X[k] - T[k]);
      range += T[k] * T[k];
    }
    percent.push_back(100 * std::sqrt(off / range));
    double pixels[2][2];
    if (tv_camera_project(&scene.camera, X, pixels[0], nullptr) != TV_OK) continue;
    if (tv_camera_project(&scene.camera, Y, pixels[1], nullptr) != TV_OK) continue;
    ++seen;
    for (size_t image = 0; image < 2; ++image) {
      for (size_t k = 0; k < 2; ++k) {
        const double c = pixels[image][k] - scene.pixels[image][2 * i + k];
        const double e = pixels[image][k] - scene.exact[image][2 * i + k];
        cost += c * c;
        truth += e * e;
      }
    }
  }
  std::sort(percent.begin(), percent.end());
  const double n = static_cast<double>(points.size());
  return Errors{std::sqrt(cost / (2 * seen)), std::sqrt(truth / (2 * seen)),
                percent[percent.size() / 2], percent[percent.size() * 95 / 100],
                100 * (n - seen) / n};
}

// Nanoseconds a point: the median of several rounds over all geometries, and its spread.
struct Time {
  double median, least, most;
};

std::vector<Time> measure(const std::vector<Scene>& scenes) {
  constexpr int kRounds = 21;
  std::vector<std::vector<double>> rounds(kNumMethods);
  std::vector<tv_point> points(static_cast<size_t>(scenes[0].size()));
  for (int round = 0; round < kRounds; ++round) {
    for (int m = 0; m < kNumMethods; ++m) {  // turn by turn: all see the same machine
      double sum = 0;
      for (const Scene& scene : scenes) {
        const auto start = std::chrono::steady_clock::now();
        triangulate(kMethods[m].method, scene, &points);
        sum += std::chrono::duration<double, std::nano>(std::chrono::steady_clock::now() - start)
                   .count() /
               scene.size();
      }
      rounds[static_cast<size_t>(m)].push_back(sum / static_cast<double>(scenes.size()));
    }
  }
  std::vector<Time> times;
  for (std::vector<double>& r : rounds) {
    std::sort(r.begin(), r.end());
    times.push_back(Time{r[kRounds / 2], r.front(), r.back()});
  }
  return times;
}

double peer_time(const std::vector<Time>& times, int method) {
  const int peer = method == TV_TRIANGULATION_POLY || method == TV_TRIANGULATION_POLY_ABS
                       ? kPeerOptimal
                       : kPeerLinear;
  for (int m = 0; m < kNumMethods; ++m) {
    if (kMethods[m].method == peer) return times[static_cast<size_t>(m)].median;
  }
  return 0;
}

void print_times(const std::vector<Time>& times, bool json) {
  const double midpoint = times[6].median;
  if (!json) {
    std::printf("| method | the paper's time | ours, Midpoint as 2 | ns a point | least to most |\n"
                "| --- | --- | --- | --- | --- |\n");
  }
  for (int m = 0; m < kNumMethods; ++m) {
    const Time& t = times[static_cast<size_t>(m)];
    const char* end = m + 1 < kNumMethods ? "," : "";
    if (!json) {
      char paper[16] = "";
      if (kMethods[m].paper > 0) std::snprintf(paper, sizeof paper, "%g", kMethods[m].paper);
      std::printf("| %s | %s | %.1f | %.0f | %.0f to %.0f |\n", kMethods[m].name, paper,
                  2 * t.median / midpoint, t.median, t.least, t.most);
      continue;
    }
    const double peer = kMethods[m].method < kPeerLinear ? peer_time(times, kMethods[m].method) : 0;
    std::printf("    {\"stage\": \"triangulate\", \"case\": \"%s\", \"ours\": %.1f, ",
                kMethods[m].name, t.median);
    if (peer > 0) {
      std::printf("\"peer\": %.1f, \"peer_name\": \"%s\", \"ratio\": %.3f, ", peer,
                  kMethods[m].paper >= 14 ? "OpenCV correctMatches + triangulatePoints"
                                          : "OpenCV triangulatePoints",
                  peer / t.median);
    } else {
      std::printf("\"peer\": null, \"peer_name\": null, \"ratio\": null, ");
    }
    std::printf("\"unit\": \"ns/point\", \"paper_relative\": %g, \"relative\": %.2f}%s\n",
                kMethods[m].paper, 2 * t.median / midpoint, end);
  }
}

void print_errors(int num_points, bool json) {
  std::vector<tv_point> points(static_cast<size_t>(num_points));
  bool first = true;
  for (int g = 0; g < 3; ++g) {
    if (!json) {
      std::printf("\n**%s**: pixels to the measured / to the true pixels (rms), space 50 %% / 95 %%"
                  " of points (per cent of the distance), points behind a camera (per cent)\n\n"
                  "| method |",
                  kGeometries[g]);
      for (double noise : kNoisePx) std::printf(" %g px |", noise);
      std::printf("\n| --- | --- | --- | --- | --- |\n");
    }
    std::vector<Scene> scenes;
    for (double noise : kNoisePx) scenes.push_back(make_scene(g, noise, num_points));
    for (const Method& method : kMethods) {
      if (!json) std::printf("| %s |", method.name);
      for (size_t i = 0; i < scenes.size(); ++i) {
        triangulate(method.method, scenes[i], &points);
        const Errors e = errors_of(scenes[i], points);
        if (json) {
          std::printf("%s    {\"geometry\": \"%s\", \"noise_px\": %g, \"method\": \"%s\", "
                      "\"cost_px\": %.6f, \"truth_px\": %.6f, \"space_percent_50\": %.5f, "
                      "\"space_percent_95\": %.5f, \"behind_percent\": %.3f}",
                      first ? "" : ",\n", kGeometries[g], kNoisePx[i], method.name, e.cost_px,
                      e.truth_px, e.percent_50, e.percent_95, e.percent_behind);
          first = false;
        } else {
          std::printf(" %.4f / %.4f, %.3f / %.2f, %.2f |", e.cost_px, e.truth_px, e.percent_50,
                      e.percent_95, e.percent_behind);
        }
      }
      if (!json) std::printf("\n");
    }
  }
}

}  // namespace

int main(int argc, char** argv) {
  bool json = false;
  int num_points = 20000;
  for (int i = 1; i < argc; ++i) {
    if (!std::strcmp(argv[i], "--json")) {
      json = true;
    } else if (!std::strcmp(argv[i], "--points") && i + 1 < argc && std::atoi(argv[i + 1]) > 19) {
      num_points = std::atoi(argv[++i]);
    } else {
      std::fprintf(stderr, "usage: bench_triangulation [--json] [--points N], N at least 20\n");
      return 2;
    }
  }
  std::vector<Scene> scenes;
  for (int g = 0; g < 3; ++g) scenes.push_back(make_scene(g, 1.0, num_points));
  const std::vector<Time> times = measure(scenes);
  if (json) std::printf("{\n  \"rows\": [\n");
  print_times(times, json);
  if (json) std::printf("  ],\n  \"errors\": [\n");
  print_errors(num_points, json);
  if (json) std::printf("\n  ]\n}\n");
  return 0;
}
