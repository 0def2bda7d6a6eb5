// Triangulation: the point that two rays see. Methods of R. Hartley, P. Sturm, "Triangulation",
// CVIU 68(2), 1997, on rays through the camera models. Derivation:
// docs/algorithms/triangulation.md.
#pragma once

#include "geometry/camera.h"
#include "triangulation/triangulation_pair.h"
#include "twoview/triangulate.h"

namespace tv {

// The sine of the angle between two rays at which they count as parallel. A ray's direction has
// errors of a few units of 2^-53 from the pixel's rounding, the unprojection and the rotation;
// depth is the baseline divided by this sine, so that below 16 * 2^-52 the depth is not determined.
inline constexpr double kParallelSine = 0x1p-48;

// R must be a rotation, and t must not be zero.
TriangulationPair prepare_triangulation(const Camera& camera0, const Camera& camera1, const Mat3& R,
                                        const Vec3& t);
// The same with the motion of a pair, whose prepared cameras are given.
TriangulationPair prepare_triangulation(const Camera& camera0, const Camera& camera1,
                                        const tv_camera_pair& pair);

// Whether the number is a tv_triangulation that this release has.
bool is_triangulation_method(int method);

// Moves both pixels of a match so that their rays meet: with the least sum of the distances moved
// for POLY_ABS, of the squared distances for any other method. frame0 and frame1: frame_of the
// pixels' rays.
Correction correct_match(tv_triangulation method, const TriangulationPair& pair,
                         const RayFrame& frame0, const RayFrame& frame1);

// Corrects a match like correct_match, but from pixels to pixels. Returns false, and leaves
// `corrected` as it was, if a pixel has no ray, if the lens does not see a corrected ray, or if the
// correction is not finite.
bool correct_pixels(tv_triangulation method, const TriangulationPair& pair, const Vec2& pixel0,
                    const Vec2& pixel1, Vec2 corrected[2]);

// Writes every field of *point; nothing in it is ever NaN or infinite.
void triangulate_point(tv_triangulation method, const TriangulationPair& pair, const Vec2& pixel0,
                       const Vec2& pixel1, tv_point* point);

// Like triangulate_point for num matches, pixels num x 2: the points are the same but for rounding.
// A kernel computes several at a time where both lenses are pinholes and the method is Midpoint,
// Linear-LS or Iterative-LS.
void triangulate_points(tv_triangulation method, const TriangulationPair& pair,
                        const double* pixels0, const double* pixels1, size_t num, tv_point* points);

// Like triangulate_point, for unit rays that the caller has already (ray i in camera i's frame,
// through pixel i).
void triangulate_rays(tv_triangulation method, const TriangulationPair& pair, const Vec3& ray0,
                      const Vec3& ray1, const Vec2& pixel0, const Vec2& pixel1, tv_point* point);

void triangulate_point(tv_triangulation method, const Camera& camera0, const Camera& camera1,
                       const Mat3& R, const Vec3& t, const Vec2& pixel0, const Vec2& pixel1,
                       tv_point* point);

}  // namespace tv
