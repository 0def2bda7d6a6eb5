// Replaces recording_input.cc in a program without the AR.Drone driver: there is no option
// --recording.
#include "recording/recording_input.h"

#include <CLI/App.hpp>
#include <nlohmann/json.hpp>

namespace cli {

struct RecordingInput::State {};

void RecordingOptions::add_to(CLI::App&) {}

RecordingInput::RecordingInput(const RecordingOptions&, const std::string&) {}
RecordingInput::~RecordingInput() = default;
int RecordingInput::width() const { return 0; }
int RecordingInput::height() const { return 0; }
void RecordingInput::load(const tv_camera&, Session&, const Options&, const Progress&, Outcome&) {}
void RecordingInput::add_gravity(tv_estimate_options&) {}
void RecordingInput::add_scale(Outcome&) const {}
void RecordingInput::add_json(Outcome&) const {}
std::string RecordingInput::words(const Outcome&) const { return {}; }

}  // namespace cli
