// Poses of a pair as another program may have meant them, when they were read as cam1_from_cam0
// with x to the right, y down and z ahead.
#pragma once

#include <string>
#include <vector>

#include "base/matrix.h"

namespace cli {

struct PairReading {
  const char* words;  // what the pose is then
  Matrix3 R;
  Vector3 t;
};
// The first one is the other direction.
std::vector<PairReading> other_readings(const Matrix3& R, const Vector3& t);

// A line where an estimate R, t is far from a true pose and near another reading of it; empty where
// it is not.
std::string reading_words(const Matrix3& R, const Vector3& t, const Matrix3& R_true,
                          const Vector3& t_true);

// In degrees: what counts as near a pose, and as far from one.
constexpr double kNearPoseDeg = 5, kFarPoseDeg = 10;

}  // namespace cli
