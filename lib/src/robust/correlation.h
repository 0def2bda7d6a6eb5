// What errors that neighbouring matches share add to a covariance. docs/algorithms/covariance.md.
#pragma once

#include "robust/covariance.h"
#include "robust/pose_refiner.h"

namespace tv {

// Adds to `covariance`, 5x5, that of a pose whose matches refiner.indices[0 .. count) give the
// model with this loss, what the matches' errors have in common within each of eight blocks of
// neighbours. With all errors independent, the blocks' gradients u_b have a known size; kappa is
// their measured size over it,
//     kappa = sum u_b' A^-1 u_b / (E[psi^2] / E[w] sum tr(A^-1 A_b (I - A^-1 A_b))),
// A_b a block's normal equations, A those of all. Above 1.35, four times the jackknife's covariance
// is added, in full from 1.55 on: (7/8) sum D_b D_b', where D_b is the Gauss-Newton step of leaving
// block b out (B. Efron, "The jackknife, the bootstrap and other resampling plans", 1982). The
// blocks are made by splitting three times at the mean of the pixel coordinate, of both images,
// that extends farthest. Changes the order of refiner.indices. Returns by how much the mean
// variance grew, at least 1.
double add_correlation(const PoseRefiner& refiner, int count, const PoseModel& model,
                       const RobustLoss& loss, const PoseUncertainty& uncertainty,
                       double covariance[25]);
double add_correlation(const PoseRefiner& refiner, int count, const PlaneModel& model,
                       const RobustLoss& loss, const PoseUncertainty& uncertainty,
                       double covariance[25]);

}  // namespace tv
