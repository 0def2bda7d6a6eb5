#include "odometry/camera_check.h"

#include <cmath>

namespace cli {

CameraEvidence check_camera(const Flight& flight) {
  const std::vector<FlightKeyframe> keyframes = flight.keyframes();
  return evidence_on_camera(in_motion(keyframes, flight), flight.points(), flight.camera());
}

nlohmann::ordered_json camera_check_json(const CameraEvidence& evidence) {
  if (!evidence.is_known) return nullptr;
  return {{"contradicted", evidence.contradicts()},
          {"focal_change_percent", 100 * evidence.focal_change},
          {"focal_sigma_percent", 100 * evidence.focal_sigma},
          {"edge_change_percent", 100 * evidence.edge_change},
          {"edge_sigma_percent", 100 * evidence.edge_sigma}};
}

std::string contradiction_words(const CameraEvidence& evidence) {
  char focal[96] = "", lens[96] = "";
  if (evidence.contradicts_focal())
    std::snprintf(focal, sizeof focal, "of a focal length %.1f %% %s (sigma %.1f %%)",
                  100 * std::fabs(evidence.focal_change),
                  evidence.focal_change > 0 ? "longer" : "shorter", 100 * evidence.focal_sigma);
  if (evidence.contradicts_lens())
    std::snprintf(lens, sizeof lens, "%swhose picture is %.1f %% %s at its edge (sigma %.1f %%)",
                  *focal ? " and " : "", 100 * std::fabs(evidence.edge_change),
                  evidence.edge_change > 0 ? "wider" : "narrower", 100 * evidence.edge_sigma);
  return std::string("the pictures contradict the camera: one ") + focal + lens + " fits them";
}

}  // namespace cli
