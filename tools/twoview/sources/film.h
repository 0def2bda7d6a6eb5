// A film as what it is: its pictures, the time of each, and what its container says of them (rate,
// turn, shape of the pixels). Every part of the program that reads a film file reads it here.
#pragma once

#include <cstdint>
#include <memory>
#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace cli {

// What is known of a film. Until all pictures are read, rate_hz is the header's, and is_variable
// and the counts say what was seen so far.
struct FilmFacts {
  // Where the pictures' times come from: the container's clock, its rate alone (a raw stream has
  // no clock), or a rate that the user gave.
  enum class Times { kContainer, kRate, kGiven };
  Times times = Times::kContainer;
  int width = 0, height = 0;  // pixels, as stored
  double rate_hz = 0;         // pictures a second, their mean where the rate varies
  bool is_variable = false;   // the times between pictures differ by more than their rounding
  double longest_s = 0, shortest_s = 0;  // time between two pictures
  double clock_start_s = 0;    // the container's time of the first picture, which is time 0 here
  int turn_deg = 0;            // by how much a player turns the pictures clockwise: 0, 90, 180, 270
  bool is_mirrored = false;    // a player mirrors them, before it turns them
  double pixel_aspect = 1;     // the width of a pixel over its height
  int64_t num_left_out = 0;    // pictures whose time is not later than that of the one before
  int64_t num_other_size = 0;  // pictures of another size than the header's, which are left out
  int other_width = 0, other_height = 0;  // the size of the first of these
  int64_t num_begun_anew = 0;  // how often the clock began anew, as where two films are one file
  bool is_interlaced = false;  // by the container: the even and the odd rows may be of two moments
  bool is_joined = false;      // other films follow in the file, which are not read
  int64_t num_packets = 0, num_damaged = 0;  // once all pictures are read: of the container
  int64_t num_decoder_errors = 0;  // once all pictures are read: what their decoder reported
  std::string decoder_error;       // the first of these
  double missing_s = 0;            // how much longer the film is by its header than by its pictures
};
constexpr const char* kJoinedNote =
    "the file holds several films one behind the other (joined as bytes), of which the first is "
    "read: give them one by one, or join them by ffmpeg -f concat";
const char* times_name(FilmFacts::Times times);
constexpr const char* kInterlacedNote =
    "the film is interlaced by its container: where its even and odd rows are of two moments, "
    "deinterlace it first (ffmpeg -vf bwdif)";

// The pictures of a film file, as they are stored: neither turned nor stretched, since a camera's
// intrinsics refer to stored pixels, for films as for photographs.
class Film {
 public:
  // fps: pictures a second in place of the film's own clock; 0: its own. Throws BadInput with one
  // line for a file that is no film, has no pictures, or says no rate where that is needed.
  explicit Film(const std::string& path, double fps = 0);
  ~Film();
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  // Goes to the next picture, in the order in which they are shown; false at the end. A picture
  // whose time is not later than that of the one before is left out, and counted, but where the
  // clock began anew (sources/stream_clock.h); so is one of another size than the header says.
  bool next();
  // About the picture that next() read last: its index, which counts pictures that were left out,
  // too; its time in seconds since the first picture; and the picture, empty where it could not be
  // decoded.
  int64_t index() const;
  double time_s() const;
  bool began_anew() const;  // the clock, before this picture
  cv::Mat picture();

  const FilmFacts& facts() const;
  // How many pictures the header promises; 0 where it does not.
  int64_t num_promised() const;
  // What the user must know of the film by what was read so far, as lines without an end.
  std::vector<std::string> notes() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

// How the stored pictures differ from what a player shows: "the pictures are used as they are
// stored, upside down (a player turns them by 180 degrees clockwise)"; empty where they do not.
std::string stored_words(const FilmFacts& facts);

// Says how many pictures were left out for their size; empty where none were.
std::string other_size_words(const FilmFacts& facts);

// 8-bit grey of a picture of OpenCV with 1, 3 or 4 channels of 8 bits; else empty.
cv::Mat luma_of(const cv::Mat& picture);

}  // namespace cli
