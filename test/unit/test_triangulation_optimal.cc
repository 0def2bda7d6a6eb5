// Poly and Poly-Abs are proved optimal: branch and bound over the pencil of epipolar planes (all
// planes that contain the baseline), in long double, shows that no plane has a cost below theirs by
// more than 1e-9 of it or 1e-12 pixels.
//
//   TWOVIEW_TRIANGULATION_CASES=1000000 unit_triangulation_optimal     the number of cases of each
//
// Motions: general, sideways, forward, converging, both epipoles at infinity, one there. Matches:
// with noise from 1e-9 to 1000 pixels, unrelated, at infinity, on and near the epipoles of one
// image and of both, at equal distances from them. All within 2000 pixels, where doubles are 2e-13
// apart.
#include <Eigen/Geometry>
#include <cmath>
#include <cstdio>
#include <cstdlib>

#include "base/random.h"
#include "triangulation/triangulation.h"
#include "unity.h"

void setUp(void) {}
void tearDown(void) {}

namespace {

using tv::Camera;
using tv::Mat3;
using tv::Vec2;
using tv::Vec3;
using Real = long double;

constexpr uint64_t kSeed = 23;
constexpr Real kRelativeGap = 1e-9L, kAbsoluteGapPx = 1e-12L;
constexpr Real kOffPlanePx = 3e-12L;  // about 12 roundings of a pixel's coordinate
// The number of a case whose minimum Poly-Abs once missed: beside the minimum, the line in image 0
// goes to infinity. The case is always run.
constexpr int kOnceMissed = 696735;
constexpr int kMaxNodes = 400000;

double uniform(tv::Random* random, double low, double high) {
  return low + (high - low) * (tv::random_next(*random) * 0x1p-32);
}

double log_uniform(tv::Random* random, double low, double high) {
  return low * std::pow(high / low, uniform(random, 0, 1));
}

Vec2 in_any_direction(tv::Random* random, double length) {
  const double angle = uniform(random, 0, 6.283185307179586);
  return Vec2(length * std::cos(angle), length * std::sin(angle));
}

// ---- the random cases ----

struct Case {
  Camera camera[2];
  Mat3 R;
  Vec3 t;
  Vec2 pixel[2];
  int motion, match;
};

constexpr int kNumMotions = 8, kNumMatches = 10;

tv_camera random_pinhole(tv::Random* random) {
  tv_camera camera{TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}};
  const int kind = static_cast<int>(tv::random_below(*random, 3));
  if (kind > 0) camera.fx = camera.fy = uniform(random, 200, 1000);
  if (kind > 1) camera.fy *= uniform(random, 0.5, 2);
  return camera;
}

