// Samples the patch of a keypoint and passes it to the kernels of kernels/describe.h. Problem and
// formulas: docs/algorithms/sift.md; tests: test/unit/test_orientation.cc and test_sift_opencv.cc.
#include "feature/describe.h"

#include <algorithm>

#include "base/math.h"

namespace tv {
namespace {

// A spatial bin is 1.5 keypoint sizes wide (Lowe's 3 sigma with size = 2 sigma). Samples of the
// descriptor are 0.28 bins apart.
constexpr double kStepPerSize = 1.5 * 0.28;

// Samples of the orientation are a quarter of a bin apart, which finds the angle to half a degree;
// at a third of a bin the error is a degree.
constexpr double kOrientStep = 1.5 / 4.0;

// Samples of the descriptor are 1.12 to 2.24 pixels of their octave apart. Closer samples would be
// blurred, and wider ones would alias (docs/decisions/0003-patch-sift.md).
constexpr double kMaxStep = 2.24;

// The histogram of a pooled descriptor is the mean over two windows: the keypoint's window scaled
// by each of these factors (docs/decisions/0003-patch-sift.md).
constexpr double kPooledSizes[2] = {0.7, 1.3};

constexpr int32_t kBlock = TVK_QUANTIZED;  // keypoints

// A second peak is a direction of its own if it is above this share of the highest peak (Lowe,
// section 5).
constexpr double kSecondPeak = 0.8;

const Octave& octave_for(const Octaves& octaves, double size) {
  const int32_t octave = octave_of(size);
  return octaves.octaves[octave < octaves.count ? octave : octaves.count - 1];
}

// In pixels of the octave. A keypoint farther outside the image is moved to this distance; its
// samples are border pixels either way. This keeps the positions of all samples within 32 bits for
// images up to 16384 pixels and steps of at most kLargestStep.
constexpr double kMaxOutside = 8192.0;

// In pixels of the octave. Only keypoints above 512 pixels in images that are too thin for octaves
// have a larger step, which is replaced by this one.
constexpr double kLargestStep = 256.0;

// Without a branch: the sign is random, and a wrong guess costs as much as ten additions.
int32_t to_q16(double x) {
  const double scaled = x * 65536.0;
  return static_cast<int32_t>(scaled + __builtin_copysign(0.5, scaled));
}

double near_image(double x, int32_t side) {
  return x < -kMaxOutside ? -kMaxOutside : x > side + kMaxOutside ? side + kMaxOutside : x;
}

// Of the x axis of a patch.
struct Direction {
  double cosine, sine;
};

constexpr Direction kUpright = {1.0, 0.0};

// Samples a square patch of side x side samples that is centred on the keypoint and whose x axis
// has this direction, with the step of a keypoint of this size.
void sample_around(const tvk_describe_table& kernels, const Octaves& octaves,
                   const tv_keypoint& keypoint, double size, Direction direction,
                   double step_per_size, int32_t side, int16_t* patch) {
  const Octave& octave = octave_for(octaves, size);
  const double wanted = size * step_per_size / octave.scale;
  const double step = wanted < kLargestStep ? wanted : kLargestStep;
  const int32_t du_x = to_q16(step * direction.cosine), du_y = to_q16(step * direction.sine);
  // The position of the first sample, half a patch before the centre along both axes.
  const double half = 0.5 * (side - 1);
  const int32_t x = to_q16(near_image(to_level(octave.scale, keypoint.x), octave.width)) -
                    static_cast<int32_t>(half * (du_x - du_y));
  const int32_t y = to_q16(near_image(to_level(octave.scale, keypoint.y), octave.height)) -
                    static_cast<int32_t>(half * (du_y + du_x));
  kernels.sample_patch(octave.pairs, octave.width, octave.height, x, y, du_x, du_y, side, patch);
}

// The angle, in (-pi, pi], at the top of the parabola through a bin and its two neighbours.
// smooth[1 + k] is bin k.
float peak_angle(const int32_t* smooth, int32_t bin) {
  const double left = static_cast<double>(smooth[bin]);
  const double middle = static_cast<double>(smooth[bin + 1]);
  const double right = static_cast<double>(smooth[bin + 2]);
  const double curvature = left - 2.0 * middle + right;
  const double shift = curvature < 0.0 ? 0.5 * (left - right) / curvature : 0.0;
  const double turn = (bin + shift) / TVK_ORIENT_BINS;
  const double nearest_turn = turn - (turn > 0.5 ? 1.0 : 0.0);
  const float angle_rad = static_cast<float>(nearest_turn * 2.0 * kPi);
  return angle_rad == 0.0f ? 0.0f : angle_rad;
}

Direction direction_of(float angle_rad) {
  Direction direction = kUpright;
  if (angle_rad != 0) sincos(angle_rad, &direction.sine, &direction.cosine);
  return direction;
}

void histogram_of(const tvk_describe_table& kernels, const Octaves& octaves,
                  const tv_keypoint& keypoint, Direction direction, int32_t pooling,
                  int32_t* histogram) {
  constexpr int32_t kPatch = TVK_PATCH_SIDE * TVK_PATCH_SIDE;
  int16_t patches[2 * kPatch + 1];
  const int32_t num_patches = pooling != 0 ? 2 : 1;
  for (int32_t n = 0; n < num_patches; ++n) {
    const double factor = pooling != 0 ? kPooledSizes[n] : 1.0;
    sample_around(kernels, octaves, keypoint, keypoint.size * factor, direction, kStepPerSize,
                  TVK_PATCH_SIDE, patches + n * kPatch);
  }
  kernels.gradient_histogram(patches, num_patches, histogram);
}

}  // namespace

int32_t octave_of(double keypoint_size) {
  double step = keypoint_size * kStepPerSize;
  int32_t octave = 0;
  while (step >= kMaxStep && octave + 1 < kMaxOctaves) {
    step *= 0.5;
    ++octave;
  }
  return octave;
}

OctaveRange octave_range(const tv_keypoint* keypoints, int32_t count, int32_t pooling) {
  double smallest = count > 0 ? keypoints[0].size : 0.0, largest = smallest;
  for (int32_t k = 1; k < count; ++k) {
    const double size = keypoints[k].size;
    if (size < smallest) smallest = size;
    if (size > largest) largest = size;
  }
  if (pooling != 0) {
    smallest *= kPooledSizes[0];
    largest *= kPooledSizes[1];
  }
  return OctaveRange{octave_of(smallest), octave_of(largest)};
}

int32_t dominant_angles(const tvk_set& set, const Octaves& octaves, const tv_keypoint& keypoint,
                        float angles_rad[2]) {
  const tvk_describe_table& kernels = *tvk_describe_of(&set);
  int16_t patch[TVK_ORIENT_SIDE * TVK_PATCH_SIDE + 1];
  int32_t smooth[TVK_ORIENT_BINS + 2], peaks[2];
  sample_around(kernels, octaves, keypoint, keypoint.size, kUpright, kOrientStep, TVK_ORIENT_SIDE,
                patch);
  kernels.orientation_histogram(patch, smooth, peaks);
  angles_rad[0] = peak_angle(smooth, peaks[0]);
  if (peaks[1] < 0 || static_cast<double>(smooth[1 + peaks[1]]) <=
                          kSecondPeak * static_cast<double>(smooth[1 + peaks[0]])) {
    return 1;
  }
  angles_rad[1] = peak_angle(smooth, peaks[1]);
  return 2;
}

void describe_keypoints(const tvk_set& set, const Octaves& octaves, const tv_keypoint* keypoints,
                        int32_t count, int32_t kind, int32_t pooling, uint8_t* descriptors) {
  const tvk_describe_table& kernels = *tvk_describe_of(&set);
  const int32_t root = kind == TV_NORMALISATION_ROOTSIFT;
  for (int32_t first = 0; first < count; first += kBlock) {
    const int32_t num = std::min(kBlock, count - first);
    // Directions and bytes are computed for a block at once: both are long chains of operations,
    // and those of several keypoints overlap.
    Direction directions[kBlock];
    int32_t histograms[kBlock][TVK_DESCRIPTOR_SIZE];
    for (int32_t k = 0; k < num; ++k) directions[k] = direction_of(keypoints[first + k].angle_rad);
    for (int32_t k = 0; k < num; ++k) {
      histogram_of(kernels, octaves, keypoints[first + k], directions[k], pooling, histograms[k]);
    }
    kernels.quantize_descriptors(histograms[0], num, root,
                                 descriptors + static_cast<size_t>(first) * TV_DESCRIPTOR_BYTES);
  }
}

}  // namespace tv
