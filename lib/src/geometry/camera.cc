// Camera models. Brown-Conrady: D. C. Brown, "Close-range camera calibration", 1971, with OpenCV's
// rational factor (k4..k6). Kannala-Brandt: J. Kannala, S. Brandt, PAMI 2006, four coefficients.
//
// Both are used only where they can be inverted: this region is found once per camera, and within
// it Newton's method computes the inverse to rounding. Derivations: docs/algorithms/camera.md;
// test: test/unit/test_camera.cc, test_camera_opencv.cc.
#include "geometry/camera.h"

#include <cmath>
#include <limits>

#include "base/math.h"

namespace tv {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// The least derivative of the distortion in the valid region. At this derivative, Newton's method
// in 64 bits finds the ray to about 1e-10; below it, no accuracy can be promised.
constexpr double kMinDerivative = 1e-6;
constexpr double kTan89Degrees = 57.289961630759425;
constexpr double kTan44p5Degrees = 0.98269726101190570;
// The tolerance of the region's edge, a factor on the distorted radius: a pixel that was projected
// from a ray just within the region is not rejected because of rounding.
constexpr double kEdgeSlack = 1.0 + 1e-9;
// The relative size of a Newton step that ends the iteration: convergence is quadratic, so the next
// step would round to 0.
constexpr double kConverged = 1e-11;

constexpr int kMaxBisections = 80;
constexpr int kMaxThirds = 40;
constexpr int kMaxNewtonSteps = 30;
constexpr int kMaxHalvings = 30;

struct Point2 {
  double x, y;
};

// A symmetric 2x2 matrix, such as the Jacobian of Brown-Conrady's distortion.
struct Symmetric2 {
  double xx, xy, yy;
};

// ---- Brown-Conrady ----

// The radial factor s and its derivative in u = r^2; s = NaN where the denominator is not positive.
struct Radial {
  double s, ds_du;
};

Radial brown_radial(const double k[8], double u) {
  const double numerator = 1.0 + u * (k[0] + u * (k[1] + u * k[4]));
  const double d_numerator = k[0] + u * (2.0 * k[1] + u * (3.0 * k[4]));
  // Without a denominator there is no division. The product with 0 turns a numerator that is not
  // finite into no number, as the division would.
  if (k[5] == 0.0 && k[6] == 0.0 && k[7] == 0.0) return {numerator, d_numerator - numerator * 0.0};
  const double denominator = 1.0 + u * (k[5] + u * (k[6] + u * k[7]));
  const double d_denominator = k[5] + u * (2.0 * k[6] + u * (3.0 * k[7]));
  if (!(denominator > 0.0)) return {std::numeric_limits<double>::quiet_NaN(), 0.0};
  const double inverse = 1.0 / denominator;
  const double s = numerator * inverse;
  return {s, (d_numerator - s * d_denominator) * inverse};
}

Point2 brown_distort(const double k[8], const Point2& p, Symmetric2* jacobian) {
  const double u = p.x * p.x + p.y * p.y;
  const Radial radial = brown_radial(k, u);
  const double p1 = k[2], p2 = k[3];
  const double dot = p2 * p.x + p1 * p.y;
  const double s = radial.s + 2.0 * dot;
  if (jacobian) {
    const double d = 2.0 * radial.ds_du;
    jacobian->xx = s + d * p.x * p.x + 4.0 * p2 * p.x;
    jacobian->xy = d * p.x * p.y + 2.0 * (p1 * p.x + p2 * p.y);
    jacobian->yy = s + d * p.y * p.y + 4.0 * p1 * p.y;
  }
  return {s * p.x + p2 * u, s * p.y + p1 * u};
}

// A lower bound of the eigenvalues of the distortion's Jacobian on the circle of radius r, less
// kMinDerivative; -1 where it is not a number. The Jacobian's radial part has the eigenvalues s and
// d(r s)/dr, its tangential part none below -6 r |(p1, p2)|. `tangential` is |(p1, p2)|.
double brown_margin(const double k[8], double tangential, double r) {
  const double u = r * r;
  const Radial radial = brown_radial(k, u);
  const double derivative = radial.s + 2.0 * u * radial.ds_du;
  const double least = derivative < radial.s ? derivative : radial.s;
  const double margin = least - 6.0 * r * tangential - kMinDerivative;
  return margin == margin ? margin : -1.0;
}

// ---- Kannala-Brandt ----

double kannala_distort(const double k[8], double theta, double* derivative) {
  const double u = theta * theta;
  *derivative = 1.0 + u * (3.0 * k[0] + u * (5.0 * k[1] + u * (7.0 * k[2] + u * (9.0 * k[3]))));
  return theta * (1.0 + u * (k[0] + u * (k[1] + u * (k[2] + u * k[3]))));
}

double kannala_margin(const double k[8], double theta) {
  double derivative;
  kannala_distort(k, theta, &derivative);
  const double margin = derivative - kMinDerivative;
  return margin == margin ? margin : -1.0;
}

// ---- the valid region ----

// The last x in [low, high] before margin falls to 0, given margin(low) > 0 >= margin(high).
template <typename Margin>
double bisect(const Margin& margin, double low, double high) {
  for (int i = 0; i < kMaxBisections; ++i) {
    const double middle = 0.5 * (low + high);
    if (middle <= low || middle >= high) break;
    (margin(middle) > 0.0 ? low : high) = middle;
  }
  return low;
}

// The place of the least margin in [low, high], which holds one local minimum.
template <typename Margin>
double least_between(const Margin& margin, double low, double high) {
  for (int i = 0; i < kMaxThirds; ++i) {
    const double third = (high - low) / 3.0;
    if (margin(low + third) < margin(high - third)) {
      high -= third;
    } else {
      low += third;
    }
  }
  return 0.5 * (low + high);
}

// The first zero of margin over sample(0) = 0 < sample(1) < ... < sample(last), or sample(last).
// Where the samples have a local minimum, the margin may fall to 0 between them: its minimum there
// is searched.
template <typename Margin, typename Sample>
double first_zero(const Margin& margin, const Sample& sample, int last) {
  double x[3] = {0.0, 0.0, 0.0};
  double value[3] = {margin(0.0), margin(0.0), margin(0.0)};
  for (int i = 1; i <= last; ++i) {
    x[0] = x[1], x[1] = x[2], x[2] = sample(i);
    value[0] = value[1], value[1] = value[2], value[2] = margin(x[2]);
    if (i > 1 && value[1] < value[0] && value[1] <= value[2]) {
      const double bottom = least_between(margin, x[0], x[2]);
      if (!(margin(bottom) > 0.0)) return bisect(margin, x[0], bottom);
    }
    if (!(value[2] > 0.0)) return bisect(margin, x[1], x[2]);
  }
  return x[2];
}

void find_valid_region_brown(Camera* camera) {
  const double* k = camera->model.k;
  const double tangential = std::sqrt(k[2] * k[2] + k[3] * k[3]);
  const auto margin = [k, tangential](double r) { return brown_margin(k, tangential, r); };
  // tan(2a) = 2 tan(a) / (1 - tan(a)^2) spreads the samples evenly in angle.
  const int last = 160;
  const auto sample = [](int i) {
    if (i == last) return kTan89Degrees;
    const double t = i * (kTan44p5Degrees / last);
    return 2.0 * t / (1.0 - t * t);
  };
  const double r = first_zero(margin, sample, last);
  camera->valid_radius_undistorted = r;
  camera->valid_angle_rad = atan(r);
  camera->valid_radius_distorted = r * brown_radial(k, r * r).s + 3.0 * tangential * r * r;
}

void find_valid_region_kannala(Camera* camera) {
  const double* k = camera->model.k;
  const auto margin = [k](double theta) { return kannala_margin(k, theta); };
  const int last = 360;
  const auto sample = [](int i) { return i == last ? kPi : i * (kPi / last); };
  const double theta = first_zero(margin, sample, last);
  double derivative;
  camera->valid_angle_rad = theta;
  camera->valid_radius_undistorted = kInfinity;
  camera->valid_radius_distorted = kannala_distort(k, theta, &derivative);
}

// ---- projection ----

// A power of two that brings the point's largest coordinate to where squares neither overflow nor
// vanish; 0 for a point that has no direction.
double safe_scale(const Vec3& point) {
  double largest = 0.0;
  for (int i = 0; i < 3; ++i) {
    const double size = std::fabs(point[i]);
    if (!(size < kInfinity)) return 0.0;
    if (size > largest) largest = size;
  }
  if (largest == 0.0) return 0.0;
  return largest > 0x1p300 ? 0x1p-700 : largest < 0x1p-300 ? 0x1p800 : 1.0;
}

bool project_central(const Camera& camera, const Vec3& point, Vec2* pixel, Mat23* jacobian) {
  const tv_camera& model = camera.model;
  if (!(point[2] > 0.0)) return false;
  const double inverse_z = 1.0 / point[2];
  const Point2 plane{point[0] * inverse_z, point[1] * inverse_z};
  const double limit = camera.valid_radius_undistorted;
  if (!(plane.x * plane.x + plane.y * plane.y <= limit * limit)) return false;
  Point2 distorted = plane;
  Symmetric2 d{1.0, 0.0, 1.0};
  if (model.model == TV_CAMERA_BROWN_CONRADY) distorted = brown_distort(model.k, plane, &d);
  const double u = model.fx * distorted.x + model.cx;
  const double v = model.fy * distorted.y + model.cy;
  if (!(std::fabs(u) < kInfinity && std::fabs(v) < kInfinity)) return false;
  *pixel = Vec2(u, v);
  if (jacobian) {
    const double sx = model.fx * inverse_z;
    const double sy = model.fy * inverse_z;
    *jacobian << sx * d.xx, sx * d.xy, -sx * (d.xx * plane.x + d.xy * plane.y),  //
        sy * d.xy, sy * d.yy, -sy * (d.xy * plane.x + d.yy * plane.y);
  }
  return true;
}

bool project_kannala(const Camera& camera, const Vec3& point, Vec2* pixel, Mat23* jacobian) {
  const tv_camera& model = camera.model;
  const double x = point[0], y = point[1], z = point[2];
  const double r_sq = x * x + y * y;
  const double r = std::sqrt(r_sq);
  if (r == 0.0 && !(z > 0.0)) return false;  // a point straight behind has no azimuth
  const double theta = atan2(r, z);
  if (!(theta <= camera.valid_angle_rad)) return false;
  double derivative;
  const double distorted = kannala_distort(model.k, theta, &derivative);
  // (nx, ny): the unit vector of the azimuth. On the axis any vector serves, because the map is the
  // same in all directions there.
  const double nx = r > 0.0 ? x / r : 1.0;
  const double ny = r > 0.0 ? y / r : 0.0;
  const double u = model.fx * (r > 0.0 ? distorted * nx : 0.0) + model.cx;
  const double v = model.fy * (r > 0.0 ? distorted * ny : 0.0) + model.cy;
  if (!(std::fabs(u) < kInfinity && std::fabs(v) < kInfinity)) return false;
  *pixel = Vec2(u, v);
  if (jacobian) {
    const double across = r > 0.0 ? distorted / r : 1.0 / z;
    const double length_sq = r_sq + z * z;
    const double along = derivative * z / length_sq;
    const double depth = -derivative * r / length_sq;
    const double xx = along * nx * nx + across * ny * ny;
    const double xy = (along - across) * nx * ny;
    const double yy = along * ny * ny + across * nx * nx;
    *jacobian << model.fx * xx, model.fx * xy, model.fx * depth * nx,  //
        model.fy * xy, model.fy * yy, model.fy * depth * ny;
  }
  return true;
}

// ---- unprojection ----

// One Newton step towards distort(p) = target; false where the Jacobian is not positive definite.
bool brown_newton_step(const double k[8], const Point2& target, const Point2& p, Point2* step,
                       double* error_sq) {
  Symmetric2 j;
  const Point2 at = brown_distort(k, p, &j);
  const double ex = target.x - at.x;
  const double ey = target.y - at.y;
  *error_sq = ex * ex + ey * ey;
  const double det = j.xx * j.yy - j.xy * j.xy;
  if (!(det > 0.0 && j.xx > 0.0)) return false;
  *step = {(j.yy * ex - j.xy * ey) / det, (j.xx * ey - j.xy * ex) / det};
  return true;
}

bool is_small(const Point2& step, const Point2& p) {
  const double scale = 1.0 + std::fabs(p.x) + std::fabs(p.y);
  return std::fabs(step.x) + std::fabs(step.y) <= kConverged * scale;
}

// The usual case: Newton's method alone, which converges in two to five steps. If it converges
// inside the valid disc, the result is the solution, because the map is one-to-one there. False:
// call brown_invert_safe.
bool brown_invert_fast(const Camera& camera, const Point2& target, double target_sq, Point2* out) {
  const double limit_sq = camera.valid_radius_undistorted * camera.valid_radius_undistorted;
  Point2 p = target;
  if (target_sq < limit_sq) {
    const double s = brown_radial(camera.model.k, target_sq).s;
    if (s > 0.25) p = {target.x / s, target.y / s};
  }
  for (int i = 0; i < 8; ++i) {
    Point2 step;
    double error_sq;
    if (!(p.x * p.x + p.y * p.y <= limit_sq)) return false;
    if (!brown_newton_step(camera.model.k, target, p, &step, &error_sq)) return false;
    p = {p.x + step.x, p.y + step.y};
    if (is_small(step, p)) {
      *out = p;
      return true;
    }
  }
  return false;
}

// The radius whose radial distortion is `distorted`, by Newton's method kept in a bracket.
double brown_invert_radius(const Camera& camera, double distorted) {
  double low = 0.0, high = camera.valid_radius_undistorted;
  double r = distorted < high ? distorted : high;
  for (int i = 0; i < kMaxBisections; ++i) {
    const Radial radial = brown_radial(camera.model.k, r * r);
    const double error = r * radial.s - distorted;
    (error < 0.0 ? low : high) = r;
    double next = r - error / (radial.s + 2.0 * r * r * radial.ds_du);
    if (!(next > low && next < high)) next = 0.5 * (low + high);
    if (std::fabs(next - r) <= kConverged * (1.0 + r)) return next;
    r = next;
  }
  return r;
}

// For pixels near the edge of the valid disc, or under strong distortion: Newton's method with step
// halving, from the radial solution. The distortion is the gradient of a convex function on the
// disc, so the error falls along each Newton step, if the step is short enough.
bool brown_invert_safe(const Camera& camera, const Point2& target, double target_sq, Point2* out) {
  const double limit = camera.valid_radius_undistorted;
  const double length = std::sqrt(target_sq);
  const double r = brown_invert_radius(camera, length);
  const double scale = length > 0.0 ? r / length : 0.0;
  Point2 p{target.x * scale, target.y * scale};
  Point2 step;
  double error_sq;
  if (!brown_newton_step(camera.model.k, target, p, &step, &error_sq)) return false;
  for (int i = 0; i < kMaxNewtonSteps && !is_small(step, p); ++i) {
    double share = 1.0;
    Point2 next_step;
    double next_error_sq = error_sq;
    int halvings = 0;
    for (; halvings < kMaxHalvings; ++halvings, share *= 0.5) {
      Point2 next{p.x + share * step.x, p.y + share * step.y};
      const double next_length = std::sqrt(next.x * next.x + next.y * next.y);
      if (next_length > limit) {
        const double pull = limit / next_length;
        next = {next.x * pull, next.y * pull};
      }
      if (!brown_newton_step(camera.model.k, target, next, &next_step, &next_error_sq)) continue;
      if (next_error_sq < error_sq) {
        p = next;
        break;
      }
    }
    if (halvings == kMaxHalvings) break;  // no step lowers the error further
    step = next_step;
    error_sq = next_error_sq;
  }
  if (!(error_sq <= 1e-20 * (1.0 + target_sq))) return false;
  *out = p;
  return true;
}

Point2 in_focal_lengths(const tv_camera& model, const Vec2& pixel) {
  return {(pixel[0] - model.cx) / model.fx, (pixel[1] - model.cy) / model.fy};
}

bool undistort_central(const Camera& camera, const Point2& target, Point2* p) {
  const double target_sq = target.x * target.x + target.y * target.y;
  const double limit = camera.valid_radius_distorted * kEdgeSlack;
  if (!(target_sq <= limit * limit)) return false;
  *p = target;
  if (camera.model.model == TV_CAMERA_BROWN_CONRADY) {
    // The results of both inversions lie within the valid disc, up to a last step of 1e-11.
    if (!brown_invert_fast(camera, target, target_sq, p) &&
        !brown_invert_safe(camera, target, target_sq, p)) {
      return false;
    }
  }
  return 1.0 + p->x * p->x + p->y * p->y < kInfinity;
}

bool unproject_central(const Camera& camera, const Point2& target, Vec3* ray, Mat32* jacobian) {
  const tv_camera& model = camera.model;
  Point2 p;
  if (!undistort_central(camera, target, &p)) return false;
  *ray = ray_through(Vec2(p.x, p.y));
  if (jacobian) {
    const double x = (*ray)[0], y = (*ray)[1], z = (*ray)[2], inverse = z;
    Symmetric2 d{1.0, 0.0, 1.0};
    if (model.model == TV_CAMERA_BROWN_CONRADY) brown_distort(model.k, p, &d);
    const double det = d.xx * d.yy - d.xy * d.xy;
    // d plane / d pixel, then d ray / d plane = (I - ray ray^T) / length.
    const double xu = d.yy / det / model.fx, xv = -d.xy / det / model.fy;
    const double yu = -d.xy / det / model.fx, yv = d.xx / det / model.fy;
    const double xx = (1.0 - x * x) * inverse, xy = -x * y * inverse, yy = (1.0 - y * y) * inverse;
    const double zx = -z * x * inverse, zy = -z * y * inverse;
    *jacobian << xx * xu + xy * yu, xx * xv + xy * yv,  //
        xy * xu + yy * yu, xy * xv + yy * yv,           //
        zx * xu + zy * yu, zx * xv + zy * yv;
  }
  return true;
}

// theta with kannala_distort(theta) = distorted, by Newton's method kept in a bracket.
double kannala_invert(const Camera& camera, double distorted) {
  double low = 0.0, high = camera.valid_angle_rad;
  double theta = distorted < high ? distorted : high;
  for (int i = 0; i < kMaxBisections; ++i) {
    double derivative;
    const double error = kannala_distort(camera.model.k, theta, &derivative) - distorted;
    (error < 0.0 ? low : high) = theta;
    double next = theta - error / derivative;
    if (!(next >= low && next <= high)) next = 0.5 * (low + high);
    if (std::fabs(next - theta) <= kConverged * theta) return next;
    theta = next;
  }
  return theta;
}

bool unproject_kannala(const Camera& camera, const Point2& target, Vec3* ray, Mat32* jacobian) {
  const tv_camera& model = camera.model;
  const double distorted_sq = target.x * target.x + target.y * target.y;
  const double limit = camera.valid_radius_distorted * kEdgeSlack;
  if (!(distorted_sq <= limit * limit)) return false;
  const double distorted = std::sqrt(distorted_sq);
  const double theta = distorted > 0.0 ? kannala_invert(camera, distorted) : 0.0;
  const double nx = distorted > 0.0 ? target.x / distorted : 1.0;
  const double ny = distorted > 0.0 ? target.y / distorted : 0.0;
  double sine, cosine;
  sincos(theta, &sine, &cosine);
  *ray = distorted > 0.0 ? Vec3(sine * nx, sine * ny, cosine) : Vec3(0.0, 0.0, 1.0);
  if (jacobian) {
    double derivative;
    kannala_distort(model.k, theta, &derivative);
    const double along = cosine / derivative;
    const double across = distorted > 0.0 ? sine / distorted : 1.0;
    const double xx = along * nx * nx + across * ny * ny;
    const double xy = (along - across) * nx * ny;
    const double yy = along * ny * ny + across * nx * nx;
    const double depth = -sine / derivative;
    *jacobian << xx / model.fx, xy / model.fy,  //
        xy / model.fx, yy / model.fy,           //
        depth * nx / model.fx, depth * ny / model.fy;
  }
  return true;
}

bool has_distortion(const tv_camera& model) {
  for (double k : model.k) {
    if (k != 0.0) return true;
  }
  return false;
}

}  // namespace

