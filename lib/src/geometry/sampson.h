// Sampson's distance of matches from a matrix M with f1' M f0 = 0 (an essential or a fundamental
// matrix), its derivatives, and the integer score of a model that sums it over the matches.
//
//     r = f1' M f0 / sqrt(|J0' M' f1|^2 + |J1' M f0|^2),
// in pixels of the images as they are, whatever the lens (P. D. Sampson, 1982; Hartley & Zisserman
// 11.4.3). With rays on the plane z = 1 this is exactly the textbook's formula for a pinhole.
// The kernels that compute many at once are in kernels/sampson.h. Tests:
// test/unit/test_residuals.cc and, for the slopes, test/property/test_principal_point.cc.
#pragma once

#include <cstdint>

#include "geometry/essential.h"
#include "geometry/ray_pairs.h"

namespace tv {

inline constexpr int kCostOne = TVK_SCORE_ONE;  // the cost of an outlier in an integer score

// Squared Sampson distance; +inf for a match both of whose rays lie at the epipoles, where M does
// not constrain them.
double sampson_sq(const RayPairs& pairs, int i, const Mat3& M);

// Sampson's distance with its sign; its slopes by the entries of M, row by row; and its slopes by x
// and y of the principal point that both views share, in pixels. A principal point that moves by d
// moves every ray by -J d, and the Jacobians by the lens's curvature. curvature: d^2 ray / d
// pixel^2 of each view, 3 x (xx, xy, yy), row by row; null counts as zeros. sigmas: by which the
// match's Jacobians and this curvature are multiplied; the principal point's pixels are not.
struct SampsonSlopes {
  double residual, by_entry[9], by_point[2];
};
// The slopes by x and y of each view's own principal point, in pixels, and by the logarithm of each
// view's focal length, of which only the part that comes from the Jacobian's scale, J ~ 1 / f, is
// in by_scale: the ray's own part is by_view . (pixel - principal point).
struct SampsonViewSlopes {
  double by_view[2][2], by_scale[2];
};
// Returns false where both rays of the match lie at the epipoles.
bool sampson_slopes(const RayPairs& pairs, int i, const Mat3& M, const double curvature[2][9],
                    const double sigmas[2], SampsonSlopes* slopes,
                    SampsonViewSlopes* of_views = nullptr);

// Computes sampson_sq of the matches first .. first + count - 1, or of those listed.
void sampson_squares(const RayPairs& pairs, int first, int count, const Mat3& M, double* squares);
void sampson_squares(const RayPairs& pairs, const int32_t* indices, int count, const Mat3& M,
                     double* squares);

// Like sampson_squares, for the essential matrix of a pose that is required to have the matches in
// front of both cameras: +inf also for a match whose depth_vote (geometry/essential.h) is -1, at an
// angle_rad of scale_px times its pixel_angle: its point lies behind a camera by more than noise of
// scale_px pixels explains.
void pose_squares(const RayPairs& pairs, int first, int count, const Pose& pose, double scale_px,
                  double* squares);

// Sum over the matches for scoring (pairs.num of them) of min(r^2 / T^2, 1), T the threshold, each
// truncated to a multiple of 1/kCostOne: an integer, so that neither order nor vector width
// matters. Where the sum is above `bound`, any number above `bound` may be returned. The same
// happens to about one model in fifty whose sum is just below `bound`: the summation is given up
// when its first matches cost too much.
int64_t msac_cost_fast(const RayPairs& pairs, const Mat3& M, double threshold_px, int64_t bound);

}  // namespace tv
