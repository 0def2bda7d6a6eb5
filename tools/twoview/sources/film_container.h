// What a film's container says, read with libavformat, since OpenCV's numbers differ from version
// to version (see film_container.cc).
#pragma once

#include <cstdint>
#include <string>
#include <vector>

namespace cli {

struct FilmContainer {
  bool has_pictures = false;  // a stream of pictures that is not the cover of a piece of music
  bool has_sound = false;
  bool has_clock = false;     // each picture has a time; a raw stream has only a rate
  int width = 0, height = 0;  // pixels, as stored
  double rate_hz = 0;         // 0: not said
  double clock_start_s = 0;
  double duration_s = 0;     // of the pictures; 0: not said
  int64_t num_pictures = 0;  // as the index counts them; 0: not said
  int num_picture_streams = 0;
  double turn_deg = 0;  // clockwise, in [0, 360)
  bool is_mirrored = false;
  double pixel_aspect = 1;
  bool is_interlaced = false;  // stored as two fields, which may be of two moments
  // The projection of a 360-degree film, such as "equirectangular", and how a film of two eyes has
  // both in its pictures, such as "side by side"; empty for a film of one flat view.
  std::string projection, eyes;
};

// Throws BadInput where the file is of no format that libavformat knows, and for an archive or a
// document, in which libavformat may find pictures without their order.
FilmContainer read_film_container(const std::string& path);

// The times of all pictures of the stream that FilmContainer describes, in seconds since the
// stream's start, in rising order; reads the whole file, without decoding.
std::vector<double> picture_times(const std::string& path);

// How many packets the same stream has, each of one picture as a rule, and how many of them the
// container calls damaged; reads the whole file, without decoding.
struct PacketCounts {
  int64_t num = 0, num_damaged = 0;
};
PacketCounts count_packets(const std::string& path);

}  // namespace cli
