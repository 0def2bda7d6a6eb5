// The covariance of one triangulated point, from pixel noise and the covariance of the pose.
// Derivation: docs/algorithms/bundle.md. Tests: test/property/test_bundle_covariance.cc.
#pragma once

#include "robust/bundle_match.h"

namespace tv {

// Computes what tv_point_covariances computes, for one point. pose_covariance: null for an exact
// pose, or 5x5. Returns false, and writes zeros, where the covariance is not known.
bool point_covariance(const Camera cameras[2], const BundleFrame& frame, double baseline,
                      const double* pose_covariance, double noise_px, const tv_point& point,
                      double covariance[9]);

}  // namespace tv
