#include "pair/pose_readings.h"

#include <algorithm>

#include "pair/measures.h"

namespace cli {
namespace {

Vector3 negative(const Vector3& t) { return {-t[0], -t[1], -t[2]}; }

}  // namespace

std::vector<PairReading> other_readings(const Matrix3& R, const Vector3& t) {
  const Matrix3 flip = {1, 0, 0, 0, -1, 0, 0, 0, -1};
  const Matrix3 inverse_R = transposed(R);
  const Vector3 inverse_t = negative(applied(inverse_R, t));
  const auto flipped = [&flip](const Matrix3& M) { return product(product(flip, M), flip); };
  std::vector<PairReading> readings = {
      {"cam0_from_cam1, the other direction", inverse_R, inverse_t},
      {"cam1_from_cam0 with the place of camera 1 in t", R, negative(applied(R, t))},
      {"cam1_from_cam0 with OpenGL's axes (y up, z backwards)", flipped(R), applied(flip, t)},
      {"cam0_from_cam1 with OpenGL's axes (y up, z backwards)", flipped(inverse_R),
       applied(flip, inverse_t)}};
  const auto add_mirrored = [&](const char* words, const Matrix3& mirror) {
    readings.push_back({words, product(product(mirror, R), mirror), applied(mirror, t)});
  };
  add_mirrored("cam1_from_cam0 of left-handed axes with y up (Unity's)",
               {1, 0, 0, 0, -1, 0, 0, 0, 1});
  add_mirrored("cam1_from_cam0 of left-handed axes with x to the left",
               {-1, 0, 0, 0, 1, 0, 0, 0, 1});
  add_mirrored("cam1_from_cam0 of left-handed axes with z backwards", {1, 0, 0, 0, 1, 0, 0, 0, -1});
  return readings;
}

std::string reading_words(const Matrix3& R, const Vector3& t, const Matrix3& R_true,
                          const Vector3& t_true) {
  const auto error = [&](const Matrix3& R_read, const Vector3& t_read) {
    return std::max(rotation_error_deg(R, R_read), translation_error_signed_deg(t, t_read));
  };
  if (!(error(R_true, t_true) > kFarPoseDeg)) return "";
  double least = kNearPoseDeg;
  std::string words;
  for (const PairReading& reading : other_readings(R_true, t_true)) {
    const double found = error(reading.R, reading.t);
    if (!(found < least)) continue;
    least = found;
    words = std::string("the truth fits the pose if it is ") + reading.words +
            ": the errors are those against it as cam1_from_cam0";
  }
  return words;
}

}  // namespace cli
