// An image as it would look from the side: squeezed along one direction.
#pragma once

#include <cstddef>
#include <cstdint>

#include "base/arena.h"
#include "kernels/kernels.h"
#include "twoview/image.h"

namespace tv {

// A linear map of the image that shortens lengths along one direction and keeps those across it, up
// to a rotation of the result, which is chosen so that rows stay rows: pixel (u, v) of the squeezed
// image is the mean over the parallelogram of the image that its square comes from. This is the
// anti-aliasing that the levels of the pyramid have, too: an area average, which is `tilt` pixels
// long along the direction and 1 wide across it. All numbers are in 1 / 65536 of a pixel of the
// image, so that squeezed pixels map back exactly, and alike on every CPU.
struct Squeeze {
  int32_t width, height;  // of the squeezed image
  int32_t step_x;         // from a column to the next along a row of the image, at least 65536
  int32_t step_y;         // from a row to the next, at least 65536
  int32_t shear;          // by which a column moves along x from a row of the image to the next
  int64_t first_x;        // where the left edge of column 0 meets the upper edge of the image
};

// The direction (cosine, sine) is that along which the image is squeezed by `tilt`, in [1, 3].
Squeeze make_squeeze(double tilt, double cosine, double sine, int32_t width, int32_t height);

// The point (x, y) of the image that the point (u, v) of the squeezed image comes from.
void to_image(const Squeeze& squeeze, double u, double v, double* x, double* y);

// A squeezed image and its mask, 0 where a pixel is less than kSqueezeMargin pixels from the left
// or the right edge of the image, beyond it, or masked out there. Both are valid as long as the
// arena keeps them; squeeze_scratch is given back.
inline constexpr int32_t kSqueezeMargin = 4;
struct Squeezed {
  tv_image image, mask;
};
Squeezed squeeze_image(const tvk_set& set, const tv_image& image, const tv_image* mask,
                       const Squeeze& squeeze, Arena& arena);

// The most bytes that squeeze_image takes for an image of this size.
size_t squeeze_bytes(const Squeeze& squeeze, int32_t width);

}  // namespace tv
