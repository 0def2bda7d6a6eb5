// The entries of one camera: those that are understood, those that cannot concern the lens, and
// those that are refused because they may. No entry is ignored without a word.
//
// The Python package's twin is python/twoview/_camera_entries.py; both run the cases of
// test/formats. A name is compared without its case and without what is neither a letter nor a
// digit, so that distCoeffs, dist_coeffs and Dist-Coeffs are one name.
#pragma once

#include <yaml-cpp/yaml.h>

#include <string>
#include <vector>

#include "files/camera_file.h"

namespace cli {

// A name without its case and without what is neither a letter nor a digit.
std::string plain_name(const std::string& name);

// The entries of one camera, which its reader takes out one by one. Groups (VINS's
// projection_parameters, SVO's distortion) are taken apart.
class CameraEntries {
 public:
  using Names = std::vector<const char*>;
  struct Entry {
    std::string plain, name;  // `name` as the file spells it
    YAML::Node value;
  };

  // `where` begins each message.
  CameraEntries(const YAML::Node& map, const std::string& where);
  const std::string& where() const { return where_; }
  // Adds the entry as a reader of one format names it.
  void add(const std::string& name, const YAML::Node& value);

  bool has(const Names& names) const;
  // The entries of these names, in the file's order.
  std::vector<Entry> take_all(const Names& names);

  // Judges the entries that no reader took. Throws BadInput for the first one that may concern the
  // lens; returns the names of the others, without those that are known to be harmless.
  std::vector<std::string> left_out() const;
  // An error that says that `entry` is missing, and which entries were not understood.
  [[noreturn]] void refuse_missing(const std::string& entry) const;

 private:
  std::vector<std::string> refused(std::vector<std::string>& left_out) const;

  std::string where_;
  std::vector<Entry> left_;
};

// How sure the calibration is: takes focal_sigma and center_sigma, each in [0, 0.5]; kPlainFile's
// where one is missing. Throws BadInput that names the entry.
CalibrationSigmas take_sigmas(CameraEntries& entries);

// The camera of these entries. Adds to left_out the names of those that were not needed. Throws
// BadInput that names an entry which is missing, wrong, contradicts another one, or is not
// understood and may concern the lens.
tv_camera take_camera(CameraEntries& entries, std::vector<std::string>& left_out);

// Whether a map describes a camera of its own: it has a camera matrix or a focal length.
bool is_camera(const YAML::Node& map);

// Throws BadInput for numbers that no camera has, and for those that are most often in another
// unit, of another picture or in another order. A Brown-Conrady lens whose coefficients are all 0
// becomes a pinhole.
void settle_camera(tv_camera& camera, const std::string& where);

}  // namespace cli
