// The files of `drone record`. They are written as the bytes arrive, so that everything received so
// far can be read however the program ends.
#pragma once

#include <cstdint>
#include <cstdio>
#include <filesystem>
#include <memory>
#include <string>

#include "twoview_drivers/ardrone/navdata.h"
#include "twoview_drivers/ardrone/pave.h"
#include "twoview_drivers/source.h"

namespace cli {

// A file that whole entries are appended to. An entry that cannot be written is removed from the
// file again, and BadInput is thrown.
class GrowingFile {
 public:
  // Throws BadInput when it exists or cannot be made.
  explicit GrowingFile(const std::filesystem::path& path);
  ~GrowingFile();
  GrowingFile(const GrowingFile&) = delete;
  GrowingFile& operator=(const GrowingFile&) = delete;
  void append(const void* bytes, size_t size);
  void append(const std::string& text) { append(text.data(), text.size()); }

 private:
  std::string name_;
  int descriptor_;
  int64_t size_ = 0;
};

// Makes a folder where it is missing. Throws BadInput.
void make_folder(const std::filesystem::path& folder);

// A decoded picture as FOLDER/<number, six digits>.png. Numbers come again after a reboot: the
// later picture stays. Throws BadInput.
void write_frame(const std::filesystem::path& folder, const tvs_frame& frame);

class Recording {
 public:
  // Makes the folder; refuses one that holds a recording already.
  Recording(const std::filesystem::path& folder, bool with_frames);
  ~Recording();

  void add_navdata(const uint8_t* bytes, size_t size, const tvs_imu& imu);
  void add_packet(const ardrone_pave_packet& packet, const tvs_time& time);
  // A decoded picture, as frames/<number>.png.
  void add_frame(const tvs_frame& frame);
  // Written last, beside the others, under its final name or not at all.
  void add_summary(const std::string& json);

 private:
  std::filesystem::path folder_;
  bool with_frames_;
  std::unique_ptr<GrowingFile> video_, navdata_, attitude_, frames_;
};

}  // namespace cli
