#include "sources/film.h"

#include <algorithm>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <opencv2/imgproc.hpp>
#include <opencv2/videoio.hpp>

#include "base/error.h"
#include "sources/decoder_errors.h"
#include "sources/film_container.h"
#include "sources/joined_films.h"
#include "sources/stream_clock.h"

namespace cli {
namespace {

// A container that keeps whole milliseconds (Matroska) moves each time by up to 0.5 ms, and so two
// intervals apart by up to 2 ms.
constexpr double kRounding_s = 0.0022, kSteadyShare = 0.04;
// A film whose pictures end earlier than its header says by more than both may be cut off.
constexpr double kMissing_s = 1, kMissingShare = 0.05;
constexpr int kClockTrials = 3;
constexpr double kClockUnit_s = 1e-6;  // below the unit of any container's clock

std::string text_of(const char* format, double value) {
  char text[48];
  std::snprintf(text, sizeof text, format, value);
  return text;
}

// Without this, libav prints lines of its own on stderr while a film is opened and decoded.
void silence_decoders() { ::setenv("OPENCV_FFMPEG_LOGLEVEL", "-8", 0); }

bool open_capture(cv::VideoCapture& film, const std::string& path) {
  silence_decoders();
  try {
    // FFmpeg's backend is preferred: the other backends of OpenCV report the position of the next
    // picture.
    if (!film.open(path, cv::CAP_FFMPEG) && !film.open(path)) return false;
  } catch (const cv::Exception&) {
    return false;
  }
  film.set(cv::CAP_PROP_ORIENTATION_AUTO, 0);
  return true;
}

double position_s(const cv::VideoCapture& film) { return 1e-3 * film.get(cv::CAP_PROP_POS_MSEC); }

// Whether the positions of the first pictures rise: a container may have a clock and not use it.
bool clock_runs(const std::string& path) {
  cv::VideoCapture film;
  if (!open_capture(film, path) || film.getBackendName() != "FFMPEG") return false;
  double first = 0;
  for (int k = 0; k < kClockTrials; ++k) {
    if (!film.grab()) return k < 2;  // one picture alone shows no clock that stands
    if (k == 0) first = position_s(film);
    if (position_s(film) > first) return true;
  }
  return false;
}

}  // namespace

const char* times_name(FilmFacts::Times times) {
  return times == FilmFacts::Times::kContainer ? "container"
         : times == FilmFacts::Times::kRate    ? "rate"
                                               : "given";
}

struct Film::State {
  std::string path;
  cv::VideoCapture capture;
  FilmContainer container;
  FilmFacts facts;
  double step_s = 0;  // between two pictures, where the times come from a rate
  StreamClock clock;
  double first_s = 0;  // the container's time of the first picture
  double clock_s = 0;  // the container's time of the picture before, from first_s on
  double time_s = 0;
  int64_t index = -1, num_pictures = 0;
  std::unique_ptr<FilmPackets> packets;  // read as far as the pictures
  std::vector<double> times;             // of the container, where OpenCV does not say a picture's

