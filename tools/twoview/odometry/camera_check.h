// Whether the pictures of a flight contradict the camera that they are said to be of.
// docs/algorithms/focal_length.md.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <string>

#include "odometry/flight.h"
#include "odometry/lens_adjustment.h"

namespace cli {

// What the finished map of the flight is evidence for: whether the given camera is right. It takes
// about a sixth of the flight's time.
CameraEvidence check_camera(const Flight& flight);

// The key camera_check of result.json: null where the map says nothing.
nlohmann::ordered_json camera_check_json(const CameraEvidence& evidence);

// "the pictures contradict the camera: one of a focal length 8.1 % longer (sigma 0.9 %) fits them".
std::string contradiction_words(const CameraEvidence& evidence);

// What is to be done about a camera that the pictures contradict.
inline constexpr const char* kContradictedCameraAdvice =
    "calibrate the camera as it films (twoview calibrate; the same size, zoom and stabilisation), "
    "or let the film tell it (--focal-35mm auto)";

}  // namespace cli
