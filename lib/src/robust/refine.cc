#include "robust/refine.h"

#include <algorithm>
#include <cmath>
#include <utility>

#include "robust/gravity.h"
#include "robust/ldlt.h"
#include "robust/m_estimate.h"
#include "robust/models.h"

namespace tv {
namespace {

// A model without its static type, so that one compiled loop refines all models.
struct AnyModel {
  int num_parameters;
  double (*normal_equations)(const void* model, const RayPairs& pairs, const int32_t* indices,
                             int count, const RobustLoss& loss, double* upper, double* gradient);
  void (*make_step)(const void* model, const double* step, void* moved);
};

// Refines **model and returns its cost. moved: scratch, another object of the same type. On return
// *model points to the one of the two objects that holds the better model.
double refine_any(const AnyModel& any, const RayPairs& pairs, const int32_t* indices, int count,
                  const RobustLoss& loss, int max_iterations, void** model, void* moved,
                  double small_gain, double stretch) {
  constexpr double kSmallStep = 1e-9;
  const int num = any.num_parameters, packed = num * (num + 1) / 2;
  double upper[2][kMostParameters * (kMostParameters + 1) / 2], gradient[2][kMostParameters],
      step[kMostParameters];
  double cost = any.normal_equations(*model, pairs, indices, count, loss, upper[0], gradient[0]);
  Damping damping;
  for (int iteration = 0; iteration < max_iterations; ++iteration) {
    if (!solve_damped(num, upper[0], gradient[0], damping.lambda, step)) break;
    double step_sq = 0;
    for (int p = 0; p < num; ++p) {
      step[p] *= stretch;
      step_sq += step[p] * step[p];
    }
    if (!(step_sq > kSmallStep * kSmallStep)) break;
    any.make_step(*model, step, moved);
    const double new_cost =
        any.normal_equations(moved, pairs, indices, count, loss, upper[1], gradient[1]);
    if (!(new_cost < cost)) {
      if (!damping.tighten()) break;
      continue;
    }
    const double gain = cost - new_cost;
    std::swap(*model, moved);
    cost = new_cost;
    damping.ease();
    std::copy(upper[1], upper[1] + packed, upper[0]);
    std::copy(gradient[1], gradient[1] + num, gradient[0]);
    if (gain < small_gain * cost) break;
  }
  return cost;
}

}  // namespace

template <typename Model>
double refine(const RayPairs& pairs, const int32_t* indices, int count, const RobustLoss& loss,
              int max_iterations, Model* model, double small_gain, double stretch) {
  const AnyModel any = {
      Model::kParameters,
      [](const void* of, const RayPairs& p, const int32_t* i, int n, const RobustLoss& l, double* u,
         double* g) { return static_cast<const Model*>(of)->normal_equations(p, i, n, l, u, g); },
      [](const void* of, const double* step, void* moved) {
        *static_cast<Model*>(moved) = static_cast<const Model*>(of)->stepped(step);
      }};
  Model scratch = *model;
  void* best = model;
  const double cost = refine_any(any, pairs, indices, count, loss, max_iterations, &best, &scratch,
                                 small_gain, stretch);
  if (best != model) *model = scratch;
  return cost;
}

template double refine<PoseModel>(const RayPairs&, const int32_t*, int, const RobustLoss&, int,
                                  PoseModel*, double, double);
template double refine<GravityPoseModel>(const RayPairs&, const int32_t*, int, const RobustLoss&,
                                         int, GravityPoseModel*, double, double);
template double refine<FundamentalModel>(const RayPairs&, const int32_t*, int, const RobustLoss&,
                                         int, FundamentalModel*, double, double);
template double refine<HomographyModel>(const RayPairs&, const int32_t*, int, const RobustLoss&,
                                        int, HomographyModel*, double, double);
template double refine<PlaneModel>(const RayPairs&, const int32_t*, int, const RobustLoss&, int,
                                   PlaneModel*, double, double);
template double refine<RotationModel>(const RayPairs&, const int32_t*, int, const RobustLoss&, int,
                                      RotationModel*, double, double);

}  // namespace tv
