// Test: test/unit/test_triangulation_optimal.cc, test_triangulation_opencv.cc.
#include "triangulation/poly.h"

namespace tv {
namespace {

struct V2 {
  double x, y;
};

using tv::dot;  // keeps the dot of Vec3 visible beside that of V2
double dot(V2 a, V2 b) { return a.x * b.x + a.y * b.y; }
double cross(V2 a, V2 b) { return a.x * b.y - a.y * b.x; }
V2 normal_of(V2 a) { return V2{-a.y, a.x}; }

V2 coordinates(const EpipolarPencil& pencil, int i, const Vec3& ray) {
  return V2{dot(pencil.axis[i][0], ray), dot(pencil.axis[i][1], ray)};
}

// step^T v: by how much a step of one pixel along each direction of the basis changes alpha . v
// (see EpipolarPencil).
V2 gradient(const double step[2][2], V2 v) {
  return V2{step[0][0] * v.x + step[1][0] * v.y, step[0][1] * v.x + step[1][1] * v.y};
}

// The square root, with a real part of at least 0, of a complex number of length 1.
V2 half_turn(V2 z) {
  if (z.x >= 0.0) {
    const double re = std::sqrt(0.5 * (1.0 + z.x));
    return V2{re, 0.5 * z.y / re};
  }
  const double im = std::sqrt(0.5 * (1.0 - z.x));
  return z.y < 0.0 ? V2{-0.5 * z.y / im, -im} : V2{0.5 * z.y / im, im};
}

V2 unit_or_one(double x, double y, double* length) {
  *length = std::sqrt(x * x + y * y);
  return *length > 0.0 ? V2{x / *length, y / *length} : V2{1.0, 0.0};
}

// M = U diag(s) V^T with rotations U and V of the plane. M is the sum of a scaled rotation and a
// scaled reflection. Written as complex numbers (z_turn and z_mirror times their lengths), their
// angles are the difference and the sum of those of U and V, and their lengths half the sum and
// half the difference of s[0] and s[1].
void diagonalise(const double M[2][2], V2* turn_u, V2* turn_v, double s[2]) {
  double turn, mirror;
  const V2 z_turn = unit_or_one(0.5 * (M[0][0] + M[1][1]), 0.5 * (M[1][0] - M[0][1]), &turn);
  const V2 z_mirror = unit_or_one(0.5 * (M[0][0] - M[1][1]), 0.5 * (M[1][0] + M[0][1]), &mirror);
  // z_turn = u conj(v), z_mirror = u v, for u = cos + i sin of U's angle.
  *turn_u = half_turn(V2{z_turn.x * z_mirror.x - z_turn.y * z_mirror.y,
                         z_turn.x * z_mirror.y + z_turn.y * z_mirror.x});
  *turn_v = V2{z_mirror.x * turn_u->x + z_mirror.y * turn_u->y,
               z_mirror.y * turn_u->x - z_mirror.x * turn_u->y};
  s[0] = turn + mirror;
  // The determinant is used, because turn - mirror would cancel the digits of the smaller singular
  // value.
  const double det = M[0][0] * M[1][1] - M[0][1] * M[1][0];
  s[1] = s[0] > 0.0 ? det / s[0] : 0.0;
  if (std::fabs(s[1]) > s[0]) s[1] = s[1] < 0.0 ? -s[0] : s[0];
}

// ---- the sum of squares ----
//
// The least |d0|^2 + |d1|^2 with (alpha0 + step0 d0) x (alpha1 + step1 d1) = 0: one quadratic
// equation, so that Lagrange's conditions with a multiplier mu for which the Lagrangian is convex
// are sufficient as well as necessary for the global minimum (J. J. More, "Generalizations of the
// trust region problem", 1993). Along the eigenvectors of the equation's quadratic part, m its
// eigenvalues (s0, -s0, s1, -s1) and b its gradient at the pixels:
//   d_i = -mu b_i / (1 + mu m_i),  constraint(mu) = c - mu/2 sum b_i^2 r_i (1 + r_i) = 0,
//   r_i = 1 / (1 + mu m_i),        |mu| < 1 / s0,
// and the constraint's derivative -sum b_i^2 r_i^3 has one sign there: a single root.
struct Secular {
  double c;  // the constraint at the two pixels, with the sign that makes it positive or 0
  double b_sq[4];
  double m[4];  // m[0] = -singular[0] limits the range of mu
  double sum_sq;
};

// Newton's method from mu = 0. False when mu leaves the lower half of its range, [0, 1 / (2 s0)],
// or after 12 steps.
bool solve_small(const Secular& s, double* mu) {
  const double largest = -0.5 / s.m[0];  // infinite when both epipoles are at infinity
  double at = s.c / s.sum_sq;
  for (int i = 0; i < 12; ++i) {
    if (!(at >= 0.0 && at <= largest)) return false;
    double value = 0.0, slope = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double r = 1.0 / (1.0 + at * s.m[k]);
      const double term = s.b_sq[k] * r;
      value += term * (1.0 + r);
      slope += term * (r * r);
    }
    const double step = (s.c - 0.5 * at * value) / slope;
    at += step;
    // The error of mu after this step is about the square of the step, and the error of the cost is
    // about the square of that.
    if (std::fabs(step) <= 1e-6 * at) {
      *mu = at;
      return at <= largest;
    }
  }
  return false;
}

// The upper half of mu's range, solved for e = 1 - mu s0, which lies in (0, 1]. The constraint is
// nearly A - B / e^2 there, so Newton's method is applied to e^2 times the constraint, and kept in
// a bracket. Returns e.
double solve_near_bound(const Secular& s, const double s0) {
  const double ratio = std::fabs(s.m[2]) / s0;           // m[2] <= 0, m[3] = -m[2]
  double low = std::sqrt(s.b_sq[0] / (4.0 * s0 * s.c));  // there the constraint is <= 0
  if (!(low < 0.5)) low = 0.5;
  double high = 1.0;
  double e = low > 0.25 ? 0.7 : 2.0 * low;
  for (int i = 0; i < 200; ++i) {
    const double mu = (1.0 - e) / s0;
    const double r[4] = {1.0 / e, 1.0 / (2.0 - e), 1.0 / ((1.0 - ratio) + e * ratio),
                         1.0 / (1.0 + (1.0 - e) * ratio)};
    double value = 0.0, slope = 0.0;
    for (int k = 0; k < 4; ++k) {
      const double term = s.b_sq[k] * r[k];
      value += term * (1.0 + r[k]);
      slope += term * (r[k] * r[k]);
    }
    value = s.c - 0.5 * mu * value;
    slope /= s0;
    if (value < 0.0) {
      low = e;
    } else {
      high = e;
    }
    const double newton = e - e * value / (2.0 * value + e * slope);
    const bool inside = newton > low && newton < high;
    const double next = inside ? newton : std::sqrt(low * high);
    const double step = std::fabs(next - e);
    e = next;
    if (step <= 1e-14 * e || (inside && step <= 1e-7 * e)) break;
  }
  return e;
}

// The multiplier mu, and 1 + mu m for the two negative eigenvalues m.
struct Multiplier {
  double mu, low0, low1;
};

Multiplier solve_multiplier(const Secular& s) {
  const double s0 = -s.m[0], s1 = -s.m[2];
  if (!(s.c > 0.0)) return Multiplier{0.0, 1.0, 1.0};
  double mu;
  if (solve_small(s, &mu)) return Multiplier{mu, 1.0 - mu * s0, 1.0 - mu * s1};
  const double e = solve_near_bound(s, s0);
  return Multiplier{(1.0 - e) / s0, e, (1.0 - s1 / s0) + e * (s1 / s0)};
}

V2 column(const double matrix[2][2], int k) { return V2{matrix[0][k], matrix[1][k]}; }

V2 moved_by(V2 alpha, const double turned[2][2], double d0, double d1) {
  return V2{alpha.x + (turned[0][0] * d0 + turned[0][1] * d1),
            alpha.y + (turned[1][0] * d0 + turned[1][1] * d1)};
}

double size_sq(const double step[2][2]) {
  return (step[0][0] * step[0][0] + step[0][1] * step[0][1]) +
         (step[1][0] * step[1][0] + step[1][1] * step[1][1]);
}

// The plane with the least sum of the squared distances from the two pixels.
V2 plane_of_least_squares(const EpipolarPencil& pencil, V2 alpha0, V2 alpha1) {
  const double c = cross(alpha0, alpha1);
  // The multiplier has the sign of the constraint. Both are made positive by `sign`, which also
  // changes the signs of the eigenvalues. Along each singular direction the eigenvectors are (d0 +
  // d1) / sqrt 2 and (d0 - d1) / sqrt 2; (d0 + side d1) / sqrt 2 is then the one with the negative
  // eigenvalue.
  const double sign = c < 0.0 ? -1.0 : 1.0;
  const double side[2] = {-sign, pencil.singular[1] < 0.0 ? sign : -sign};
  double low[2], high[2];  // gradient b along the eigenvectors, times sqrt 2
  for (int k = 0; k < 2; ++k) {
    const double g0 = sign * cross(column(pencil.turned[0], k), alpha1);
    const double g1 = sign * cross(alpha0, column(pencil.turned[1], k));
    low[k] = g0 + side[k] * g1;
    high[k] = g0 - side[k] * g1;
  }
  const double s0 = pencil.singular[0], s1 = std::fabs(pencil.singular[1]);
  Secular s{sign * c,
            {0.5 * low[0] * low[0], 0.5 * high[0] * high[0], 0.5 * low[1] * low[1],
             0.5 * high[1] * high[1]},
            {-s0, s0, -s1, s1},
            0.0};
  s.sum_sq = (s.b_sq[0] + s.b_sq[1]) + (s.b_sq[2] + s.b_sq[3]);
  // If the gradient along the first eigenvector is zero, there are two equal minima, one on either
  // side. A gradient far below a pixel's rounding replaces it and so chooses one of the two.
  const double least = 1e-40 * (s.sum_sq + s.c * s0);
  if (s.b_sq[0] < least) {
    s.b_sq[0] = least;
    low[0] = low[0] < 0.0 ? -std::sqrt(2.0 * least) : std::sqrt(2.0 * least);
  }
  const Multiplier by = solve_multiplier(s);
  const double factor_low[2] = {by.low0, by.low1};
  const double factor_high[2] = {1.0 + by.mu * s0, 1.0 + by.mu * s1};
  double d0[2], d1[2];
  for (int k = 0; k < 2; ++k) {
    const double along_low = -0.5 * by.mu * low[k] / factor_low[k];
    const double along_high = -0.5 * by.mu * high[k] / factor_high[k];
    d0[k] = along_low + along_high;
    d1[k] = side[k] * (along_low - along_high);
  }
  const V2 moved0 = moved_by(alpha0, pencil.turned[0], d0[0], d0[1]);
  const V2 moved1 = moved_by(alpha1, pencil.turned[1], d1[0], d1[1]);
  // Both corrected pixels lie on the plane. It is computed from the one that is farther from its
  // epipole, in pixels, because that one determines it more accurately.
  return dot(moved0, moved0) * size_sq(pencil.step[1]) >=
                 dot(moved1, moved1) * size_sq(pencil.step[0])
             ? normal_of(moved0)
             : normal_of(moved1);
}

// ---- the sum of distances ----
//
// On an arc of planes v = r v_first + t v_last, r = 1 - t, the cost is N0 / sqrt Q0 + N1 / sqrt Q1
// with N = |alpha . v| = a r + b t (an arc ends where it is zero) and Q = A r^2 + 2 B r t + C t^2,
// and its derivative has the sign of L0 Q1^(3/2) + L1 Q0^(3/2), L = (A b - B a) r + (B b - C a) t.
// (Squared, that is Hartley & Sturm's polynomial of degree 8.) Between the zeros of L0, L1 and of
// the quartic of `critical_quartic` the ratio of the two terms is monotonic, so there is at most
// one root.
struct Arc {
  double a[2], b[2];
  double A[2], B[2], C[2];
};

double linear(const Arc& arc, int i, double t) {
  return (arc.A[i] * arc.b[i] - arc.B[i] * arc.a[i]) * (1.0 - t) +
         (arc.B[i] * arc.b[i] - arc.C[i] * arc.a[i]) * t;
}

double form(const Arc& arc, int i, double t) {
  const double r = 1.0 - t;
  const double q = arc.A[i] * r * r + 2.0 * arc.B[i] * r * t + arc.C[i] * t * t;
  return q > 0.0 ? q : 0.0;  // rounding may give a line at infinity a value below 0
}

double distance(const Arc& arc, int i, double t) {
  const double above = arc.a[i] * (1.0 - t) + arc.b[i] * t;
  return above > 0.0 ? above / std::sqrt(form(arc, i, t)) : 0.0;
}

double cost(const Arc& arc, double t) { return distance(arc, 0, t) + distance(arc, 1, t); }

// The derivative of `cost` by t, times a positive factor.
double slope(const Arc& arc, double t) {
  const double q0 = form(arc, 0, t), q1 = form(arc, 1, t);
  return linear(arc, 0, t) * (q1 * std::sqrt(q1)) + linear(arc, 1, t) * (q0 * std::sqrt(q0));
}

// The quartic w Q0 Q1 + 3 J L0 L1, in Bernstein's basis. Its zeros are those of the derivative of
// log(L0 / L1) + 3/2 log(Q1 / Q0), with w the determinant of (L0, L1) and 2 J the Jacobian of (Q0,
// Q1).
void critical_quartic(const Arc& arc, double p[5]) {
  const double l0[2] = {linear(arc, 0, 0.0), linear(arc, 0, 1.0)};
  const double l1[2] = {linear(arc, 1, 0.0), linear(arc, 1, 1.0)};
  const double *A = arc.A, *B = arc.B, *C = arc.C;
  const double w = l0[1] * l1[0] - l0[0] * l1[1];
  const double j[3] = {3.0 * (A[0] * B[1] - A[1] * B[0]), 3.0 * (A[0] * C[1] - A[1] * C[0]),
                       3.0 * (B[0] * C[1] - B[1] * C[0])};
  const double l[3] = {l0[0] * l1[0], l0[0] * l1[1] + l0[1] * l1[0], l0[1] * l1[1]};
  const double q0[3] = {A[0], 2.0 * B[0], C[0]}, q1[3] = {A[1], 2.0 * B[1], C[1]};
  for (int k = 0; k < 5; ++k) p[k] = 0.0;
  for (int i = 0; i < 3; ++i) {
    for (int k = 0; k < 3; ++k) p[i + k] += w * (q0[i] * q1[k]) + j[i] * l[k];
  }
  p[1] *= 0.25;
  p[2] *= 1.0 / 6.0;
  p[3] *= 0.25;
}

int num_sign_changes(const double p[5]) {
  int changes = 0;
  double last = 0.0;
  for (int k = 0; k < 5; ++k) {
    if (p[k] == 0.0) continue;
    changes += (last > 0.0 && p[k] < 0.0) || (last < 0.0 && p[k] > 0.0);
    last = p[k];
  }
  return changes;
}

// The Bernstein coefficients of the two halves of the interval, by de Casteljau's algorithm.
void halve(const double p[5], double left[5], double right[5]) {
  double q[5];
  for (int k = 0; k < 5; ++k) q[k] = p[k];
  for (int k = 0; k < 5; ++k) {
    left[k] = q[0];
    right[4 - k] = q[4 - k];
    for (int i = 0; i < 4 - k; ++i) q[i] = 0.5 * (q[i] + q[i + 1]);
  }
}

// Writes the zeros in (0, 1) of a quartic in Bernstein's basis, ascending, to 2^-kDepth. The number
// of sign changes of the coefficients bounds the number of zeros: a piece without any is dropped,
// every other one is halved down to that width. Zeros closer together are returned as one.
int zeros_in_unit_interval(const double quartic[5], double zeros[8]) {
  constexpr int kDepth = 40;
  struct Piece {
    double p[5];
    double low, width;
  };
  Piece stack[kDepth + 2];
  int depth = 0, num_zeros = 0;
  for (int k = 0; k < 5; ++k) stack[0].p[k] = quartic[k];
  stack[0].low = 0.0;
  stack[0].width = 1.0;
  depth = 1;
  while (depth > 0 && num_zeros < 8) {
    const Piece piece = stack[--depth];
    if (num_sign_changes(piece.p) == 0) continue;
    if (piece.width <= 0x1p-40) {
      zeros[num_zeros++] = piece.low + 0.5 * piece.width;
      continue;
    }
    Piece left, right;
    halve(piece.p, left.p, right.p);
    left.low = piece.low;
    right.low = piece.low + 0.5 * piece.width;
    left.width = right.width = 0.5 * piece.width;
    stack[depth++] = right;
    stack[depth++] = left;
  }
  return num_zeros;
}

// The minimum of a piece on which the slope changes its sign once, from negative to positive: by
// the secant method, in which the slope at an end that stays is halved (the Illinois rule), and by
// bisection where the secant leaves the bracket or after 50 steps.
double bracketed_minimum(const Arc& arc, double low, double high, double at_low, double at_high) {
  const double enough = 1e-10 * (high - low);
  for (int i = 0; i < 100 && high - low > enough; ++i) {
    const double secant = low + (high - low) * (at_low / (at_low - at_high));
    const double t = i < 50 && secant > low && secant < high ? secant : 0.5 * (low + high);
    const double at = slope(arc, t);
    if (at == 0.0) return t;
    if (at < 0.0) {
      low = t;
      at_low = at;
      at_high *= 0.5;
    } else {
      high = t;
      at_high = at;
      at_low *= 0.5;
    }
  }
  return 0.5 * (low + high);
}

// Whether the slope certainly has one sign on the whole arc, from bounds of its parts: the values
// of a polynomial lie between its smallest and its largest Bernstein coefficient. False means only
// that this is not certain.
bool is_surely_monotonic(const Arc& arc) {
  double q_min[2], q_max[2], l_min[2], l_max[2];
  for (int i = 0; i < 2; ++i) {
    const double A = arc.A[i], B = arc.B[i], C = arc.C[i];
    const double ends_min = A < C ? A : C;
    q_max[i] = A < C ? C : A;
    q_min[i] = B < ends_min ? B : ends_min;
    const double first = std::fabs(linear(arc, i, 0.0)), last = std::fabs(linear(arc, i, 1.0));
    l_min[i] = first < last ? first : last;
    l_max[i] = first < last ? last : first;
    if (!(q_min[i] > 0.0)) return false;
    if (linear(arc, i, 0.0) * linear(arc, i, 1.0) < 0.0) l_min[i] = 0.0;
  }
  const auto cube = [](double x) { return x * x * x; };
  return l_min[0] * l_min[0] * cube(q_min[1]) > l_max[1] * l_max[1] * cube(q_max[0]) ||
         l_min[1] * l_min[1] * cube(q_min[0]) > l_max[0] * l_max[0] * cube(q_max[1]);
}

// Returns the place of the lowest inner minimum of an arc if its cost is below *best, which then
// becomes that cost; else -1.
double search_arc(const Arc& arc, double* best) {
  double split[12];
  double quartic[5];
  critical_quartic(arc, quartic);
  int num = zeros_in_unit_interval(quartic, split);
  for (int i = 0; i < 2; ++i) {
    const double first = linear(arc, i, 0.0);
    const double zero = first / (first - linear(arc, i, 1.0));
    if (zero > 0.0 && zero < 1.0) split[num++] = zero;
  }
  split[num++] = 1.0;
  for (int i = 1; i < num; ++i) {
    for (int k = i; k > 0 && split[k] < split[k - 1]; --k) {
      const double held = split[k];
      split[k] = split[k - 1];
      split[k - 1] = held;
    }
  }
  double best_t = -1.0;
  const auto consider = [&](double t) {
    const double at = cost(arc, t);
    if (!(at < *best)) return;
    *best = at;
    best_t = t;
  };
  // The slope may be zero at a split, with any sign after rounding (where L0 and Q0 vanish
  // together, it jumps there): it is therefore evaluated just inside the piece, and the split
  // itself is a candidate for the minimum.
  double low = 0.0;
  for (int i = 0; i < num; ++i) {
    const double high = split[i];
    const double margin = 1e-9 * (high - low);
    const double first = low > 0.0 ? low + margin : low;
    const double last = high < 1.0 ? high - margin : high;
    const double slope_first = slope(arc, first), slope_last = slope(arc, last);
    if (slope_first < 0.0 && slope_last > 0.0) {
      consider(bracketed_minimum(arc, first, last, slope_first, slope_last));
    }
    if (high < 1.0) consider(high);
    low = high;
  }
  return best_t;
}

// A plane v of the pencil. It cuts image i in a line, which is above[i] / |gradient[i]| pixels away
// from the point alpha[i] of the match.
struct Plane {
  V2 v;
  V2 gradient[2];
  double above[2];  // above[i] = |alpha[i] . v|
};

double distance(const Plane& plane, int i) {
  return plane.above[i] / std::sqrt(dot(plane.gradient[i], plane.gradient[i]));
}

// Scaled so that the two gradients' squares sum to 1.
Plane scaled_plane(const EpipolarPencil& pencil, const V2 alpha[2], V2 v) {
  Plane plane{v, {gradient(pencil.step[0], v), gradient(pencil.step[1], v)}, {}};
  const double by = 1.0 / std::sqrt(dot(plane.gradient[0], plane.gradient[0]) +
                                    dot(plane.gradient[1], plane.gradient[1]));
  plane.v = V2{v.x * by, v.y * by};
  for (int i = 0; i < 2; ++i) {
    plane.gradient[i] = V2{plane.gradient[i].x * by, plane.gradient[i].y * by};
    plane.above[i] = std::fabs(dot(alpha[i], plane.v));
  }
  return plane;
}

double inner_product(const Plane& a, const Plane& b) {
  return dot(a.gradient[0], b.gradient[0]) + dot(a.gradient[1], b.gradient[1]);
}

void turn_round(Plane* plane) {
  plane->v = V2{-plane->v.x, -plane->v.y};
  for (V2& g : plane->gradient) g = V2{-g.x, -g.y};
}

Arc arc_between(const Plane& first, const Plane& last) {
  Arc arc;
  for (int i = 0; i < 2; ++i) {
    arc.a[i] = first.above[i];
    arc.b[i] = last.above[i];
    arc.A[i] = dot(first.gradient[i], first.gradient[i]);
    arc.B[i] = dot(first.gradient[i], last.gradient[i]);
    arc.C[i] = dot(last.gradient[i], last.gradient[i]);
  }
  return arc;
}

void improve(const Plane& first, const Plane& last, const Arc& arc, double* best, V2* v) {
  const double t = search_arc(arc, best);
  if (t < 0.0) return;
  *v = V2{(1.0 - t) * first.v.x + t * last.v.x, (1.0 - t) * first.v.y + t * last.v.y};
}

// The planes of the two pixels divide the pencil into two arcs; the longer one is halved. Along an
// arc that has no pixel's plane inside it, each distance first rises and then falls at most once,
// so its least value is at one of the ends.
V2 plane_of_least_distances(const EpipolarPencil& pencil, V2 alpha0, V2 alpha1) {
  const V2 alpha[2] = {alpha0, alpha1};
  if (cross(alpha0, alpha1) == 0.0) {
    // Both pixels lie on a common plane already. If pixel 0 is on its epipole, pixel 1 determines
    // the plane.
    return dot(alpha0, alpha0) > 0.0 ? normal_of(alpha0) : normal_of(alpha1);
  }
  Plane own[2] = {scaled_plane(pencil, alpha, normal_of(alpha0)),
                  scaled_plane(pencil, alpha, normal_of(alpha1))};
  own[0].above[0] = 0.0;
  own[1].above[1] = 0.0;
  if (inner_product(own[0], own[1]) < 0.0) turn_round(&own[1]);
  const double at[2] = {distance(own[0], 1), distance(own[1], 0)};
  double best = at[0] <= at[1] ? at[0] : at[1];
  V2 v = at[0] <= at[1] ? own[0].v : own[1].v;

  const Arc shorter = arc_between(own[0], own[1]);
  if (!is_surely_monotonic(shorter)) improve(own[0], own[1], shorter, &best, &v);

  // The middle of the longer arc: orthogonal, for the product of `inner_product`, to the middle of
  // the shorter one.
  V2 sum[2];
  for (int i = 0; i < 2; ++i) {
    sum[i] = V2{own[0].gradient[i].x + own[1].gradient[i].x,
                own[0].gradient[i].y + own[1].gradient[i].y};
  }
  const auto along = [&](int k) {
    const double(&s)[2][2][2] = pencil.step;
    return (s[0][k][0] * sum[0].x + s[0][k][1] * sum[0].y) +
           (s[1][k][0] * sum[1].x + s[1][k][1] * sum[1].y);
  };
  Plane middle = scaled_plane(pencil, alpha, normal_of(V2{along(0), along(1)}));
  for (int i = 0; i < 2; ++i) {
    // Between the plane of pixel 1 - i and the middle, the distance in image i is at least that at
    // the middle. If this is `best` or more, that half of the arc holds no better plane.
    if (distance(middle, i) >= best) continue;
    if (inner_product(own[1 - i], middle) < 0.0) turn_round(&middle);
    improve(own[1 - i], middle, arc_between(own[1 - i], middle), &best, &v);
  }
  return v;
}

}  // namespace

