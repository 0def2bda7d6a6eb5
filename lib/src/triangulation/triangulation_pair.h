// The pair of cameras that all methods of triangulation work on, prepared once for all points by
// prepare_triangulation (triangulation/triangulation.h).
#pragma once

#include "triangulation/poly.h"

namespace tv {

// What every point needs of the pair. The cameras must live as long as this struct.
struct TriangulationPair {
  const Camera* cameras[2];
  Mat3 cam1_from_cam0_R;
  Mat3 cam0_from_cam1_R;
  Vec3 direction;   // t / |t|
  Vec3 center1;     // camera 1's centre in camera 0's frame, for |t| = 1
  double baseline;  // |t|
  EpipolarPencil pencil;
  bool has_steps;  // the pencil's steps hold for all matches: both cameras have an image plane
};

}  // namespace tv
