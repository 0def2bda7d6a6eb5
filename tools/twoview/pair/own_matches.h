// Matches of another program in the place of the library's: their option, their pixels in the
// pictures as they are used, and the pose and points that they give.
#pragma once

#include <cstdint>
#include <string>
#include <vector>

#include "base/cli_fwd.h"
#include "files/matches_file.h"
#include "pair/options.h"
#include "pair/result.h"
#include "pair/session.h"

namespace cli {

struct OwnMatchOptions {
  std::string path;  // of --matches; empty: the library finds the matches
  // The longer side, in pixels, of the reduced pictures that the other program matched; 0: it
  // matched the full pictures; below 0: not given, and the user is warned where the matches look
  // reduced.
  int resize = -1;

  bool given() const { return !path.empty(); }
  // Adds --matches and --matches-resize, which exclude the options of corners, of descriptors and
  // of their matching: call it after add_common. type: what --help calls the path.
  void add_to(CLI::App& verb, const std::string& help, const std::string& type);
  // Adds the values of --matches and --matches-resize to the options in result.json.
  void add_json(nlohmann::ordered_json& options) const;
};

// Moves the pixels of `matches` to the two pictures as they are used, which may be smaller than
// their files; `name` is the file of the matches. Throws BadInput that names the first match that
// is not finite or not in its picture; for normalised coordinates; and, where `resize` is below 0,
// for matches that leave so much of both pictures empty that they are of smaller ones; and where
// the pixels were meant in another way (pair/match_reading.h). Sets fit_pictures.
void fit_to_pictures(const Picture pictures[2], int resize, const std::string& name,
                     MatchList& matches);

// Estimates from these matches and triangulates their inliers; fills outcome.two_view,
// outcome.reconstruction and outcome.own, where the arrays of the reconstruction lie. Returns the
// wall time of the library's calls in nanoseconds. Throws BadInput when the library refuses.
uint64_t estimate_own_matches(Session& session, const Options& options, const MatchList& matches,
                              Outcome& outcome);

// Notes on what was not used of the file, and on matches at which the pictures do not look alike.
std::vector<std::string> own_match_notes(const MatchList& matches, const std::string& name);

}  // namespace cli