void set_pencil_axes(const Vec3& center1, const Mat3& cam1_from_cam0_R, EpipolarPencil* pencil) {
  complete_basis(center1, &pencil->axis[0][0], &pencil->axis[0][1]);
  for (int k = 0; k < 2; ++k) pencil->axis[1][k] = rotate(cam1_from_cam0_R, pencil->axis[0][k]);
}

void set_pencil_steps(const RayFrame& frame0, const RayFrame& frame1, EpipolarPencil* pencil) {
  const RayFrame* frames[2] = {&frame0, &frame1};
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 2; ++k) {
      for (int b = 0; b < 2; ++b) {
        pencil->step[i][k][b] = dot(pencil->axis[i][k], frames[i]->basis[b]) * frames[i]->pixel[b];
      }
    }
  }
  const double(&s0)[2][2] = pencil->step[0];
  const double(&s1)[2][2] = pencil->step[1];
  double M[2][2];
  for (int a = 0; a < 2; ++a) {
    for (int b = 0; b < 2; ++b) M[a][b] = s0[0][a] * s1[1][b] - s0[1][a] * s1[0][b];
  }
  V2 turn[2];
  diagonalise(M, &turn[0], &turn[1], pencil->singular);
  for (int i = 0; i < 2; ++i) {
    for (int k = 0; k < 2; ++k) {
      const double* row = pencil->step[i][k];
      pencil->turned[i][k][0] = row[0] * turn[i].x + row[1] * turn[i].y;
      pencil->turned[i][k][1] = row[1] * turn[i].x - row[0] * turn[i].y;
    }
  }
}

