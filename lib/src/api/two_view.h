// The two halves of tv_estimate_two_view, for a call that adds the descriptors' evidence between
// them.
#pragma once

#include "robust/verdict.h"
#include "twoview/two_view.h"

namespace tv {

// tv_estimate_two_view without the judgement. *evidence is given as Evidence{}; on TV_OK it is that
// of the estimate. The judgement's fields of *result hold zeros.
tv_status estimate_two_view(tv_context* context, const tv_camera* camera0, const tv_camera* camera1,
                            const tv_pixel_pairs* pairs, const tv_estimate_options* options,
                            tv_two_view* result, uint8_t* inlier_mask, Evidence* evidence);

// Writes the judgement as far as the struct_size of *result reaches.
void write_judgement(const Judgement& judgement, tv_two_view* result);

}  // namespace tv
