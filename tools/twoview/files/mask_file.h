// Masks: which pixels of the pictures show the scene (--mask).
#pragma once

#include <opencv2/core/mat.hpp>
#include <string>
#include <vector>

namespace cli {

// The mask of every picture: one file that serves all, or a folder with a file for each. A pixel
// is left out where its mask is black (0), and used anywhere else, as OpenCV and COLMAP have it.
class Masks {
 public:
  // A file, or a folder; empty: all of every picture is used.
  std::string path;

  bool given() const { return !path.empty(); }

  // The mask of a picture of this size, 255 where it is used and 0 where it is left out; empty
  // where no mask was given. In a folder it is the file NAME.png, such as a.jpg.png (COLMAP's),
  // else STEM.png, such as a.png; `name` may contain folders, which are looked for first in the
  // folder of masks, too. Throws BadInput where there is none, where it is of another size (both
  // are named), has transparent pixels, or leaves nothing.
  cv::Mat of(const std::string& name, int width, int height) const;

  // The files that were read so far, which no output may replace.
  const std::vector<std::string>& files() const { return files_; }

 private:
  std::string file_of(const std::string& name) const;

  mutable std::vector<std::string> files_;
  mutable cv::Mat only_;  // the mask of a single file, once it was read
};

// The share of a mask's pixels that are left out, [0, 1); 0 for an empty one.
double masked_share(const cv::Mat& mask);

// A note where masks are given and leave nothing out of `pictures`, by their masked_share, or more
// than half, as an inverted one does; else empty.
std::string mask_note(const Masks& masks, double masked_share, const std::string& pictures);

}  // namespace cli
