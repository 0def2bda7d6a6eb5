#include "pair/reconstruct_pair.h"

#include <algorithm>

#include "base/error.h"

namespace cli {

uint64_t reconstruct_pair(Session& session, const Options& options, Outcome& outcome) {
  const Picture &p0 = outcome.picture[0], &p1 = outcome.picture[1];
  tv_context* context =
      session.context(std::max(p0.luma.cols, p1.luma.cols), std::max(p0.luma.rows, p1.luma.rows));
  tv_view views[2];
  const tv_image masks[2] = {p0.mask_view(), p1.mask_view()};
  for (int i = 0; i < 2; ++i) {
    tv_view_init(&views[i]);
    views[i].image = outcome.picture[i].view();
    views[i].mask = masks[i].data ? &masks[i] : nullptr;
    views[i].camera = outcome.has_cameras ? &outcome.camera[i] : nullptr;
  }
  tv_two_view_init(&outcome.two_view);
  tv_evidence_init(&outcome.evidence);
  tv_reconstruction_init(&outcome.reconstruction);
  tv_reconstruct_options stages;
  tv_reconstruct_options_init(&stages);
  stages.triangulation = options.triangulation;
  stages.guided_matching = options.guided_matching;
  stages.align_matches = options.align_matches;
  stages.bundle_adjustment = options.bundle_adjustment;
  stages.sigma_by_size = options.sigma_by_size;
  stages.effort = options.first_rung();
  stages.max_effort = options.highest_rung();
  outcome.tried_hardest = options.highest_rung() == kHighestRung;
  stages.feature = &options.feature;
  stages.match = &options.match;
  stages.estimate = &options.estimate;
  const uint64_t start_ns = now_ns();
  const tv_status status = tv_reconstruct(context, &views[0], &views[1], &stages, &outcome.two_view,
                                          &outcome.evidence, &outcome.reconstruction);
  const uint64_t total_ns = now_ns() - start_ns;
  if (status != TV_OK)
    throw BadInput("cannot reconstruct " + p0.path + " and " + p1.path + " with --method " +
                   method_name(options.estimate.method) + ": " + tv_status_string(status));
  return total_ns;
}

}  // namespace cli
