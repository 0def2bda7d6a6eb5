// Triangulation on rays. Problem, derivation and valid range: docs/algorithms/triangulation.md;
// test: test/unit/test_triangulation.cc, test_triangulation_opencv.cc.
#include "triangulation/triangulation.h"

#include <limits>

#include "base/math.h"
#include "kernels/kernels.h"
#include "triangulation/linear.h"
#include "twoview/context.h"

namespace tv {
namespace {

constexpr double kMaxFloat = std::numeric_limits<float>::max();

float to_float(double x) { return static_cast<float>(x < kMaxFloat ? x : kMaxFloat); }

// Two rays, the second turned into camera 0's frame.
struct Rays {
  Vec3 ray0, ray1_in_0;
  Vec3 normal;  // ray0 x ray1_in_0
  double normal_sq;
};

Rays rays_between(const TriangulationPair& pair, const Vec3& ray0, const Vec3& ray1) {
  Rays rays{ray0, rotate(pair.cam0_from_cam1_R, ray1), Vec3(), 0.0};
  rays.normal = cross(rays.ray0, rays.ray1_in_0);
  rays.normal_sq = dot(rays.normal, rays.normal);
  return rays;
}

// ---- Midpoint ----

// Where the two lines are nearest to each other, in units of the rays, for a baseline of 1.
void closest_distances(const TriangulationPair& pair, const Rays& rays, double* along0,
                       double* along1) {
  *along0 = dot(cross(pair.center1, rays.ray1_in_0), rays.normal) / rays.normal_sq;
  *along1 = dot(cross(pair.center1, rays.ray0), rays.normal) / rays.normal_sq;
}

Vec3 midpoint(const TriangulationPair& pair, const Rays& rays, double along0, double along1) {
  const Vec3 sum = combine(along0, rays.ray0, along1, rays.ray1_in_0);
  return combine(0.5, sum, 0.5, pair.center1);
}

// ---- Poly and Poly-Abs ----

Vec3 solve_corrected(const TriangulationPair& pair, const Correction& correction) {
  const Rays rays = rays_between(pair, correction.ray[0], correction.ray[1]);
  double along0, along1;
  closest_distances(pair, rays, &along0, &along1);
  return midpoint(pair, rays, along0, along1);
}

// ---- the fields of a point ----

// Squared distance in pixels between a pixel and the projection of a point in the camera's frame. A
// point behind is projected through the centre. If the lens model does not see the point, the error
// is the angle between it and the pixel's ray, times the focal length sqrt(fx fy).
double error_sq_px(const Camera& camera, const Vec3& ray, const Vec2& pixel, const Vec3& point) {
  const double along = dot(ray, point);
  const Vec3 ahead = along < 0.0 ? Vec3(-point[0], -point[1], -point[2]) : point;
  Vec2 seen;
  if (project(camera, ahead, &seen, nullptr)) {
    const double dx = seen[0] - pixel[0];
    const double dy = seen[1] - pixel[1];
    return dx * dx + dy * dy;
  }
  const Vec3 across = cross(ray, ahead);
  const double angle = atan2(std::sqrt(dot(across, across)), std::fabs(along));
  return angle * angle * camera.model.fx * camera.model.fy;
}

// The two pixels of a match and their rays.
struct Match {
  Vec3 ray0, ray1;
  Vec2 pixel0, pixel1;
};

float error_px(const TriangulationPair& pair, const Match& match, const Vec3& point0,
               const Vec3& point1) {
  const double sum = error_sq_px(*pair.cameras[0], match.ray0, match.pixel0, point0) +
                     error_sq_px(*pair.cameras[1], match.ray1, match.pixel1, point1);
  return sum >= 0.0 ? to_float(std::sqrt(0.5 * sum)) : 0.0f;
}

void write_point(tv_point_status status, const Vec3& position, double angle, float error,
                 tv_point* point) {
  *point = tv_point{};
  for (int i = 0; i < 3; ++i) point->position[i] = position[i];
  point->angle_rad = static_cast<float>(angle);
  point->error_px = error;
  point->status = status;
}

void write_invalid(tv_point* point) {
  write_point(TV_POINT_INVALID, Vec3(0.0, 0.0, 0.0), 0.0, 0.0f, point);
}

void write_infinite(const TriangulationPair& pair, const Match& match, double angle,
                    tv_point* point) {
  const Vec3 turned = rotate(pair.cam1_from_cam0_R, match.ray0);
  write_point(TV_POINT_INFINITE, match.ray0, angle, error_px(pair, match, match.ray0, turned),
              point);
}

// The method's point for a baseline of 1. It is not finite where that point is at infinity.
Vec3 solve(tv_triangulation method, const TriangulationPair& pair, const Match& match,
           const Vec3& midpoint_of_rays) {
  if (method == TV_TRIANGULATION_MIDPOINT) return midpoint_of_rays;
  const RayFrame frame0 = frame_of(*pair.cameras[0], match.ray0);
  const RayFrame frame1 = frame_of(*pair.cameras[1], match.ray1);
  switch (method) {
    case TV_TRIANGULATION_POLY:
    case TV_TRIANGULATION_POLY_ABS:
      return solve_corrected(pair, correct_match(method, pair, frame0, frame1));
    case TV_TRIANGULATION_LINEAR_EIGEN: return solve_eigen(pair, frame0, frame1, false);
    case TV_TRIANGULATION_ITERATIVE_EIGEN: return solve_eigen(pair, frame0, frame1, true);
    case TV_TRIANGULATION_LINEAR_LS: return solve_least_squares(pair, frame0, frame1, false);
    default: return solve_least_squares(pair, frame0, frame1, true);
  }
}

// Whether the kernel `triangulate` supports this method and these cameras.
bool in_lanes(tv_triangulation method, const TriangulationPair& pair) {
  return (method == TV_TRIANGULATION_MIDPOINT || method == TV_TRIANGULATION_LINEAR_LS ||
          method == TV_TRIANGULATION_ITERATIVE_LS) &&
         pair.cameras[0]->model.model == TV_CAMERA_PINHOLE &&
         pair.cameras[1]->model.model == TV_CAMERA_PINHOLE;
}

tvk_triangulate_pair kernel_pair(const TriangulationPair& pair) {
  tvk_triangulate_pair p;
  for (int v = 0; v < 2; ++v) {
    const tv_camera& camera = pair.cameras[v]->model;
    const double focal[2] = {camera.fx, camera.fy}, principal[2] = {camera.cx, camera.cy};
    for (int k = 0; k < 2; ++k) {
      p.focal[2 * v + k] = focal[k];
      p.inverse_focal[2 * v + k] = 1.0 / focal[k];
      p.principal[2 * v + k] = principal[k];
    }
  }
  write_matrix(pair.cam1_from_cam0_R, p.R);
  for (int k = 0; k < 3; ++k) {
    p.direction[k] = pair.direction[k];
    p.center1[k] = pair.center1[k];
  }
  p.baseline = pair.baseline;
  p.parallel_sine_sq = kParallelSine * kParallelSine;
  return p;
}

// Writes the kernel's points. Returns whether any of them has the status -1, which means that
// triangulate_point must compute it.
bool kernel_leaves_some(tv_triangulation method, const TriangulationPair& pair,
                        const double* pixels0, const double* pixels1, size_t num,
                        tv_point* points) {
  constexpr size_t kAtOnce = size_t{1} << 30;  // matches a call: the kernel's count is an int32_t
  const tvk_geometry_table* kernels = tvk_geometry_of(tvk_select(TV_KERNELS_AUTO));
  const tvk_triangulate_pair p = kernel_pair(pair);
  bool leaves = false;
  for (size_t first = 0; first < num; first += kAtOnce) {
    const size_t some = num - first < kAtOnce ? num - first : kAtOnce;
    leaves |= kernels->triangulate(&p, method, pixels0 + 2 * first, pixels1 + 2 * first,
                                   static_cast<int32_t>(some), points + first) != 0;
  }
  return leaves;
}

}  // namespace

bool is_triangulation_method(int method) {
  return method >= TV_TRIANGULATION_POLY && method <= TV_TRIANGULATION_MIDPOINT;
}

TriangulationPair prepare_triangulation(const Camera& camera0, const Camera& camera1, const Mat3& R,
                                        const Vec3& t) {
  TriangulationPair pair;
  pair.cameras[0] = &camera0;
  pair.cameras[1] = &camera1;
  pair.cam1_from_cam0_R = R;
  for (int row = 0; row < 3; ++row) {
    for (int col = 0; col < 3; ++col) pair.cam0_from_cam1_R(row, col) = R(col, row);
  }
  // t is divided by its largest entry first, because the squares of a tiny or a huge t would under-
  // or overflow.
  double largest = 0.0;
  for (int i = 0; i < 3; ++i) largest = std::fabs(t[i]) > largest ? std::fabs(t[i]) : largest;
  const Vec3 scaled(t[0] / largest, t[1] / largest, t[2] / largest);
  const double length = std::sqrt(dot(scaled, scaled));
  pair.direction = Vec3(scaled[0] / length, scaled[1] / length, scaled[2] / length);
  pair.baseline = largest * length;
  const Vec3 center = rotate(pair.cam0_from_cam1_R, pair.direction);
  pair.center1 = Vec3(-center[0], -center[1], -center[2]);
  set_pencil_axes(pair.center1, R, &pair.pencil);
  pair.has_steps = has_image_plane(camera0) && has_image_plane(camera1);
  if (pair.has_steps) {
    // On an image plane the steps are the same for all rays, so that any ray may be given here.
    const Vec3 ahead(0.0, 0.0, 1.0);
    set_pencil_steps(frame_of(camera0, ahead), frame_of(camera1, ahead), &pair.pencil);
  }
  return pair;
}

TriangulationPair prepare_triangulation(const Camera& camera0, const Camera& camera1,
                                        const tv_camera_pair& pair) {
  return prepare_triangulation(camera0, camera1, matrix_of(pair.cam1_from_cam0_R),
                               Vec3(pair.cam1_from_cam0_t));
}

Correction correct_match(tv_triangulation method, const TriangulationPair& pair,
                         const RayFrame& frame0, const RayFrame& frame1) {
  const PixelCost cost =
      method == TV_TRIANGULATION_POLY_ABS ? PixelCost::kSumOfDistances : PixelCost::kSumOfSquares;
  if (pair.has_steps) return correct_rays(cost, pair.pencil, frame0, frame1);
  EpipolarPencil pencil = pair.pencil;
  set_pencil_steps(frame0, frame1, &pencil);
  return correct_rays(cost, pencil, frame0, frame1);
}

bool correct_pixels(tv_triangulation method, const TriangulationPair& pair, const Vec2& pixel0,
                    const Vec2& pixel1, Vec2 corrected[2]) {
  const Camera* const* cameras = pair.cameras;
  Vec3 ray0, ray1;
  if (!unproject(*cameras[0], pixel0, &ray0, nullptr)) return false;
  if (!unproject(*cameras[1], pixel1, &ray1, nullptr)) return false;
  const Correction correction =
      correct_match(method, pair, frame_of(*cameras[0], ray0), frame_of(*cameras[1], ray1));
  const Vec2 pixels[2] = {pixel0, pixel1};
  Vec2 moved[2];
  for (int i = 0; i < 2; ++i) {
    if (!all_finite(correction.ray[i].data(), 3)) return false;
    if (cameras[i]->model.model == TV_CAMERA_PINHOLE) {
      // The step is added to the pixel, because a projection of the corrected ray would add
      // rounding errors.
      moved[i] = Vec2(pixels[i][0] + correction.step[i][0], pixels[i][1] + correction.step[i][1]);
    } else if (!project(*cameras[i], correction.ray[i], &moved[i], nullptr)) {
      return false;
    }
    if (!all_finite(moved[i].data(), 2)) return false;
  }
  corrected[0] = moved[0];
  corrected[1] = moved[1];
  return true;
}

void triangulate_rays(tv_triangulation method, const TriangulationPair& pair, const Vec3& ray0,
                      const Vec3& ray1, const Vec2& pixel0, const Vec2& pixel1, tv_point* point) {
  const Match match{ray0, ray1, pixel0, pixel1};
  const Rays rays = rays_between(pair, ray0, ray1);
  const double cosine = dot(rays.ray0, rays.ray1_in_0);
  const double angle = atan2(std::sqrt(rays.normal_sq), cosine);
  if (!(rays.normal_sq > kParallelSine * kParallelSine)) {
    // Opposed rays do not determine the depth either, but their point is not at infinity.
    if (cosine > 0.0) return write_infinite(pair, match, angle, point);
    return write_invalid(point);
  }
  double along0, along1;
  closest_distances(pair, rays, &along0, &along1);
  const Vec3 position = solve(method, pair, match, midpoint(pair, rays, along0, along1));
  const Vec3 metric(position[0] * pair.baseline, position[1] * pair.baseline,
                    position[2] * pair.baseline);
  if (!all_finite(metric.data(), 3)) return write_infinite(pair, match, angle, point);
  const Vec3 position1 = combine(1.0, rotate(pair.cam1_from_cam0_R, position), 1.0, pair.direction);
  // The two rays decide, so that the status is the same for every method. In addition, the method's
  // own point must lie in front of both cameras.
  const bool in_front =
      along0 > 0.0 && along1 > 0.0 && dot(ray0, position) > 0.0 && dot(ray1, position1) > 0.0;
  write_point(in_front ? TV_POINT_OK : TV_POINT_BEHIND, metric, angle,
              error_px(pair, match, position, position1), point);
}

void triangulate_point(tv_triangulation method, const TriangulationPair& pair, const Vec2& pixel0,
                       const Vec2& pixel1, tv_point* point) {
  Vec3 ray0, ray1;
  if (!unproject(*pair.cameras[0], pixel0, &ray0, nullptr) ||
      !unproject(*pair.cameras[1], pixel1, &ray1, nullptr)) {
    return write_invalid(point);
  }
  triangulate_rays(method, pair, ray0, ray1, pixel0, pixel1, point);
}

void triangulate_points(tv_triangulation method, const TriangulationPair& pair,
                        const double* pixels0, const double* pixels1, size_t num,
                        tv_point* points) {
  const bool lanes = in_lanes(method, pair);
  if (lanes && !kernel_leaves_some(method, pair, pixels0, pixels1, num, points)) return;
  for (size_t i = 0; i < num; ++i) {
    if (lanes && points[i].status >= 0) continue;
    triangulate_point(method, pair, Vec2(pixels0[2 * i], pixels0[2 * i + 1]),
                      Vec2(pixels1[2 * i], pixels1[2 * i + 1]), &points[i]);
  }
}

void triangulate_point(tv_triangulation method, const Camera& camera0, const Camera& camera1,
                       const Mat3& R, const Vec3& t, const Vec2& pixel0, const Vec2& pixel1,
                       tv_point* point) {
  triangulate_point(method, prepare_triangulation(camera0, camera1, R, t), pixel0, pixel1, point);
}

}  // namespace tv
