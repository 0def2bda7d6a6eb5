// Fuzzes tv_estimate_two_view with any matches and any options, in both orders of the views.
#include "fuzz.h"
#include "support/calls.h"

namespace {

constexpr int kMaxMatches = 80, kMaxSamples = 60;

tv_estimate_options options_of(fuzz::Bytes& bytes) {
  tv_estimate_options options;
  tv_estimate_options_init(&options);
  options.method = bytes.whole(0, 4) - (bytes.raw<uint8_t>() == 255);
  options.max_error_px = bytes.raw<uint8_t>() < 160 ? 1 : bytes.wild(0, 20);
  options.confidence = bytes.wild(0, 1);
  options.max_iterations = bytes.whole(1, kMaxSamples);
  options.fixed_iterations = bytes.whole(0, 3) == 0 ? bytes.whole(0, kMaxSamples) : 0;
  options.seed = bytes.raw<uint64_t>();
  if (bytes.whole(0, 3) == 0 || options.method == TV_SOLVER_UPRIGHT) {
    options.gravity_sigma_rad = bytes.wild(0, 0.5);
    for (double& g : options.gravity0) g = bytes.wild(-1, 1);
    for (double& g : options.gravity1) g = bytes.wild(-1, 1);
  }
  if (bytes.whole(0, 3) == 0) {
    for (tv_calibration* c : {&options.calibration0, &options.calibration1}) {
      c->refine = static_cast<uint32_t>(bytes.whole(0, 4));
      c->focal_sigma = bytes.wild(0, 0.5);
      c->center_sigma = bytes.wild(0, bytes.whole(0, 1) == 0 ? 0.1 : 0.5);
    }
    options.readout_turn_sigma_rad = bytes.wild(0, 0.5);
  }
  return options;
}

// The matches are new ones, copies of earlier ones, ones with equal pixels, and shifted ones.
int matches_of(fuzz::Bytes& bytes, double pixels[2][2 * kMaxMatches], float* ratios,
               float sigmas[2][kMaxMatches]) {
  const int count = bytes.whole(0, kMaxMatches);
  for (int i = 0; i < count; ++i) {
    const int kind = bytes.whole(0, 7), of = i > 0 ? bytes.whole(0, i - 1) : 0;
    for (int v = 0; v < 2; ++v) {
      for (int k = 0; k < 2; ++k) {
        double value = bytes.wild(0, 640);
        if (kind == 0 && i > 0) value = pixels[v][2 * of + k];
        if (kind == 1 && v == 1) value = pixels[0][2 * i + k];
        if (kind >= 4 && v == 1) value = pixels[0][2 * i + k] + 20 - 40 * k * (kind == 5) + i % 7;
        pixels[v][2 * i + k] = value;
      }
    }
    ratios[i] = static_cast<float>(bytes.wild(0, 1));
    for (int v = 0; v < 2; ++v) {
      const int size = bytes.whole(0, 99);  // mostly 1; sometimes equal, extreme or no number
      sigmas[v][i] = size < 60 ? 1 : static_cast<float>(bytes.wild(0.01, size < 98 ? 8 : 1001));
    }
  }
  return count;
}

void require_sound(const tv_two_view& r, const tv_evidence& e, const uint8_t* mask, int count) {
  FUZZ_REQUIRE(fuzz::all_finite(r.R, 9) && fuzz::all_finite(r.t, 3) && fuzz::all_finite(r.E, 9));
  FUZZ_REQUIRE(fuzz::all_finite(r.F, 9) && fuzz::all_finite(r.H, 9));
  FUZZ_REQUIRE(fuzz::all_finite(r.alternative_R, 9) && fuzz::all_finite(r.alternative_t, 3));
  FUZZ_REQUIRE(fuzz::all_finite(r.covariance, 25));
  FUZZ_REQUIRE(fuzz::all_finite(r.principal_point_shift, 2));
  FUZZ_REQUIRE(r.focal_scale >= 0 && fuzz::all_finite(&r.focal_scale, 1));
  FUZZ_REQUIRE(r.focal_sigma >= 0 && fuzz::all_finite(&r.focal_sigma, 1));
  FUZZ_REQUIRE(e.principal_point_chi2 >= 0 && fuzz::all_finite(&e.principal_point_chi2, 1));
  FUZZ_REQUIRE(fuzz::all_finite(e.principal_point_asked_px, 2));
  FUZZ_REQUIRE(fuzz::all_finite(e.principal_point_asked_covariance, 3));
  for (int i = 0; i < 5; ++i) FUZZ_REQUIRE(r.covariance[6 * i] >= 0);
  FUZZ_REQUIRE(std::isfinite(r.median_parallax_rad) && std::isfinite(r.rms_error_px));
  FUZZ_REQUIRE(e.coverage >= 0 && e.coverage <= 1);
  FUZZ_REQUIRE(r.probability_wrong > 0 && r.probability_wrong <= 1);
  FUZZ_REQUIRE((r.has_R && r.has_t) || r.probability_wrong == 1);
  FUZZ_REQUIRE(e.agreement >= 0 && e.agreement <= 1 && e.num_places >= 0);
  FUZZ_REQUIRE(e.region_shift_rad >= 0 && e.region_shift_rad < 3.1416);
  FUZZ_REQUIRE((r.verdict == TV_VERDICT_OK) == (r.reasons == 0));
  int inliers = 0;
  for (int i = 0; i < count; ++i) inliers += mask[i];
  FUZZ_REQUIRE(inliers == r.num_inliers);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static tv_context* const context = fuzz::context(16, 1, kMaxMatches);
  static double pixels[2][2 * kMaxMatches];
  static float ratios[kMaxMatches], sigmas[2][kMaxMatches];
  static uint8_t mask[2][kMaxMatches];
  fuzz::Bytes bytes(data, size);
  const tv_estimate_options options = options_of(bytes);
  const int lens = bytes.whole(0, 3);
  tv_camera cameras[2] = {{TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}},
                          {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {}}};
  if (lens == 1) cameras[0] = fuzz::camera(bytes);
  if (lens == 1) cameras[1] = fuzz::camera(bytes);
  const tv_camera* const given[2] = {lens == 0 ? nullptr : &cameras[0],
                                     lens == 0 ? nullptr : &cameras[1]};
  const int count = matches_of(bytes, pixels, ratios, sigmas);
  const bool with_sigmas = bytes.whole(0, 1) == 1;
  tv_two_view result[2];
  tv_evidence evidence[2];
  tv_status status[2];
  for (int swap = 0; swap < 2; ++swap) {
    tv_two_view_init(&result[swap]);
    tv_evidence_init(&evidence[swap]);
    tv_pixel_pairs pairs = pairs_of(pixels[swap], pixels[1 - swap], ratios, count);
    if (with_sigmas) {
      pairs.sigmas0 = sigmas[swap];
      pairs.sigmas1 = sigmas[1 - swap];
    }
    status[swap] = tv_estimate_two_view(context, given[swap], given[1 - swap], &pairs, &options,
                                        &result[swap], &evidence[swap], mask[swap]);
    if (status[swap] == TV_OK) require_sound(result[swap], evidence[swap], mask[swap], count);
    // With gravity the two orders are not compared: the views' gravities would have to be swapped.
    if (options.gravity_sigma_rad != 0) return 0;
  }
  // Sigmas that are refused for two reasons give the first one's status.
  FUZZ_REQUIRE(status[0] == status[1] || (with_sigmas && status[0] != TV_OK && status[1] != TV_OK));
  if (status[0] != TV_OK) return 0;
  FUZZ_REQUIRE(result[0].kind == result[1].kind && result[0].verdict == result[1].verdict);
  for (int i = 0; i < 9; ++i) FUZZ_REQUIRE(result[0].R[i] == result[1].R[i % 3 * 3 + i / 3]);
  return 0;
}