  double time_of_picture() {
    if (facts.times != FilmFacts::Times::kContainer) return static_cast<double>(index) * step_s;
    const double position = position_s(capture);
    if (index == 0) first_s = position;
    return (position == 0 && index > 0 ? next_container_time() : position) - first_s;
  }
  double next_container_time();
  bool is_other_size();
  void add_interval(double interval_s);
  double mean_interval_s() const;
  void end();
};

// OpenCV 4.6 (Debian 12) says 0 for the pictures that its decoder holds back until the end of the
// file, which are as many as it has threads: their times are the container's next ones.
double Film::State::next_container_time() {
  if (times.empty()) times = picture_times(path);
  const double last = clock_s + first_s;
  const auto next = std::find_if(times.begin(), times.end(),
                                 [&](double time) { return time > last + kClockUnit_s; });
  return next == times.end() ? last : *next;
}

// Whether the picture is of another size than the header's. A film may have more packets than
// pictures (two fields, frames that are not shown), and so a clock says how far to read them.
bool Film::State::is_other_size() {
  const bool has_clock = facts.times == FilmFacts::Times::kContainer;
  while (packets->num() <= index ||
         (has_clock && packets->time_s() < clock_s + first_s - kClockUnit_s))
    if (!packets->next()) break;
  const int width = packets->width(), height = packets->height();
  if (width == 0 || (width == container.width && height == container.height)) return false;
  if (facts.num_other_size++ == 0) facts.other_width = width, facts.other_height = height;
  return true;
}

void Film::State::add_interval(double interval_s) {
  const bool is_first = !(facts.shortest_s > 0);
  facts.shortest_s = is_first ? interval_s : std::min(facts.shortest_s, interval_s);
  facts.longest_s = is_first ? interval_s : std::max(facts.longest_s, interval_s);
  facts.is_variable =
      facts.longest_s - facts.shortest_s > std::max(kRounding_s, kSteadyShare * facts.shortest_s);
}

// The mean interval between pictures, without the intervals in which the film's clock began anew.
double Film::State::mean_interval_s() const {
  const int64_t num_anew = clock.num_begun_anew(), num = num_pictures - 1 - num_anew;
  const double seconds = time_s - static_cast<double>(num_anew) * StreamClock::kPause_s;
  return num > 0 ? seconds / static_cast<double>(num) : 0;
}

void Film::State::end() {
  const double interval_s = mean_interval_s();
  if (facts.times == FilmFacts::Times::kContainer && container.duration_s > 0)
    facts.missing_s = std::max(0.0, container.duration_s - time_s - interval_s);
  const DecoderErrors errors = decoder_errors();
  facts.num_decoder_errors = errors.num;
  facts.decoder_error = errors.first;
  while (packets->next()) continue;
  facts.num_packets = packets->num();
  facts.num_damaged = packets->num_damaged();
}

Film::Film(const std::string& path, double fps) : state_(std::make_unique<State>()) {
  State& s = *state_;
  s.path = path;
  s.container = read_film_container(path);
  if (!s.container.has_pictures)
    throw BadInput("cannot read " + path + ": it has no pictures" +
                   (s.container.has_sound ? ", only sound" : ""));
  if (!s.container.projection.empty())
    throw BadInput(path + " is a film of 360 degrees (" + s.container.projection +
                   ", by its container), and no camera here describes it: cut a flat view out of "
                   "it (ffmpeg -vf v360)");
  if (!s.container.eyes.empty())
    throw BadInput(path + " is a film of two eyes (" + s.container.eyes +
                   ", by its container): cut the pictures of one out of it (ffmpeg -vf stereo3d)");
  if (!open_capture(s.capture, path))
    throw BadInput("cannot read " + path +
                   ": it is no film that OpenCV reads, or is cut off: record "
                   "or copy it again");
  const int turn = static_cast<int>(std::lround(s.container.turn_deg / 90)) * 90 % 360;
  s.facts.width = s.container.width;
  s.facts.height = s.container.height;
  s.facts.turn_deg = turn;
  s.facts.is_mirrored = s.container.is_mirrored;
  s.facts.pixel_aspect = s.container.pixel_aspect;
  s.facts.is_joined = is_joined_film(path);
  s.facts.is_interlaced = s.container.is_interlaced;
  s.facts.clock_start_s = s.container.clock_start_s;
  s.facts.rate_hz = s.container.rate_hz;
  if (fps > 0) {
    s.facts.times = FilmFacts::Times::kGiven;
    s.step_s = 1 / fps;
  } else if (!s.container.has_clock || !clock_runs(path)) {
    if (!(s.container.rate_hz > 0))
      throw BadInput("--fps is required: " + path + " does not say its frames a second");
    s.facts.times = FilmFacts::Times::kRate;
    s.step_s = 1 / s.container.rate_hz;
  }
  s.packets = std::make_unique<FilmPackets>(path);
  listen_to_decoders();
}

Film::~Film() = default;

bool Film::next() {
  State& s = *state_;
  bool follows_other_size = false;
  while (s.capture.grab()) {
    ++s.index;
    const double clock_s = s.time_of_picture();
    const std::optional<double> time_s = s.clock.next(clock_s);
    s.clock_s = clock_s;
    s.facts.num_left_out = s.clock.num_left_out();
    const bool is_other_size = s.is_other_size();
    follows_other_size = follows_other_size || is_other_size;
    if (is_other_size || !time_s) continue;
    s.facts.num_begun_anew = s.clock.num_begun_anew();
    if (s.num_pictures > 0 && !s.clock.began_anew() && !follows_other_size)
      s.add_interval(*time_s - s.time_s);
    s.time_s = *time_s;
    ++s.num_pictures;
    if (const double interval_s = s.mean_interval_s();
        s.facts.times == FilmFacts::Times::kContainer && interval_s > 0)
      s.facts.rate_hz = 1 / interval_s;
    return true;
  }
  s.end();
  return false;
}

int64_t Film::index() const { return state_->index; }
double Film::time_s() const { return state_->time_s; }
bool Film::began_anew() const { return state_->clock.began_anew(); }

cv::Mat Film::picture() {
  cv::Mat picture;
  try {
    if (!state_->capture.retrieve(picture)) picture.release();
  } catch (const cv::Exception&) {
    picture.release();
  }
  return picture;
}

const FilmFacts& Film::facts() const { return state_->facts; }

int64_t Film::num_promised() const { return state_->container.num_pictures; }

std::vector<std::string> Film::notes() const {
  const State& s = *state_;
  const FilmFacts& f = s.facts;
  std::vector<std::string> notes;
  const std::string rate = text_of("%.4g", s.container.rate_hz) + " pictures a second";
  if (f.times == FilmFacts::Times::kRate)
    notes.push_back("the film gives its pictures no times: taken as " + rate +
                    ", by its header (--fps F: another rate)");
  if (f.times == FilmFacts::Times::kGiven && s.container.has_clock)
    notes.push_back("--fps stands in place of the film's own times (" + rate + ")");
  if (f.is_variable)
    notes.push_back("the film's rate varies, " + text_of("%.3g", f.shortest_s) + " to " +
                    text_of("%.3g", f.longest_s) +
                    " s between two pictures: each has its own time of the container");
  if (f.num_left_out > 0)
    notes.push_back(
        std::to_string(f.num_left_out) +
        (f.num_left_out == 1 ? " picture of the film is" : " pictures of the film are") +
        " left out: no later than the one before, by the container's times");
  if (const std::string words = other_size_words(f); !words.empty()) notes.push_back(words);
  if (const std::string note = s.clock.note("the film"); !note.empty()) notes.push_back(note);
  if (f.clock_start_s > 1e-3 && f.times == FilmFacts::Times::kContainer)
    notes.push_back("the film's clock begins at " + text_of("%.6g", f.clock_start_s) +
                    " s; times here count from its first picture");
  if (f.is_interlaced) notes.emplace_back(kInterlacedNote);
  if (f.is_joined) notes.emplace_back(kJoinedNote);
  if (s.container.num_picture_streams > 1)
    notes.push_back("the film has " + std::to_string(s.container.num_picture_streams) +
                    " streams of pictures: the first one is used");
  if (f.num_damaged > 0)
    notes.push_back(std::to_string(f.num_damaged) + " of the film's " +
                    std::to_string(f.num_packets) +
                    " packets are damaged: pictures may show what was not there; record or copy "
                    "it again");
  if (f.num_decoder_errors > 0)
    notes.push_back("the film's decoder reports " + std::to_string(f.num_decoder_errors) +
                    (f.num_decoder_errors == 1 ? " error" : " errors, the first") + " (" +
                    f.decoder_error +
                    "): pictures may show what was not there; record or copy it again");
  if (f.missing_s > std::max(kMissing_s, kMissingShare * s.container.duration_s))
    notes.push_back("the film's pictures end " + text_of("%.3g", f.missing_s) +
                    " s before its header says: it may be cut off");
  return notes;
}

std::string other_size_words(const FilmFacts& facts) {
  const int64_t count = facts.num_other_size;
  if (count == 0) return "";
  const auto size = [](int width, int height) {
    return std::to_string(width) + "x" + std::to_string(height);
  };
  return std::to_string(count) +
         (count == 1 ? " picture of the film is" : " pictures of the film are") +
         " left out: of another size (" + size(facts.other_width, facts.other_height) +
         ") than the film's " + size(facts.width, facts.height);
}

std::string stored_words(const FilmFacts& facts) {
  if (facts.turn_deg == 0 && !facts.is_mirrored) return "";
  std::string player = facts.is_mirrored ? "mirrors them" : "";
  if (facts.turn_deg != 0)
    player += (player.empty() ? "" : " and ") + std::string("turns them by ") +
              std::to_string(facts.turn_deg) + " degrees clockwise";
  const char* const lie = facts.turn_deg == 0     ? ""
                          : facts.turn_deg == 180 ? ", upside down"
                                                  : ", lying on their side";
  return std::string("the pictures are used as they are stored") + lie + " (a player " + player +
         ")";
}

cv::Mat luma_of(const cv::Mat& picture) {
  cv::Mat luma;
  if (picture.empty() || picture.depth() != CV_8U) return luma;
  switch (picture.channels()) {
    case 1: return picture;
    case 3: cv::cvtColor(picture, luma, cv::COLOR_BGR2GRAY); return luma;
    case 4: cv::cvtColor(picture, luma, cv::COLOR_BGRA2GRAY); return luma;
    default: return luma;
  }
}

}  // namespace cli
