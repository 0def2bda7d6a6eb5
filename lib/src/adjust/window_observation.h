// One observation of a window: its residual, which is linear in the point over linear in the point,
// and the loss. Derivations: docs/algorithms/window.md. Tests: test/unit/test_window.cc.
#pragma once

#include <cmath>
#include <cstdint>

#include "adjust/block_cholesky.h"
#include "geometry/vector3.h"
#include "twoview/window.h"

namespace tv {

// The residual of a point x in the frame of the camera is J x / (n'x), in units of sigma: J is the
// derivative of the projection at the pixel's own ray, so J ray = 0. A point is in front if n'x >
// 0. J and n come first, as the kernel add_observation takes them.
struct WindowObservation {
  double J[6];  // 2x3, column-major
  double n[3];  // (0, 0, 1); for Kannala-Brandt the unit ray
  int32_t view;
  int32_t slot;  // which one of the point's adjusted views this is; 0 where the view is held
  int32_t idx;   // the index in the caller's array
  int32_t reserved;
};

// False where the pixel has no ray in the lens model. plane: where that meets the plane z = 1, if
// it is known, else null or not a number.
bool make_observation(const Camera& camera, const tv_observation& given, const double* plane,
                      WindowObservation* out);

struct Residual {
  double e[2];
  double inverse_depth;  // 1 / (n'x)
};

// False where the point is not in front of the camera.
inline bool residual_at(const WindowObservation& o, const double x[3], Residual* out) {
  const double depth = (o.n[0] * x[0] + o.n[1] * x[1]) + o.n[2] * x[2];
  // Beyond 89.9999 degrees off the ray. The sum of three bounds the length of x.
  if (!(depth > 1e-6 * ((std::fabs(x[0]) + std::fabs(x[1])) + std::fabs(x[2])))) return false;
  const double inverse = 1.0 / depth;
  out->inverse_depth = inverse;
  out->e[0] = ((o.J[0] * x[0] + o.J[2] * x[1]) + o.J[4] * x[2]) * inverse;
  out->e[1] = ((o.J[1] * x[0] + o.J[3] * x[1]) + o.J[5] * x[2]) * inverse;
  return true;
}

inline double norm_sq(const Residual& r) { return r.e[0] * r.e[0] + r.e[1] * r.e[1]; }

// rho' at the squared residual s, and 2 s rho'' / rho', which is in [-2, 0].
struct LossSlope {
  double weight, bend;
};

inline LossSlope slope_of(const tv_window_options& options, double s) {
  const double c = options.loss_scale_px, c_sq = c * c;
  if (options.loss == TV_LOSS_CAUCHY) {
    const double inverse = 1.0 / (c_sq + s);
    return {c_sq * inverse, -2.0 * s * inverse};
  }
  if (options.loss == TV_LOSS_HUBER && s > c_sq) return {c / std::sqrt(s), -1.0};
  return {1.0, 0.0};
}

// How the second derivative of the loss enters the Hessian.
struct LossCurvature {
  double bend;    // the share of it that is taken, [0, 1], along the residual
  bool averaged;  // instead: all of it, as its mean over all directions
};

// What the kernel add_observation takes of an observation, as nine numbers, where it is linearised:
// h, its derivatives by x, become root (h - along e (e'h)), of which the squares are half its
// Hessian.
struct LinearObservation {
  double x[3];  // the point in the frame of the camera: given
  Residual residual;
  double weight, root, along;
};
static_assert(sizeof(LinearObservation) == 9 * sizeof(double), "as kernels/odometry.h says");

// Fills *out from out->x, the point, which must be in front of the camera.
inline void linearise(const tv_window_options& options, const LossCurvature& curvature,
                      const WindowObservation& o, LinearObservation* out) {
  out->residual = {};
  residual_at(o, out->x, &out->residual);
  const double s = norm_sq(out->residual);
  const LossSlope loss = slope_of(options, s);
  out->weight = loss.weight;
  out->root = 1.0;
  out->along = 0.0;
  if (loss.weight == 1.0) return;
  out->root = std::sqrt(curvature.averaged ? loss.weight * (1.0 + 0.5 * loss.bend) : loss.weight);
  if (curvature.bend > 0.0) {
    // Along the residual, the curvature is 1 + bend of that across it (B. Triggs et al. 1999, 4.3),
    // as far as this is not negative.
    const double kept = std::sqrt(1.0 + curvature.bend * (loss.bend > -1.0 ? loss.bend : -1.0));
    out->along = (1.0 - kept) / s;
  }
}

// A sum of rho. Cauchy's logarithms are taken of products of many arguments, which costs a tenth.
class LossSum {
 public:
  explicit LossSum(const tv_window_options& options) : options_(&options) {}
  void add(double s);
  double value() const;

 private:
  const tv_window_options* options_;
  double sum_ = 0.0, product_ = 1.0;
};

}  // namespace tv
