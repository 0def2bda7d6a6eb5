// The strings of statuses, kernel sets, kinds, verdicts and reasons, and of the library's version;
// all are constants.
#include "twoview/status.h"

#include "api/enum_value.h"
#include "twoview/context.h"
#include "twoview/two_view.h"

const char *tv_status_string(tv_status status) {
  switch (tv::enum_value(status)) {
    case TV_OK: return "ok";
    case TV_ERR_NULL: return "a required pointer is null";
    case TV_ERR_ARGUMENT: return "an argument is out of its range";
    case TV_ERR_NOT_FINITE: return "a number is not finite";
    case TV_ERR_STRUCT_SIZE: return "struct_size was not set, or a field is of a newer version";
    case TV_ERR_ALIGNMENT: return "memory is not aligned";
    case TV_ERR_MEMORY: return "memory is too small";
    case TV_ERR_LIMITS: return "above the limits or the purposes of the context";
    case TV_ERR_CAPACITY: return "an output array is too small";
    case TV_ERR_OVERLAP: return "an output array overlaps another argument";
    case TV_ERR_CAMERA: return "camera intrinsics are invalid, or for another image size";
    case TV_ERR_OUTSIDE: return "outside the valid region of the lens model";
    case TV_ERR_KERNELS: return "this CPU or build lacks the kernel set";
    case TV_ERR_MAP: return "the bytes are no map of this version";
    case TV_ERR_TIME: return "the time is not later than that of the frame before";
    case TV_ERR_STRIDE: return "the image's stride does not fit its width";
    case TV_ERR_MASK: return "the mask is not of its image's size";
    case TV_ERR_EFFORT: return "the effort is above max_effort of the context's limits";
    default: return "unknown status";
  }
}

const char *tv_version_string(void) { return TV_VERSION_STRING; }

const char *tv_kernels_string(tv_kernels kernels) {
  switch (tv::enum_value(kernels)) {
    case TV_KERNELS_AUTO: return "auto";
    case TV_KERNELS_C: return "c";
    case TV_KERNELS_SSE2: return "sse2";
    case TV_KERNELS_AVX2: return "avx2";
    case TV_KERNELS_AVX512: return "avx512";
    case TV_KERNELS_NEON: return "neon";
    default: return "unknown";
  }
}

const char *tv_kind_string(tv_kind kind) {
  switch (tv::enum_value(kind)) {
    case TV_KIND_DEGENERATE: return "degenerate";
    case TV_KIND_CALIBRATED: return "calibrated";
    case TV_KIND_UNCALIBRATED: return "uncalibrated";
    case TV_KIND_PLANAR: return "planar";
    case TV_KIND_PANORAMIC: return "panoramic";
    case TV_KIND_PLANAR_OR_PANORAMIC: return "planar_or_panoramic";
    case TV_KIND_NO_MOTION: return "no_motion";
    default: return "unknown";
  }
}

const char *tv_verdict_string(tv_verdict verdict) {
  switch (tv::enum_value(verdict)) {
    case TV_VERDICT_REFUSED: return "refused";
    case TV_VERDICT_DOUBTFUL: return "doubtful";
    case TV_VERDICT_OK: return "ok";
    default: return "unknown";
  }
}

const char *tv_reason_string(tv_reason reason) {
  switch (tv::enum_value(reason)) {
    case TV_REASON_TOO_FEW_MATCHES: return "too_few_matches";
    case TV_REASON_LOW_INLIER_RATIO: return "low_inlier_ratio";
    case TV_REASON_LOW_PARALLAX: return "low_parallax";
    case TV_REASON_TWO_PLANAR_SOLUTIONS: return "two_planar_solutions";
    case TV_REASON_PURE_ROTATION: return "pure_rotation";
    case TV_REASON_NO_MOTION: return "no_motion";
    case TV_REASON_SECOND_MOTION: return "second_motion";
    case TV_REASON_CROWDED_MATCHES: return "crowded_matches";
    case TV_REASON_REPEATED_STRUCTURE: return "repeated_structure";
    case TV_REASON_CAMERA_CONTRADICTED: return "camera_contradicted";
    default: return "unknown";
  }
}
