// Fuzzes tv_estimate_absolute_pose with any matches, lenses and options.
#include "fuzz.h"

namespace {

constexpr int kMaxMatches = 60, kMaxSamples = 60;

tv_absolute_pose_options options_of(fuzz::Bytes& bytes) {
  tv_absolute_pose_options options;
  tv_absolute_pose_options_init(&options);
  options.max_error_px = bytes.raw<uint8_t>() < 160 ? 4 : bytes.wild(0, 20);
  options.confidence = bytes.wild(0, 1);
  options.max_iterations = bytes.whole(1, kMaxSamples);
  options.fixed_iterations = bytes.whole(0, 3) == 0 ? bytes.whole(0, kMaxSamples) : 0;
  options.seed = bytes.raw<uint64_t>();
  if (bytes.whole(0, 3) == 0) {
    options.gravity_sigma_rad = bytes.wild(0, 0.5);
    for (double& g : options.gravity_in_world) g = bytes.wild(-1, 1);
    for (double& g : options.gravity_in_camera) g = bytes.wild(-1, 1);
  }
  return options;
}

struct Matches {
  int count;
  double pixels[2 * kMaxMatches], points[3 * kMaxMatches];
  float ratios[kMaxMatches], sigmas[kMaxMatches];
};

// The matches are any pixels and points, copies of earlier ones, and points that the camera sees at
// their pixels from where the world's origin is, with some noise: on a plane, a line, or anywhere.
void fill(fuzz::Bytes& bytes, const tv_camera& camera, Matches* m) {
  const int shape = bytes.whole(0, 3);
  m->count = bytes.whole(0, kMaxMatches);
  for (int i = 0; i < m->count; ++i) {
    const int kind = bytes.whole(0, 7), of = i > 0 ? bytes.whole(0, i - 1) : 0;
    double *pixel = m->pixels + 2 * i, *point = m->points + 3 * i;
    for (int k = 0; k < 2; ++k) pixel[k] = bytes.wild(0, 640);
    for (int k = 0; k < 3; ++k) point[k] = bytes.wild(-2, 8);
    if (kind == 0 && i > 0) {
      std::memcpy(pixel, m->pixels + 2 * of, 2 * sizeof *pixel);
      std::memcpy(point, m->points + 3 * of, 3 * sizeof *point);
    }
    if (kind >= 3) {
      if (shape < 2) point[2] = 4;
      if (shape == 0) point[1] = point[0];
      double seen[2];
      if (tv_camera_project(&camera, point, seen, nullptr) == TV_OK) {
        for (int k = 0; k < 2; ++k) pixel[k] = seen[k] + bytes.between(-1, 1) * (kind - 3);
      }
    }
    m->ratios[i] = static_cast<float>(bytes.wild(0, 1));
    const int size = bytes.whole(0, 99);  // mostly 1; sometimes equal, extreme or no number
    m->sigmas[i] = size < 60 ? 1 : static_cast<float>(bytes.wild(0.01, size < 98 ? 8 : 1001));
  }
}

void require_rotation(const double R[9]) {
  for (int i = 0; i < 9; ++i) {
    double sum = 0;
    for (int k = 0; k < 3; ++k) sum += R[3 * (i / 3) + k] * R[3 * (i % 3) + k];
    FUZZ_REQUIRE(std::fabs(sum - (i % 4 == 0)) < 1e-6);
  }
}

void require_sound(const tv_absolute_pose& r, const uint8_t* mask, int count) {
  FUZZ_REQUIRE(fuzz::all_finite(r.R, 9) && fuzz::all_finite(r.t, 3));
  FUZZ_REQUIRE(fuzz::all_finite(r.alternative_R, 9) && fuzz::all_finite(r.alternative_t, 3));
  FUZZ_REQUIRE(fuzz::all_finite(r.covariance, 36));
  for (int i = 0; i < 6; ++i) FUZZ_REQUIRE(r.covariance[7 * i] >= 0);
  FUZZ_REQUIRE(std::isfinite(r.rms_error_px) && std::isfinite(r.noise_px));
  FUZZ_REQUIRE(r.coverage >= 0 && r.coverage <= 1);
  FUZZ_REQUIRE((r.verdict == TV_VERDICT_OK) == (r.reasons == 0));
  FUZZ_REQUIRE((r.verdict == TV_VERDICT_REFUSED) == (r.has_pose == 0));
  if (r.has_pose != 0) require_rotation(r.R);
  if (r.has_alternative != 0) require_rotation(r.alternative_R);
  int inliers = 0;
  for (int i = 0; i < count; ++i) inliers += mask[i];
  FUZZ_REQUIRE(inliers == r.num_inliers && r.num_matches == count);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static tv_context* const context = fuzz::context(16, 1, kMaxMatches);
  static Matches m;
  static uint8_t mask[kMaxMatches];
  fuzz::Bytes bytes(data, size);
  const tv_absolute_pose_options options = options_of(bytes);
  tv_camera camera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}};
  const int lens = bytes.whole(0, 3);
  if (lens == 3) camera = fuzz::camera(bytes);
  if (lens == 2) camera.model = TV_CAMERA_KANNALA_BRANDT;
  fill(bytes, camera, &m);
  tv_pixel_points matches;
  tv_pixel_points_init(&matches);
  matches.num = m.count;
  matches.pixels = m.pixels;
  matches.points = m.points;
  matches.ratios = bytes.whole(0, 1) == 0 ? nullptr : m.ratios;
  matches.sigmas = bytes.whole(0, 1) == 0 ? nullptr : m.sigmas;
  tv_absolute_pose result;
  tv_absolute_pose_init(&result);
  const tv_absolute_pose before = result;
  const tv_status status =
      tv_estimate_absolute_pose(context, &camera, &matches, &options, &result, mask);
  if (status == TV_OK) {
    require_sound(result, mask, m.count);
  } else {
    FUZZ_REQUIRE(std::memcmp(&before, &result, sizeof before) == 0);
  }
  return 0;
}
