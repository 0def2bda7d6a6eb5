// OUT/colmap of `twoview odometry`: the longest segment for other programs. Its text model names
// the source's own frames. Beside it are the keyframes' pictures as a pinhole would have taken
// them, with the models of just these, in the folders where OpenMVS, Gaussian splatting and
// nerfstudio look for them.
#pragma once

#include <filesystem>
#include <memory>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "base/output.h"
#include "odometry/outputs.h"

namespace cli {

class ColmapFolder {
 public:
  // The folder is made where there is a map; without one, what an earlier run left is removed.
  // inputs: files of the run, which are kept.
  ColmapFolder(const std::filesystem::path& folder, const std::vector<std::string>& inputs,
               bool has_map);

  // The files of a run but for its pictures, relative to the folder.
  static const std::vector<std::string>& file_names();

  void add_model(const FlightResult& result);
  // Reads the source again. Returns what the user must know, as lines without an end.
  std::vector<std::string> add_pictures(const FlightResult& result, FrameSource& source,
                                        const std::atomic<bool>& stop);
  // {num, bytes, size, focal_length}: of the pictures; null without any.
  nlohmann::ordered_json pictures_json() const;
  // How many pictures there are and their size, such as "34 pictures, 2.1 MiB"; empty without any.
  std::string pictures_words() const;

  // Gives the files their names, and removes those of an earlier run that this one did not write.
  void commit();

 private:
  OutputSet& set_of(const std::string& folder);
  void add_files(const FlightResult& result);

  std::filesystem::path folder_;
  std::vector<std::string> inputs_;
  bool has_map_;
  std::vector<std::pair<std::string, std::unique_ptr<OutputSet>>> sets_;  // by folders in folder_
  ColmapPictures pictures_;
  size_t bytes_ = 0;
};

}  // namespace cli
