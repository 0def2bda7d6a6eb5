// The turn from frame to frame that a gyro measures: integrated from its rates, freed of the rates'
// constant offset, and carried on through frames whose pictures show nothing. Tests:
// test/unit/test_odometry_gyro.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// The turn previous_from_cam of samples that tv_integrate_gyro has checked.
Mat3 integrated(const tv_gyro_sample* samples, int32_t num, double sigma_rad_s, double begin_s,
                double end_s, double* sigma_rad);

// Predicts the pose of a frame from that of the frame before, or from the one that was predicted
// for it. Without a turn nothing is held.
void hold_turn(Odometry* odometry, const tv_odometry_frame& input, const Frame& frame);

// Both frames were tracked: measures the offset by the difference of the gyro's turn from theirs.
void measure_bias(Odometry* odometry, const Frame& frame);

// The standard deviation of the turn of the held pose, in radians.
double held_sigma(const Gyro& gyro);

// Whether a pose has the attitude of the held one, or none is held.
bool agrees_with_held(const Gyro& gyro, const Rigid& cam_from_world);

}  // namespace tv
