#include "odometry/move_principal_point.h"

#include <algorithm>
#include <cmath>

#include "odometry/spread.h"

namespace tv {
namespace {

// In focal lengths. A pair counts as evidence where the standard deviation of its shift is at most
// kMostUncertain and the shift at most kFarthest; the principal point is moved no farther, either.
constexpr double kMostUncertain = 0.02, kFarthest = 0.05;
constexpr int32_t kLeastPairs = 6;
// Twice the gain in log-likelihood, in units of the scatter between pairs. Right cameras reach 25
// (docs/decisions/0015-principal-point.md).
constexpr double kLeastGain = 50;

}  // namespace

void add_evidence(const tv_evidence& of_pair, double focal_px, CameraEvidence* evidence) {
  const double* asked = of_pair.principal_point_asked_px;
  const double* C = of_pair.principal_point_asked_covariance;
  const double det = C[0] * C[2] - C[1] * C[1];
  const double most = kMostUncertain * focal_px, farthest = kFarthest * focal_px;
  if (!(det > 0 && C[0] + C[2] <= most * most &&
        asked[0] * asked[0] + asked[1] * asked[1] <= farthest * farthest)) {
    return;
  }
  const double information[3] = {C[2] / det, -C[1] / det, C[0] / det};
  for (int i = 0; i < 3; ++i) evidence->information[i] += information[i];
  for (int i = 0; i < 2; ++i) {
    const double product = information[i] * asked[0] + information[i + 1] * asked[1];
    evidence->product[i] += product;
    evidence->square += product * asked[i];
  }
  ++evidence->num_pairs;
}

Rigid move_principal_point(Odometry* odometry, const double to[2], const double from[2],
                           int32_t first_keyframe) {
  tv_camera model = odometry->given_camera;
  model.cx = to[0];
  model.cy = to[1];
  odometry->camera = prepare_camera(model);
  // The rotation that turns the ray (0, 0, 1) to the ray that now passes through its old pixel.
  const double x = (from[0] - to[0]) / model.fx, y = (from[1] - to[1]) / model.fy;
  const Rigid turn = orthonormalised({{1, 0, x, 0, 1, y, -x, -y, 1}, {0, 0, 0}});
  const Map& map = odometry->map;
  for (int32_t k = first_keyframe; k < map.num_keyframes; ++k) {
    MapKeyframe* keyframe = &map.keyframes[k];
    keyframe->cam_from_world = compose(turn, keyframe->cam_from_world);
    if (keyframe->described >= 0) forget_planes(map, *keyframe);
  }
  return turn;
}

void correct_camera(Odometry* odometry, Frame* frame) {
  CameraEvidence* e = &odometry->camera_evidence;
  if (e->num_pairs < std::max(e->next_num, kLeastPairs)) return;
  const double* W = e->information;
  const double det = W[0] * W[2] - W[1] * W[1];
  const double shift[2] = {(W[2] * e->product[0] - W[1] * e->product[1]) / det,
                           (W[0] * e->product[1] - W[1] * e->product[0]) / det};
  const double gain = shift[0] * e->product[0] + shift[1] * e->product[1];
  // The chi-square of the pairs' principal points about their common estimate, divided by its
  // degrees of freedom.
  const double scatter = std::max((e->square - gain) / (2 * (e->num_pairs - 1)), 1.0);
  // A small common bias becomes significant with many pairs; so the gain must exceed that of the
  // noise of each pair.
  const double least = std::max(kLeastGain, static_cast<double>(e->num_pairs));
  const tv_camera &now = odometry->camera.model, &given = odometry->given_camera;
  const double from[2] = {now.cx, now.cy};
  const double to[2] = {now.cx + shift[0], now.cy + shift[1]};
  const double x = to[0] - given.cx, y = to[1] - given.cy;
  const double way = std::sqrt(x * x + y * y);
  if ((e->next_num == 0 && !(gain >= least * scatter)) || !(way <= kFarthest * now.fx)) return;
  e->next_num = 2 * e->num_pairs;
  e->product[0] = e->product[1] = 0;
  const Rigid turn = move_principal_point(odometry, to, from, 0);
  frame->cam_from_world = compose(turn, frame->cam_from_world);
  odometry->weak_loop.frame = -1;
  if (odometry->map.num_keyframes > 0) begin_spread(odometry, odometry->segment, 0);
}

}  // namespace tv