Camera prepare_camera(const tv_camera& model) {
  Camera camera{model, 0.5 * kPi, kInfinity, kInfinity};
  if (model.model == TV_CAMERA_KANNALA_BRANDT) {
    find_valid_region_kannala(&camera);
  } else if (model.model == TV_CAMERA_BROWN_CONRADY && has_distortion(model)) {
    find_valid_region_brown(&camera);
  } else {
    camera.model.model = TV_CAMERA_PINHOLE;
  }
  return camera;
}

bool project(const Camera& camera, const Vec3& point, Vec2* pixel, Mat23* jacobian) {
  const double scale = safe_scale(point);
  if (scale == 0.0) return false;
  const Vec3 scaled = scale == 1.0 ? point : Vec3(point * scale);
  const bool ok = camera.model.model == TV_CAMERA_KANNALA_BRANDT
                      ? project_kannala(camera, scaled, pixel, jacobian)
                      : project_central(camera, scaled, pixel, jacobian);
  if (ok && jacobian && scale != 1.0) *jacobian *= scale;
  return ok;
}

bool undistort(const Camera& camera, const Vec2& pixel, Vec2* plane) {
  Point2 p;
  if (camera.model.model == TV_CAMERA_KANNALA_BRANDT ||
      !undistort_central(camera, in_focal_lengths(camera.model, pixel), &p)) {
    return false;
  }
  *plane = Vec2(p.x, p.y);
  return true;
}