Mat3 random_rotation(tv::Random* random, double angle) {
  const Vec3 axis(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
  return Eigen::AngleAxisd(angle * uniform(random, 0, 1), axis.normalized()).toRotationMatrix();
}

void choose_motion(tv::Random* random, Case* c) {
  const double sign = tv::random_below(*random, 2) ? 1 : -1;
  const double tiny = log_uniform(random, 1e-12, 0.1);
  c->R = Mat3::Identity();
  switch (c->motion) {
    case 0:  // a general motion
      c->R = random_rotation(random, 1.0);
      c->t = Vec3(uniform(random, -1, 1), uniform(random, -1, 1), uniform(random, -1, 1));
      break;
    case 1:  // sideways: both epipoles are far away or at infinity
      c->R = random_rotation(random, tiny);
      c->t = Vec3(sign, uniform(random, -1, 1), sign * log_uniform(random, 1e-12, 0.1));
      break;
    case 2:  // forward: both epipoles are in the images
      c->R = random_rotation(random, 0.2);
      c->t = Vec3(uniform(random, -0.3, 0.3), uniform(random, -0.3, 0.3), sign);
      break;
    case 3:  // the two optical axes converge
      c->R = Eigen::AngleAxisd(uniform(random, 0.2, 1.2), Vec3::UnitY()).toRotationMatrix();
      c->t = Vec3(-1, uniform(random, -0.1, 0.1), uniform(random, 0, 1));
      break;
    case 4:  // a rectified pair: both epipoles and lines of planes are at infinity
      c->t = Vec3(sign, tv::random_below(*random, 2) ? 0 : uniform(random, -1, 1), 0);
      break;
    case 5:  // straight ahead, without rotation
      c->t = Vec3(0, 0, sign);
      break;
    case 6:  // the epipole of image 1 is at infinity, that of image 0 is finite
      c->R = random_rotation(random, 0.5);
      c->t = Vec3(uniform(random, -1, 1), sign, 0);
      break;
    default:  // the epipole of image 0 is at infinity, that of image 1 is finite
      c->R = random_rotation(random, 0.5);
      c->t = c->R * Vec3(uniform(random, -1, 1), sign, 0);
  }
  c->t.normalize();
}

Vec2 random_pixel(tv::Random* random) {
  return Vec2(uniform(random, 0, 640), uniform(random, 0, 480));
}

Vec2 projected(const Camera& camera, const Vec3& at) {
  const tv_camera& m = camera.model;
  return Vec2(m.fx * at[0] / at[2] + m.cx, m.fy * at[1] / at[2] + m.cy);
}

// Replaces a pixel that is far outside the image by a random pixel of the image.
Vec2 kept_near(tv::Random* random, const Vec2& pixel) {
  return pixel.array().abs().maxCoeff() < 2000 ? pixel : random_pixel(random);
}

void choose_match(tv::Random* random, Case* c) {
  const Vec3 center1 = -(c->R.transpose() * c->t);
  const Vec2 epipole[2] = {kept_near(random, projected(c->camera[0], center1)),
                           kept_near(random, projected(c->camera[1], c->t))};
  Vec2 pixel0 = random_pixel(random);
  const tv_camera& m = c->camera[0].model;
  const double depth = log_uniform(random, 0.5, 1000);
  const Vec3 point0 = depth * Vec3((pixel0[0] - m.cx) / m.fx, (pixel0[1] - m.cy) / m.fy, 1);
  Vec2 pixel1 = projected(c->camera[1], c->R * point0 + c->t);
  switch (c->match) {
    case 0: break;
    case 1: pixel1 = projected(c->camera[1], c->R * point0); break;  // a point at infinity
    case 2: pixel1 = random_pixel(random); break;                    // a wrong match
    case 3: pixel0 = epipole[0]; break;
    case 4: pixel1 = epipole[1]; break;
    case 5: pixel0 = epipole[0] + in_any_direction(random, log_uniform(random, 1e-12, 100)); break;
    case 6: pixel1 = epipole[1] + in_any_direction(random, log_uniform(random, 1e-12, 100)); break;
    case 7:
      pixel0 = epipole[0] + in_any_direction(random, log_uniform(random, 1e-12, 100));
      pixel1 = epipole[1] + in_any_direction(random, log_uniform(random, 1e-12, 100));
      break;
    // Both pixels are equally far from their epipoles, in opposite directions or at a right angle:
    // the cost has several equal minima.
    case 8: {
      const Vec2 off = in_any_direction(random, log_uniform(random, 1e-6, 300));
      const bool across = tv::random_below(*random, 2);
      pixel0 = epipole[0] + off;
      pixel1 = across ? Vec2(epipole[1] + Vec2(-off[1], off[0])) : Vec2(epipole[1] - off);
      break;
    }
    default: pixel0 = epipole[0], pixel1 = epipole[1];
  }
  const int noise = static_cast<int>(tv::random_below(*random, 4));
  const double sigma = noise == 0 ? 0 : noise == 1 ? 1 : log_uniform(random, 1e-9, 1000);
  const bool moved = c->match < 3 || tv::random_below(*random, 4) == 0;
  c->pixel[0] = kept_near(random, pixel0);
  c->pixel[1] = kept_near(random, pixel1);
  if (moved) {
    for (Vec2& pixel : c->pixel) {
      pixel += sigma * Vec2(uniform(random, -1, 1), uniform(random, -1, 1));
    }
  }
}

Case random_case(tv::Random* random, int index) {
  Case c;
  c.motion = index % kNumMotions;
  c.match = index / kNumMotions % kNumMatches;
  const tv_camera first = random_pinhole(random);
  c.camera[0] = tv::prepare_camera(first);
  c.camera[1] = tv::prepare_camera(tv::random_below(*random, 2) ? first : random_pinhole(random));
  choose_motion(random, &c);
  choose_match(random, &c);
  return c;
}

// ---- the pencil of epipolar planes, computed from R, t and the pixels, not by the library ----

struct Plane {
  Real x, y;
};

struct Pencil {
  Real axis[2][2][3];  // axis[i]: the two axes of the pencil, in camera i
  Real alpha[2][2];    // alpha[i]: pixel i in these axes
  Real step[2][2][2];  // step[i][axis]: change of alpha by a pixel along x and y
};

void cross3(const Real* a, const Real* b, Real* out) {
  for (int i = 0; i < 3; ++i) {
    out[i] = a[(i + 1) % 3] * b[(i + 2) % 3] - a[(i + 2) % 3] * b[(i + 1) % 3];
  }
}

void normalise3(Real* a) {
  const Real length = std::sqrt(a[0] * a[0] + a[1] * a[1] + a[2] * a[2]);
  for (int i = 0; i < 3; ++i) a[i] /= length;
}

void coordinates(const Pencil& pencil, const Case& c, int i, const Real pixel[2], Real alpha[2]) {
  const tv_camera& m = c.camera[i].model;
  const Real x = (pixel[0] - m.cx) / m.fx, y = (pixel[1] - m.cy) / m.fy;
  for (int k = 0; k < 2; ++k) {
    alpha[k] = pencil.axis[i][k][0] * x + pencil.axis[i][k][1] * y + pencil.axis[i][k][2];
  }
}

Pencil pencil_of(const Case& c) {
  Pencil pencil;
  Real center[3];
  for (int i = 0; i < 3; ++i) {
    center[i] = 0;
    for (int k = 0; k < 3; ++k) center[i] -= static_cast<Real>(c.R(k, i)) * c.t[k];
  }
  normalise3(center);
  int smallest = 0;
  for (int i = 1; i < 3; ++i) {
    if (std::fabs(center[i]) < std::fabs(center[smallest])) smallest = i;
  }
  Real start[3] = {0, 0, 0};
  start[smallest] = 1;
  cross3(center, start, pencil.axis[0][0]);
  normalise3(pencil.axis[0][0]);
  cross3(center, pencil.axis[0][0], pencil.axis[0][1]);
  for (int k = 0; k < 2; ++k) {
    for (int i = 0; i < 3; ++i) {
      pencil.axis[1][k][i] = 0;
      for (int j = 0; j < 3; ++j) {
        pencil.axis[1][k][i] += static_cast<Real>(c.R(i, j)) * pencil.axis[0][k][j];
      }
    }
  }
  for (int i = 0; i < 2; ++i) {
    const tv_camera& m = c.camera[i].model;
    const Real pixel[2] = {c.pixel[i][0], c.pixel[i][1]};
    coordinates(pencil, c, i, pixel, pencil.alpha[i]);
    for (int k = 0; k < 2; ++k) {
      pencil.step[i][k][0] = pencil.axis[i][k][0] / m.fx;
      pencil.step[i][k][1] = pencil.axis[i][k][1] / m.fy;
    }
  }
  return pencil;
}

// (gx, gy) is step^T v, whose squared length is Q(v), and `above` is alpha . v, for a plane v.
struct View {
  Real gx, gy, above;
};

View view_of(const Pencil& pencil, int i, const Plane& v) {
  return View{pencil.step[i][0][0] * v.x + pencil.step[i][1][0] * v.y,
              pencil.step[i][0][1] * v.x + pencil.step[i][1][1] * v.y,
              pencil.alpha[i][0] * v.x + pencil.alpha[i][1] * v.y};
}

// A distance in pixels, or its square. The distance to a line at infinity is infinite.
Real term_of(const View& view, bool squared) {
  if (view.above == 0) return 0;
  const Real sq = view.above * view.above / (view.gx * view.gx + view.gy * view.gy);
  return squared ? sq : std::sqrt(sq);
}

Real cost_of(const Pencil& pencil, const Plane& v, bool squared) {
  return term_of(view_of(pencil, 0, v), squared) + term_of(view_of(pencil, 1, v), squared);
}

// ---- the proof by branch and bound ----

// An upper bound of the second derivative of one image's cost along v = (1 - t) first + t last.
Real curvature_bound(const View& first, const View& last, bool squared) {
  const Real A = first.gx * first.gx + first.gy * first.gy;
  const Real C = last.gx * last.gx + last.gy * last.gy;
  const Real B = first.gx * last.gx + first.gy * last.gy;
  const Real curve = A - 2 * B + C;  // half of the second derivative of Q
  const Real at = (A - B) / curve;   // the t at which Q is least
  Real q_min = std::fmin(A, C);
  if (at > 0 && at < 1) q_min = std::fmax((A * C - B * B) / curve, Real(0));
  if (!(q_min > 0)) return INFINITY;
  const Real dn = last.above - first.above;
  const Real dq = 2 * std::fmax(std::fabs(B - A), std::fabs(C - B));
  const Real n = std::fmax(std::fabs(first.above), std::fabs(last.above));
  if (squared) {
    // N' Q - N Q' is a polynomial of degree 2 in t, so it is bounded by its coefficients in
    // Bernstein's basis.
    const Real s[3] = {dn * A - first.above * 2 * (B - A),
                       dn * B - (last.above * (B - A) + first.above * (C - B)),
                       dn * C - last.above * 2 * (C - B)};
    const Real most = std::fmax(std::fabs(s[0]), std::fmax(std::fabs(s[1]), std::fabs(s[2])));
    return 2 * most * most / (q_min * q_min * q_min);
  }
  const Real root = std::sqrt(q_min);
  return std::fabs(dn) * dq / (q_min * root) + 0.75L * n * dq * dq / (q_min * q_min * root);
}

struct Search {
  bool proved;
  Real least;  // the lowest cost of the planes examined so far
  int num_nodes;
};

// Tries to prove that every plane costs `target` or more; Search::proved says whether it could.
Search prove(const Pencil& pencil, Real target, bool squared) {
  // The pencil is cut into arcs at four fixed planes and at the zeros of the two images' costs, so
  // that within an arc each cost rises and falls at most once.
  struct Node {
    Plane first, last;
  };
  static Node stack[4096];
  int depth = 0;
  const Real kRoot = std::sqrt(Real(0.5));
  Plane ends[6] = {{1, 0}, {kRoot, kRoot}, {0, 1}, {-kRoot, kRoot}};
  int num_ends = 4;
  for (const Real* alpha : {pencil.alpha[0], pencil.alpha[1]}) {
    const Real length = std::sqrt(alpha[0] * alpha[0] + alpha[1] * alpha[1]);
    if (!(length > 0)) continue;
    Plane zero{-alpha[1] / length, alpha[0] / length};
    if (zero.y < 0 || (zero.y == 0 && zero.x < 0)) zero = Plane{-zero.x, -zero.y};
    ends[num_ends++] = zero;
  }
  for (int i = 1; i < num_ends; ++i) {  // sorts the planes by angle, in [0, pi)
    for (int k = i; k > 0 && ends[k - 1].x * ends[k].y - ends[k - 1].y * ends[k].x < 0; --k) {
      std::swap(ends[k], ends[k - 1]);
    }
  }
  for (int i = 0; i < num_ends; ++i) {
    const Plane next = i + 1 < num_ends ? ends[i + 1] : Plane{-ends[0].x, -ends[0].y};
    stack[depth++] = Node{ends[i], next};
  }
  Search search{true, INFINITY, 0};
  while (depth > 0) {
    const Node node = stack[--depth];
    if (++search.num_nodes > kMaxNodes) return Search{false, search.least, search.num_nodes};
    Real at[2][2], chord[2] = {0, 0}, curvature = 0;
    for (int i = 0; i < 2; ++i) {
      const View first = view_of(pencil, i, node.first), last = view_of(pencil, i, node.last);
      at[i][0] = term_of(first, squared);
      at[i][1] = term_of(last, squared);
      chord[0] += at[i][0];
      chord[1] += at[i][1];
      curvature += curvature_bound(first, last, squared);
    }
    const Real chord_min = std::fmin(chord[0], chord[1]);
    search.least = std::fmin(search.least, chord_min);
    if (chord_min < target) return Search{false, search.least, search.num_nodes};
    if (std::fmin(at[0][0], at[0][1]) + std::fmin(at[1][0], at[1][1]) >= target) continue;
    if (chord_min - curvature / 8 >= target) continue;
    const Plane middle{(node.first.x + node.last.x) / 2, (node.first.y + node.last.y) / 2};
    const Real length = std::sqrt(middle.x * middle.x + middle.y * middle.y);
    const Plane unit{middle.x / length, middle.y / length};
    stack[depth++] = Node{unit, node.last};
    stack[depth++] = Node{node.first, unit};
  }
  return search;
}

// ---- the library's answer ----

struct Answer {
  Real cost;       // the cost of the plane through the corrected pixels, in pixels
  Real off_plane;  // how far the corrected pixels are from that plane, in pixels
  Real moved;      // the cost of the corrections themselves, in pixels
};

Answer answer_of(const Case& c, const Pencil& pencil, tv_triangulation method) {
  const tv::TriangulationPair pair = tv::prepare_triangulation(c.camera[0], c.camera[1], c.R, c.t);
  tv::RayFrame frames[2];
  for (int i = 0; i < 2; ++i) {
    Vec3 ray;
    if (!tv::unproject(c.camera[i], c.pixel[i], &ray, nullptr)) TEST_FAIL_MESSAGE("no ray");
    frames[i] = tv::frame_of(c.camera[i], ray);
  }
  const tv::Correction correction = tv::correct_match(method, pair, frames[0], frames[1]);
  const bool squared = method == TV_TRIANGULATION_POLY;
  Real alpha[2][2];
  Answer answer{};
  for (int i = 0; i < 2; ++i) {
    Real corrected[2], squares = 0;
    for (int k = 0; k < 2; ++k) {
      TEST_ASSERT_TRUE(std::isfinite(correction.step[i][k]));
      corrected[k] = static_cast<Real>(c.pixel[i][k]) + correction.step[i][k];
      squares += static_cast<Real>(correction.step[i][k]) * correction.step[i][k];
    }
    answer.moved += squared ? squares : std::sqrt(squares);
    coordinates(pencil, c, i, corrected, alpha[i]);
  }
  if (squared) answer.moved = std::sqrt(answer.moved);
  // Both corrected pixels give the same plane except for rounding. A pixel on its epipole gives
  // none.
  answer.cost = INFINITY;
  answer.off_plane = INFINITY;
  for (int i = 0; i < 2; ++i) {
    Plane plane{-alpha[i][1], alpha[i][0]};
    if (plane.x == 0 && plane.y == 0) plane.x = 1;
    const View other = view_of(pencil, 1 - i, plane);
    const Real off = std::fabs(alpha[1 - i][0] * plane.x + alpha[1 - i][1] * plane.y) /
                     std::sqrt(other.gx * other.gx + other.gy * other.gy);
    const Real sum = cost_of(pencil, plane, squared);
    const Real cost = squared ? std::sqrt(sum) : sum;
    if (off <= kOffPlanePx && cost < answer.cost) answer.cost = cost;
    answer.off_plane = std::fmin(answer.off_plane, off);
  }
  return answer;
}

int num_cases() {
  const char* asked = std::getenv("TWOVIEW_TRIANGULATION_CASES");
  const int cases = asked ? std::atoi(asked) : 0;
  return cases > 0 ? cases : 20000;
}

void check(tv_triangulation method) {
  const bool squared = method == TV_TRIANGULATION_POLY;
  tv::Random random = tv::random_seeded(kSeed);
  Real worst_gap = 0, worst_relative = 0, worst_off = 0, worst_moved = 0;
  long long nodes = 0;
  const int cases = num_cases();
  int failures = 0;
  for (int i = 0; i < cases || i <= kOnceMissed; ++i) {
    const Case c = random_case(&random, i);
    if (i >= cases && i != kOnceMissed) continue;
    const Pencil pencil = pencil_of(c);
    const Answer answer = answer_of(c, pencil, method);
    const Real slack = std::fmax(kRelativeGap * answer.cost, kAbsoluteGapPx);
    const Real target = std::fmax(answer.cost - slack, Real(0));
    const Search search = prove(pencil, squared ? target * target : target, squared);
    nodes += search.num_nodes;
    const Real least = squared ? std::sqrt(search.least) : search.least;
    const Real gap = answer.cost - std::fmin(least, answer.cost);
    worst_gap = std::fmax(worst_gap, gap);
    if (gap > kAbsoluteGapPx) worst_relative = std::fmax(worst_relative, gap / answer.cost);
    worst_off = std::fmax(worst_off, answer.off_plane);
    worst_moved = std::fmax(worst_moved, std::fabs(answer.moved - answer.cost));
    if (!search.proved && ++failures <= 20) {
      std::printf("case %d: motion %d match %d: cost %.17Lg px, least seen %.17Lg, %d nodes\n", i,
                  c.motion, c.match, answer.cost, least, search.num_nodes);
    }
  }
  std::printf(
      "%s: %d cases, %d not proved; largest gap seen %.2Lg px, %.2Lg relative where above 1e-12 px;"
      " corrected pixels %.2Lg px off their plane, their steps %.2Lg px off the cost; %.1f planes"
      " a case\n",
      squared ? "Poly" : "Poly-Abs", cases, failures, worst_gap, worst_relative, worst_off,
      worst_moved, static_cast<double>(nodes) / cases);
  std::fflush(stdout);
  TEST_ASSERT_EQUAL_INT(0, failures);
  TEST_ASSERT_TRUE(worst_off <= kOffPlanePx && worst_moved <= kOffPlanePx);
}

}  // namespace

void test_poly_is_the_global_minimum_of_the_squared_distances(void) {
  check(TV_TRIANGULATION_POLY);
}

void test_poly_abs_is_the_global_minimum_of_the_distances(void) {
  check(TV_TRIANGULATION_POLY_ABS);
}

int main(void) {
  UNITY_BEGIN();
  RUN_TEST(test_poly_is_the_global_minimum_of_the_squared_distances);
  RUN_TEST(test_poly_abs_is_the_global_minimum_of_the_distances);
  return UNITY_END();
}
