// The camera of a film of which nothing is known: estimated from pairs of frames, then from maps
// that are made of the film with the estimate so far. docs/algorithms/focal_length.md.
#pragma once

#include <functional>
#include <nlohmann/json_fwd.hpp>
#include <optional>
#include <string>

#include "odometry/flight.h"
#include "pair/simple_lens.h"

namespace cli {

struct FilmLens {
  SimpleLens lens;  // of the frames as the source gives them
  int width = 0, height = 0;
  double sigma = 0;          // relative standard deviation of the focal length
  bool is_uncertain = true;  // sigma is above kMostFocalSigma, or the film does not tell it

  tv_camera camera() const { return camera_of_lens(lens, width, height); }
  double focal_35mm() const { return focal_35mm_of(lens.focal_px, width, height); }
  // The key focal_length of result.json.
  nlohmann::ordered_json json() const;
  // "27.3 mm (35 mm equivalent) +- 0.5 %", with the coefficients where a map determined them.
  std::string words() const;
};

// What is to be done about a focal length that is doubtful.
inline constexpr const char* kDoubtfulFocalAdvice =
    "turn while you move, give --focal-35mm where you know it, or calibrate the camera "
    "(twoview calibrate)";

// Runs the source up to four times, so that a live source does not serve. `options` are those of
// the flight that is to follow. `progress` is called with a sentence on each step. Throws BadInput
// as Flight does.
FilmLens estimate_film_lens(FrameSource& source, const FlightOptions& options,
                            const std::atomic<bool>& stop,
                            const std::function<void(const std::string&)>& progress);

}  // namespace cli