Vec3 ray_through(const Vec2& plane) {
  const double inverse = 1.0 / std::sqrt(1.0 + plane[0] * plane[0] + plane[1] * plane[1]);
  return Vec3(plane[0] * inverse, plane[1] * inverse, inverse);
}

bool unproject(const Camera& camera, const Vec2& pixel, Vec3* ray, Mat32* jacobian) {
  const tv_camera& model = camera.model;
  const Point2 target = in_focal_lengths(model, pixel);
  return model.model == TV_CAMERA_KANNALA_BRANDT ? unproject_kannala(camera, target, ray, jacobian)
                                                 : unproject_central(camera, target, ray, jacobian);
}

// [a 0 c; 0 b d; 0 0 1], entry by entry: shorter code than Eigen's initialiser.
static Mat3 upper_triangle(double a, double b, double c, double d) {
  Mat3 m = Mat3::Identity();
  m(0, 0) = a;
  m(1, 1) = b;
  m(0, 2) = c;
  m(1, 2) = d;
  return m;
}

Mat3 intrinsics_of(const tv_camera& camera) {
  return upper_triangle(camera.fx, camera.fy, camera.cx, camera.cy);
}

Mat3 inverse_intrinsics(const Mat3& K) {
  return upper_triangle(1 / K(0, 0), 1 / K(1, 1), -K(0, 2) / K(0, 0), -K(1, 2) / K(1, 1));
}

}  // namespace tv
