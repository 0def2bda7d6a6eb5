#include "geometry/relpose_5pt.h"

#include "twoview/context.h"

namespace tv {

void set_sample(Samples5* samples, int s, const Vec3 rays0[5], const Vec3 rays1[5]) {
  for (int k = 0; k < 5; ++k) {
    for (int c = 0; c < 3; ++c) {
      samples->rays[6 * k + c][s] = rays0[k][c];
      samples->rays[6 * k + 3 + c][s] = rays1[k][c];
    }
  }
}

void relpose_5pt(const tvk_geometry_table& kernels, const Samples5& samples, int num_samples,
                 Essentials* models) {
  kernels.relpose_5pt(samples.rays[0], num_samples, models->entries[0][0], models->count);
}

int relpose_5pt(const Vec3 rays0[5], const Vec3 rays1[5], Mat3 essentials[kMaxRelpose5pt]) {
  Samples5 samples;
  for (int s = 0; s < kSamples5; ++s) set_sample(&samples, s, rays0, rays1);
  Essentials models;
  relpose_5pt(*tvk_geometry_of(tvk_select(TV_KERNELS_C)), samples, 1, &models);
  for (int k = 0; k < models.count[0]; ++k) essentials[k] = models.matrix(0, k);
  return models.count[0];
}

}  // namespace tv
