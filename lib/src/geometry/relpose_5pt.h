// Essential matrices from five matched rays, many samples at a time: kernels/relpose_5pt.h.
#pragma once

#include "geometry/camera.h"
#include "kernels/kernels.h"

namespace tv {

inline constexpr int kMaxRelpose5pt = TVK_RELPOSE_MODELS;
inline constexpr int kSamples5 = TVK_WIDTH;  // samples that one call solves

// The five pairs of rays of each sample. A ray may have any length above zero.
struct Samples5 {
  double rays[30][kSamples5];
};
void set_sample(Samples5* samples, int s, const Vec3 rays0[5], const Vec3 rays1[5]);

// The essential matrices of each sample, of Frobenius norm 1 and either sign: those for which the
// five points can all lie in front of both cameras, or all behind both. A degenerate sample has
// none.
struct Essentials {
  double entries[kSamples5][kMaxRelpose5pt][9];
  int32_t count[kSamples5];
  Mat3 matrix(int s, int k) const {
    const double* e = entries[s][k];
    Mat3 E;
    E << e[0], e[1], e[2], e[3], e[4], e[5], e[6], e[7], e[8];
    return E;
  }
};

// All kSamples5 samples must be set, with finite rays; only the first num_samples are solved.
void relpose_5pt(const tvk_geometry_table& kernels, const Samples5& samples, int num_samples,
                 Essentials* models);

// Like relpose_5pt above, for one sample and with the portable kernel. essentials has room for
// kMaxRelpose5pt matrices. Returns how many were written.
int relpose_5pt(const Vec3 rays0[5], const Vec3 rays1[5], Mat3 essentials[kMaxRelpose5pt]);

}  // namespace tv
