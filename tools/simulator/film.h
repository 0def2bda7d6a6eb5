// Encodes pictures to H.264 as the drone's encoder does: one packet a picture, parameter sets in
// each key picture, and no picture that depends on a later one.
#pragma once

#include <cstdint>
#include <memory>
#include <vector>

namespace simulator {

struct FilmPacket {
  std::vector<uint8_t> payload;  // H.264 in the byte-stream format of Annex B
  bool is_key = false;
  uint8_t sps_bytes = 0, pps_bytes = 0;
};

class Film {
 public:
  // Throws std::runtime_error where this libavcodec has no libx264, or cannot encode this size.
  Film(int width, int height, int frames_per_second, int kbit_per_second);
  ~Film();
  Film(const Film&) = delete;
  Film& operator=(const Film&) = delete;

  FilmPacket encode(const uint8_t* luma, int64_t stride_bytes);
  int width() const { return width_; }
  int height() const { return height_; }

 private:
  struct Encoder;
  int width_, height_;
  std::unique_ptr<Encoder> encoder_;
};

}  // namespace simulator
