// Repeats table 1 of the paper (docs/paper.md): the seven methods of triangulation over levels of
// noise and three geometries, and beside them OpenCV's and OpenGV's. Without arguments the times
// are measured, as in the other benchmarks. The errors of our methods and OpenCV's are printed as
// Markdown by
//
//   bench_triangulation --errors [POINTS]
//
// Our functions take pixels and the camera model and also compute angle, error and status of each
// point; the peers take rays, or pixels and projection matrices, and compute only the point.
#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <opencv2/calib3d.hpp>
#include <random>
#include <string>
#include <vector>

#include "bench.h"
#ifdef BENCH_HAS_OPENGV
#include "opengv_peer.h"
#endif

namespace {

struct Method {
  const char* name;
  int method;  // a value of tv_triangulation or of Peer
};

enum Peer { kPeerLinear = 100, kPeerOptimal };

const Method kMethods[] = {
    {"Poly", TV_TRIANGULATION_POLY},
    {"Poly-Abs", TV_TRIANGULATION_POLY_ABS},
    {"Linear-Eigen", TV_TRIANGULATION_LINEAR_EIGEN},
    {"Linear-LS", TV_TRIANGULATION_LINEAR_LS},
    {"Iterative-Eigen", TV_TRIANGULATION_ITERATIVE_EIGEN},
    {"Iterative-LS", TV_TRIANGULATION_ITERATIVE_LS},
    {"Midpoint", TV_TRIANGULATION_MIDPOINT},
    {"OpenCV " CV_VERSION " triangulatePoints", kPeerLinear},
    {"OpenCV " CV_VERSION " correctMatches + triangulatePoints", kPeerOptimal}};

const double kNoisePx[] = {0.1, 0.5, 1, 2};
const char* const kGeometries[] = {"sideways", "forward", "converging"};

struct Scene {
  tv_camera camera;
  double R[9], t[3];
  std::vector<double> points;    // true positions in camera 0's frame
  std::vector<double> exact[2];  // x y of each point without noise
  std::vector<double> pixels[2];
  int size() const { return static_cast<int>(points.size() / 3); }
};

// Cameras of 640x480 pixels with f = 500 and |t| = 1. Sideways and forward: the points have depths
// of 4 to 20 baselines in camera 0. Converging: the optical axes cross 1.31 baselines away at an
// angle of 45 degrees, and the points have depths of 0.9 to 1.5 baselines.
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

void triangulate_by_opencv(bool optimal, const Scene& scene, std::vector<tv_point>* points) {
  const int n = scene.size();
  const cv::Matx33d K(500, 0, scene.camera.cx, 0, 500, scene.camera.cy, 0, 0, 1);
  const double *R = scene.R, *t = scene.t;
  const cv::Matx34d P0 = K * cv::Matx34d::eye();
  const cv::Matx34d P1 =
      K * cv::Matx34d(R[0], R[1], R[2], t[0], R[3], R[4], R[5], t[1], R[6], R[7], R[8], t[2]);
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

void triangulate(int method, const Scene& scene, std::vector<tv_point>* points) {
  if (method >= kPeerLinear) return triangulate_by_opencv(method == kPeerOptimal, scene, points);
  tv_camera_pair pair{scene.camera, scene.camera, {}, {}};
  std::copy(scene.R, scene.R + 9, pair.cam1_from_cam0_R);
  std::copy(scene.t, scene.t + 3, pair.cam1_from_cam0_t);
  tv_pixel_pairs pixels;
  tv_pixel_pairs_init(&pixels);
  pixels.num = scene.size();
  pixels.pixels0 = scene.pixels[0].data();
  pixels.pixels1 = scene.pixels[1].data();
  bench::require(
      tv_triangulate(&pair, &pixels, static_cast<tv_triangulation>(method), points->data()),
      "tv_triangulate");
}

struct Errors {
  // Root mean square distances between the projections of the points that both cameras see and the
  // given pixels (cost_px), or the pixels without noise (truth_px).
  double cost_px;
  double truth_px;
  // Quantiles over all points: the error of the position in per cent of the distance from camera 0.
  double percent_50, percent_95;
  double percent_behind;  // share of the points that are behind a camera, per cent
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

// Prints a table of errors in Markdown for each geometry.
void print_errors(int num_points) {
  std::vector<tv_point> points(static_cast<size_t>(num_points));
  for (int g = 0; g < 3; ++g) {
    std::printf(
        "\n**%s**: pixels to the measured / to the true pixels (rms), space 50 %% / 95 %%"
        " of points (per cent of the distance), points behind a camera (per cent)\n\n"
        "| method |",
        kGeometries[g]);
    for (double noise : kNoisePx) std::printf(" %g px |", noise);
    std::printf("\n| --- | --- | --- | --- | --- |\n");
    for (const Method& method : kMethods) {
      std::printf("| %s |", method.name);
      for (double noise : kNoisePx) {
        const Scene scene = make_scene(g, noise, num_points);
        triangulate(method.method, scene, &points);
        const Errors e = errors_of(scene, points);
        std::printf(" %.4f / %.4f, %.3f / %.2f, %.2f |", e.cost_px, e.truth_px, e.percent_50,
                    e.percent_95, e.percent_behind);
      }
      std::printf("\n");
    }
  }
}

constexpr int kTimedPoints = 1000;  // number of points in each geometry

using Scenes = std::shared_ptr<std::vector<Scene>>;

// Adds a timed row. It reports the error in the sideways scene, as a check of the result.
void add_method(const std::string& name, const Scenes& scenes, int method) {
  const auto points = std::make_shared<std::vector<tv_point>>(kTimedPoints);
  bench::add({name,
              [=] {
                for (const Scene& scene : *scenes) triangulate(method, scene, points.get());
              },
              [=] {
                triangulate(method, scenes->front(), points.get());
                const Errors errors = errors_of(scenes->front(), *points);
                return bench::Counters{{"cost_px", errors.cost_px}};
              },
              3.0 * kTimedPoints});
}

#ifdef BENCH_HAS_OPENGV
std::vector<double> unit_rays(const Scene& scene, int view) {
  std::vector<double> rays(static_cast<size_t>(3 * scene.size()));
  for (size_t k = 0; k < static_cast<size_t>(scene.size()); ++k) {
    bench::require(
        tv_camera_unproject(&scene.camera, &scene.pixels[view][2 * k], &rays[3 * k], nullptr),
        "tv_camera_unproject");
  }
  return rays;
}

void add_opengv(const std::string& name, const Scenes& scenes, bench::OpengvTriangulation method) {
  std::vector<std::shared_ptr<bench::OpengvMatches>> matches;
  for (const Scene& scene : *scenes) {
    matches.push_back(
        std::make_shared<bench::OpengvMatches>(unit_rays(scene, 0), unit_rays(scene, 1)));
    matches.back()->set_pose(scene.R, scene.t);
  }
  const auto positions = std::make_shared<std::vector<double>>(3 * kTimedPoints);
  const auto triangulate_all = [=] {
    for (const auto& m : matches) m->triangulate(method, positions->data());
  };
  const auto found = [=] {
    matches.front()->triangulate(method, positions->data());
    std::vector<tv_point> points(kTimedPoints);
    for (size_t k = 0; k < positions->size(); ++k) points[k / 3].position[k % 3] = (*positions)[k];
    return bench::Counters{{"cost_px", errors_of(scenes->front(), points).cost_px}};
  };
  bench::add({name, triangulate_all, found, 3.0 * kTimedPoints});
}
#endif

void add_peers(const std::string& name, const Scenes& scenes, int method) {
  const bool optimal = method == TV_TRIANGULATION_POLY || method == TV_TRIANGULATION_POLY_ABS;
  const Method& opencv = kMethods[optimal ? 8 : 7];
  if (method != TV_TRIANGULATION_MIDPOINT) {
    add_method(name + "/" + opencv.name, scenes, opencv.method);
  }
  if (optimal) return;
#ifdef BENCH_HAS_OPENGV
  const bool midpoint = method == TV_TRIANGULATION_MIDPOINT;
  add_opengv(
      name + "/" + bench::kOpengvName + (midpoint ? " triangulate2" : " triangulate"), scenes,
      midpoint ? bench::OpengvTriangulation::kMidpoint : bench::OpengvTriangulation::kLinear);
#else
  bench::add_missing(name + "/OpenGV");
#endif
}

}  // namespace

int main(int argc, char** argv) {
  if (argc > 1 && !std::strcmp(argv[1], "--errors")) {
    const int num_points = argc > 2 ? std::atoi(argv[2]) : 20000;
    if (num_points < 20) {
      std::fprintf(stderr, "usage: bench_triangulation --errors [POINTS, at least 20]\n");
      return 2;
    }
    print_errors(num_points);
    return 0;
  }
  const auto scenes = std::make_shared<std::vector<Scene>>();
  for (int g = 0; g < 3; ++g) scenes->push_back(make_scene(g, 1.0, kTimedPoints));
  for (const Method& method : kMethods) {
    if (method.method >= kPeerLinear) continue;
    const std::string name = std::string("triangulate/") + method.name;
    add_method(bench::ours(name), scenes, method.method);
    add_peers(name, scenes, method.method);
  }
  return bench::run(argc, argv);
}
