// Writes the files of `drone record`. Data are written as they arrive, so that everything received
// so far is readable however the program ends.
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

// A file to which complete entries are appended. If an entry cannot be written, its bytes are
// removed from the file and BadInput is thrown.
class GrowingFile {
 public:
  // Creates the file. Throws BadInput if it exists or cannot be created.
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

// Throws BadInput: the folder holds a recording already.
[[noreturn]] void refuse_second_recording(const std::filesystem::path& folder);

// Creates a folder if it does not exist. Throws BadInput.
void make_folder(const std::filesystem::path& folder);

// Writes a decoded picture as FOLDER/<number, six digits>.png. Numbers repeat after the drone
// restarts; the later picture then replaces the earlier one. Throws BadInput.
void write_frame(const std::filesystem::path& folder, const tvs_frame& frame);

// The head of attitude.tum, and a line of it; the line is empty without an attitude.
extern const char kAttitudeHead[];
std::string attitude_line(const tvs_imu& imu);

class Recording {
 public:
  // Creates the folder if it does not exist. Throws BadInput if it already holds a recording.
  Recording(const std::filesystem::path& folder, bool with_frames);
  ~Recording();

  void add_navdata(const uint8_t* bytes, size_t size, const tvs_imu& imu);
  void add_packet(const ardrone_pave_packet& packet, const tvs_time& time);
  // Writes a decoded picture as frames/<number>.png, if with_frames was given.
  void add_frame(const tvs_frame& frame);
  // Writes summary.json; call it last. The file appears complete or not at all.
  void add_summary(const std::string& json);
  // Removes the files, and the folder where it was made here: for a recording of nothing.
  void discard();

 private:
  std::filesystem::path folder_;
  bool with_frames_, made_folder_;
  std::unique_ptr<GrowingFile> video_, navdata_, attitude_, frames_;
};

}  // namespace cli
