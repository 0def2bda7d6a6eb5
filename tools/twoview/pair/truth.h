// The true pose and depths of a pair, and the errors of a reconstruction against them.
#pragma once

#include <nlohmann/json.hpp>
#include <opencv2/core/mat.hpp>
#include <string>

#include "files/image_file.h"
#include "pair/measures.h"

namespace cli {

// R and t of cam1_from_cam0 from a YAML or JSON file. A result.json also holds the shift of the
// principal point that its pose was estimated with. R is the rotation nearest to the file's nine
// numbers, which may be rounded. Throws BadInput.
struct KnownPose {
  Matrix3 R{};
  Vector3 t{};
  // Pixels to add to cx and cy of a camera whose images are image_width wide; with image_width 0,
  // of a camera of any size.
  double principal_point_shift_px[2] = {0, 0};
  double image_width = 0;

  // The camera that the pose refers to: `camera`, of any image size, with the shift added.
  tv_camera corrected(const tv_camera& camera) const;
};
KnownPose load_pose(const std::string& path);

// A YAML file: R [9] row-major and t [3] of cam1_from_cam0; optional `baseline`, the length of t in
// metres; optional `depth0`, the path (from the file's folder) of a float depth map of image 0, in
// the baseline's unit, 0, negative or not finite where unknown.
struct Truth {
  Matrix3 R{};
  Vector3 t{};
  double baseline = 0;  // |t| where the file gives none
  cv::Mat depth0;       // empty: none
};
Truth load_truth(const std::string& path);

// Errors against the truth; null where they are not known.
nlohmann::ordered_json truth_json(const Truth& truth, const Picture& picture0,
                                  const tv_two_view& two_view,
                                  const tv_reconstruction& reconstruction);

// Throws BadInput unless the depth map has the size of image 0's file.
void check_truth(const Truth& truth, const Picture& picture0);

}  // namespace cli
