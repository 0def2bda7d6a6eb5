// What a film's container says, read with libavformat, since OpenCV's numbers differ from version
// to version (see film_container.cc).
#pragma once

#include <cstdint>
#include <memory>
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

// The packets of the same stream, each of one picture as a rule, one by one in stored order.
class FilmPackets {
 public:
  explicit FilmPackets(const std::string& path);
  ~FilmPackets();
  FilmPackets(const FilmPackets&) = delete;
  FilmPackets& operator=(const FilmPackets&) = delete;

  bool next();  // false at the end
  int64_t num() const;
  int64_t num_damaged() const;  // by the container
  double time_s() const;        // of the last one, since the stream's start
  // The size of the pictures from the last key frame on, by its decoder: OpenCV makes every picture
  // the size that the header says, of memory that is not the picture's (4.6) or by a stretch. 0
  // where there is no decoder for them.
  int width() const;
  int height() const;

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace cli
