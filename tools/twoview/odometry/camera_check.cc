#include "odometry/camera_check.h"

#include <cmath>
#include <nlohmann/json.hpp>

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
          {"edge_sigma_percent", 100 * evidence.edge_sigma},
          {"centre_shift_px", evidence.centre_shift_px},
          {"centre_sigma_px", evidence.centre_sigma_px}};
}

std::string contradiction_words(const CameraEvidence& evidence) {
  std::string words;
  const auto add = [&](const char* format, auto... numbers) {
    char text[128];
    std::snprintf(text, sizeof text, format, numbers...);
    words += (words.empty() ? "" : " and ") + std::string(text);
  };
  if (evidence.contradicts_focal())
    add("of a focal length %.1f %% %s (sigma %.1f %%)", 100 * std::fabs(evidence.focal_change),
        evidence.focal_change > 0 ? "longer" : "shorter", 100 * evidence.focal_sigma);
  if (evidence.contradicts_lens())
    add("whose picture is %.1f %% %s at its edge (sigma %.1f %%)",
        100 * std::fabs(evidence.edge_change), evidence.edge_change > 0 ? "wider" : "narrower",
        100 * evidence.edge_sigma);
  if (evidence.contradicts_centre())
    add("whose principal point is (%+.0f, %+.0f) px away (sigma %.0f, %.0f px)",
        evidence.centre_shift_px[0], evidence.centre_shift_px[1], evidence.centre_sigma_px[0],
        evidence.centre_sigma_px[1]);
  return "the pictures contradict the camera: one " + words + " fits them";
}

}  // namespace cli