Correction correct_rays(PixelCost cost, const EpipolarPencil& pencil, const RayFrame& frame0,
                        const RayFrame& frame1) {
  const RayFrame* frames[2] = {&frame0, &frame1};
  const V2 alpha[2] = {coordinates(pencil, 0, frame0.ray), coordinates(pencil, 1, frame1.ray)};
  V2 v = cost == PixelCost::kSumOfSquares ? plane_of_least_squares(pencil, alpha[0], alpha[1])
                                          : plane_of_least_distances(pencil, alpha[0], alpha[1]);
  if (v.x == 0.0 && v.y == 0.0) v.x = 1.0;  // both pixels on their epipoles: any plane fits
  Correction correction;
  for (int i = 0; i < 2; ++i) {
    const V2 across = gradient(pencil.step[i], v);
    const double by = -dot(alpha[i], v) / dot(across, across);
    correction.step[i][0] = by * across.x;
    correction.step[i][1] = by * across.y;
    const Vec3 moved = combine(correction.step[i][0] * frames[i]->pixel[0], frames[i]->basis[0],
                               correction.step[i][1] * frames[i]->pixel[1], frames[i]->basis[1]);
    correction.ray[i] = combine(1.0, frames[i]->ray, 1.0, moved);
  }
  return correction;
}

}  // namespace tv
