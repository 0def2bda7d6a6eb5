// Triangulation on rays. Problem, derivation and valid range: docs/algorithms/triangulation.md;
// test: test/unit/test_triangulation.cc, test_triangulation_opencv.cc.
#include "geometry/triangulation.h"

#include <cmath>
#include <limits>

#include "base/math.h"

namespace tv {
namespace {

constexpr int kMaxReweightings = 10;  // Hartley & Sturm's bound
constexpr double kSettled = 1e-10;    // relative change of both depths that ends the reweighting
constexpr double kMaxFloat = std::numeric_limits<float>::max();

// Written out: Eigen's sums are free to change their order with its version.
double dot(const Vec3& a, const Vec3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

Vec3 cross(const Vec3& a, const Vec3& b) {
  return Vec3(a[1] * b[2] - a[2] * b[1], a[2] * b[0] - a[0] * b[2], a[0] * b[1] - a[1] * b[0]);
}

Vec3 rotate(const Mat3& R, const Vec3& v) {
  return Vec3(R(0, 0) * v[0] + R(0, 1) * v[1] + R(0, 2) * v[2],
              R(1, 0) * v[0] + R(1, 1) * v[1] + R(1, 2) * v[2],
              R(2, 0) * v[0] + R(2, 1) * v[1] + R(2, 2) * v[2]);
}

Vec3 combine(double a, const Vec3& u, double b, const Vec3& v) {
  return Vec3(a * u[0] + b * v[0], a * u[1] + b * v[1], a * u[2] + b * v[2]);
}

bool is_finite(double x) { return std::fabs(x) < std::numeric_limits<double>::infinity(); }

bool is_finite(const Vec3& v) { return is_finite(v[0]) && is_finite(v[1]) && is_finite(v[2]); }

float to_float(double x) { return static_cast<float>(x < kMaxFloat ? x : kMaxFloat); }

// What the methods work on: two unit rays, the second also turned into camera 0's frame.
struct Rays {
  Vec3 ray0, ray1;
  Vec3 ray1_in_0;
  Vec3 normal;  // ray0 x ray1_in_0
  double sine_sq, cosine;
};

// ---- Midpoint ----

// Signed distances along the rays of the two lines' closest points, for a baseline of 1.
void closest_distances(const TriangulationPair& pair, const Rays& rays, double* along0,
                       double* along1) {
  *along0 = dot(cross(pair.center1, rays.ray1_in_0), rays.normal) / rays.sine_sq;
  *along1 = dot(cross(pair.center1, rays.ray0), rays.normal) / rays.sine_sq;
}

Vec3 midpoint(const TriangulationPair& pair, const Rays& rays, double along0, double along1) {
  const Vec3 sum = combine(along0, rays.ray0, along1, rays.ray1_in_0);
  return combine(0.5, sum, 0.5, pair.center1);
}

// ---- Linear-LS and Iterative-LS ----
//
// Each camera gives two equations n . X = 0 whose vectors n are orthogonal to its ray. On the image
// plane they are Hartley & Sturm's u p3 - p1 and v p3 - p2, in pixels of the undistorted image; for
// a camera that sees beyond a half space, where that plane does not exist, they are two directions
// of the plane tangent to the viewing sphere at the ray. With X = depth ray0 + across . basis, the
// equations of camera 0 read across = 0, those of camera 1 A across + m depth + b = 0, and least
// squares over (across, depth) with row weights comes down to one division for the depth. No normal
// matrix in X is formed: its condition grows with the square of the depth, this one's does not.
struct RayFrame {
  Vec3 ray;       // of depth 1: z = 1 on the image plane, a unit vector on the sphere
  Vec3 rows[2];   // n, so that n . ray = 0
  Vec3 basis[2];  // of the plane of equal depth: -rows[i] . basis[j] = (i == j)
  Vec3 depth;     // depth of X is depth . X
  double inverse_focal_sq[2];  // of a row's unit, in radians per pixel, squared
};

RayFrame image_plane_frame(const tv_camera& model, const Vec3& ray) {
  const double x = ray[0] / ray[2];
  const double y = ray[1] / ray[2];
  return RayFrame{Vec3(x, y, 1.0),
                  {Vec3(-1.0, 0.0, x), Vec3(0.0, -1.0, y)},
                  {Vec3(1.0, 0.0, 0.0), Vec3(0.0, 1.0, 0.0)},
                  Vec3(0.0, 0.0, 1.0),
                  {1.0 / (model.fx * model.fx), 1.0 / (model.fy * model.fy)}};
}

RayFrame sphere_frame(const tv_camera& model, const Vec3& ray) {
  // The axis that is farthest from the ray starts the basis.
  const double size[3] = {std::fabs(ray[0]), std::fabs(ray[1]), std::fabs(ray[2])};
  Vec3 axis(1.0, 0.0, 0.0);
  if (size[1] < size[0] && size[1] <= size[2]) axis = Vec3(0.0, 1.0, 0.0);
  if (size[2] < size[0] && size[2] < size[1]) axis = Vec3(0.0, 0.0, 1.0);
  const Vec3 side = cross(ray, axis);
  const double scale = 1.0 / std::sqrt(dot(side, side));
  const Vec3 u(side[0] * scale, side[1] * scale, side[2] * scale);
  const Vec3 v = cross(ray, u);
  const double inverse = 1.0 / (model.fx * model.fy);
  return RayFrame{ray, {Vec3(-u[0], -u[1], -u[2]), Vec3(-v[0], -v[1], -v[2])}, {u, v}, ray,
                  {inverse, inverse}};
}

RayFrame frame_of(const Camera& camera, const Vec3& ray) {
  return camera.model.model == TV_CAMERA_KANNALA_BRANDT ? sphere_frame(camera.model, ray)
                                                         : image_plane_frame(camera.model, ray);
}

// Camera 1's two equations in camera 0's unknowns.
struct LinearSystem {
  double A[2][2], m[2], b[2];
  double cov0[3], cov1[3];  // xx, xy, yy of the residuals' covariance at unit weights
  Vec3 depth1_of;           // depth in camera 1 = depth1_of . X + depth1_of_t
  double depth1_of_t;
};

LinearSystem linear_system(const TriangulationPair& pair, const RayFrame& frame0,
                           const RayFrame& frame1) {
  LinearSystem s;
  for (int row = 0; row < 2; ++row) {
    const Vec3 n = rotate(pair.cam0_from_cam1_R, frame1.rows[row]);
    s.A[row][0] = dot(n, frame0.basis[0]);
    s.A[row][1] = dot(n, frame0.basis[1]);
    s.m[row] = dot(n, frame0.ray);
    s.b[row] = dot(frame1.rows[row], pair.direction);
  }
  const double* f0 = frame0.inverse_focal_sq;
  s.cov0[0] = s.A[0][0] * s.A[0][0] * f0[0] + s.A[0][1] * s.A[0][1] * f0[1];
  s.cov0[1] = s.A[0][0] * s.A[1][0] * f0[0] + s.A[0][1] * s.A[1][1] * f0[1];
  s.cov0[2] = s.A[1][0] * s.A[1][0] * f0[0] + s.A[1][1] * s.A[1][1] * f0[1];
  s.cov1[0] = frame1.inverse_focal_sq[0];
  s.cov1[1] = 0.0;
  s.cov1[2] = frame1.inverse_focal_sq[1];
  s.depth1_of = rotate(pair.cam0_from_cam1_R, frame1.depth);
  s.depth1_of_t = dot(frame1.depth, pair.direction);
  return s;
}

// Least squares with the equations of camera i weighted by 1 / depth_i: the residuals m depth + b
// have the covariance C = depth0^2 cov0 + depth1^2 cov1, so depth = -(m C^-1 b) / (m C^-1 m), and
// what is left over, moved into camera 0's image by A, is `across`. C^-1 is used without its
// determinant where only a ratio counts.
struct Solution {
  double depth0, depth1;
  Vec3 position;
};

Solution solve_weighted(const LinearSystem& s, const RayFrame& frame0, double weight0_sq,
                        double weight1_sq) {
  const double xx = weight0_sq * s.cov0[0] + weight1_sq * s.cov1[0];
  const double xy = weight0_sq * s.cov0[1] + weight1_sq * s.cov1[1];
  const double yy = weight0_sq * s.cov0[2] + weight1_sq * s.cov1[2];
  const double m0 = yy * s.m[0] - xy * s.m[1];  // C^-1 m times det C
  const double m1 = xx * s.m[1] - xy * s.m[0];
  Solution out;
  out.depth0 = -(m0 * s.b[0] + m1 * s.b[1]) / (m0 * s.m[0] + m1 * s.m[1]);
  const double e0 = s.m[0] * out.depth0 + s.b[0];
  const double e1 = s.m[1] * out.depth0 + s.b[1];
  const double factor = -weight0_sq / (xx * yy - xy * xy);
  const double r0 = factor * (yy * e0 - xy * e1);
  const double r1 = factor * (xx * e1 - xy * e0);
  const double across0 = frame0.inverse_focal_sq[0] * (s.A[0][0] * r0 + s.A[1][0] * r1);
  const double across1 = frame0.inverse_focal_sq[1] * (s.A[0][1] * r0 + s.A[1][1] * r1);
  const Vec3 across = combine(across0, frame0.basis[0], across1, frame0.basis[1]);
  out.position = combine(out.depth0, frame0.ray, 1.0, across);
  out.depth1 = dot(s.depth1_of, out.position) + s.depth1_of_t;
  return out;
}

bool has_settled(const Solution& now, const Solution& before) {
  return std::fabs(now.depth0 - before.depth0) <= kSettled * std::fabs(now.depth0) &&
         std::fabs(now.depth1 - before.depth1) <= kSettled * std::fabs(now.depth1);
}

Vec3 solve_least_squares(const TriangulationPair& pair, const Rays& rays, int max_reweightings) {
  const RayFrame frame0 = frame_of(*pair.cameras[0], rays.ray0);
  const RayFrame frame1 = frame_of(*pair.cameras[1], rays.ray1);
  const LinearSystem system = linear_system(pair, frame0, frame1);
  const Solution linear = solve_weighted(system, frame0, 1.0, 1.0);
  Solution before = linear;
  for (int i = 0; i < max_reweightings; ++i) {
    // Only the weights' ratio counts: the larger is 1, and squares stay far from overflow.
    const double size0 = std::fabs(before.depth0);
    const double size1 = std::fabs(before.depth1);
    const double largest = size0 > size1 ? size0 : size1;
    const double w0 = size0 / largest;
    const double w1 = size1 / largest;
    const Solution now = solve_weighted(system, frame0, w0 * w0, w1 * w1);
    if (has_settled(now, before)) return now.position;
    before = now;
  }
  return linear.position;
}

// ---- what is said about a point ----

// Squared distance in pixels between a pixel and the projection of a point in the camera's frame. A
// point behind is projected through the centre. Where the lens model cannot see it at all: the
// angle off the pixel's ray, times the focal length.
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

float error_px(const TriangulationPair& pair, const Rays& rays, const Vec2& pixel0,
               const Vec2& pixel1, const Vec3& point0, const Vec3& point1) {
  const double sum = error_sq_px(*pair.cameras[0], rays.ray0, pixel0, point0) +
                     error_sq_px(*pair.cameras[1], rays.ray1, pixel1, point1);
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

void write_infinite(const TriangulationPair& pair, const Rays& rays, const Vec2& pixel0,
                    const Vec2& pixel1, double angle, tv_point* point) {
  const Vec3 turned = rotate(pair.cam1_from_cam0_R, rays.ray0);
  write_point(TV_POINT_INFINITE, rays.ray0, angle,
              error_px(pair, rays, pixel0, pixel1, rays.ray0, turned), point);
}

Vec3 solve(tv_triangulation method, const TriangulationPair& pair, const Rays& rays, double along0,
           double along1) {
  switch (method) {
    case TV_TRIANGULATION_LINEAR_LS: return solve_least_squares(pair, rays, 0);
    case TV_TRIANGULATION_ITERATIVE_LS: return solve_least_squares(pair, rays, kMaxReweightings);
    default: return midpoint(pair, rays, along0, along1);
  }
}

}  // namespace

bool is_triangulation_method(int method) {
  return method == TV_TRIANGULATION_LINEAR_LS || method == TV_TRIANGULATION_ITERATIVE_LS ||
         method == TV_TRIANGULATION_MIDPOINT;
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
  // By the largest entry first: the square of a tiny or a huge t would be lost.
  double largest = 0.0;
  for (int i = 0; i < 3; ++i) largest = std::fabs(t[i]) > largest ? std::fabs(t[i]) : largest;
  const Vec3 scaled(t[0] / largest, t[1] / largest, t[2] / largest);
  const double length = std::sqrt(dot(scaled, scaled));
  pair.direction = Vec3(scaled[0] / length, scaled[1] / length, scaled[2] / length);
  pair.baseline = largest * length;
  const Vec3 center = rotate(pair.cam0_from_cam1_R, pair.direction);
  pair.center1 = Vec3(-center[0], -center[1], -center[2]);
  return pair;
}

void triangulate_rays(tv_triangulation method, const TriangulationPair& pair, const Vec3& ray0,
                      const Vec3& ray1, const Vec2& pixel0, const Vec2& pixel1, tv_point* point) {
  Rays rays{ray0, ray1, rotate(pair.cam0_from_cam1_R, ray1), Vec3(), 0.0, 0.0};
  rays.normal = cross(rays.ray0, rays.ray1_in_0);
  rays.sine_sq = dot(rays.normal, rays.normal);
  rays.cosine = dot(rays.ray0, rays.ray1_in_0);
  const double angle = atan2(std::sqrt(rays.sine_sq), rays.cosine);
  if (!(rays.sine_sq > kParallelSine * kParallelSine)) {
    // Opposed rays leave the depth open, too, but not because the point is far.
    if (rays.cosine > 0.0) return write_infinite(pair, rays, pixel0, pixel1, angle, point);
    return write_invalid(point);
  }
  double along0, along1;
  closest_distances(pair, rays, &along0, &along1);
  const Vec3 position = solve(method, pair, rays, along0, along1);
  const Vec3 metric(position[0] * pair.baseline, position[1] * pair.baseline,
                    position[2] * pair.baseline);
  if (!is_finite(metric)) return write_infinite(pair, rays, pixel0, pixel1, angle, point);
  const Vec3 position1 = combine(1.0, rotate(pair.cam1_from_cam0_R, position), 1.0, pair.direction);
  // The two lines decide, the same for every method; and no method's point may lie behind and be
  // called good.
  const bool in_front = along0 > 0.0 && along1 > 0.0 && dot(rays.ray0, position) > 0.0 &&
                        dot(rays.ray1, position1) > 0.0;
  write_point(in_front ? TV_POINT_OK : TV_POINT_BEHIND, metric, angle,
              error_px(pair, rays, pixel0, pixel1, position, position1), point);
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

void triangulate_point(tv_triangulation method, const Camera& camera0, const Camera& camera1,
                       const Mat3& R, const Vec3& t, const Vec2& pixel0, const Vec2& pixel1,
                       tv_point* point) {
  triangulate_point(method, prepare_triangulation(camera0, camera1, R, t), pixel0, pixel1, point);
}

}  // namespace tv
