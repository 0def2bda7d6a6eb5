// Reads the true pose and depths of a pair, and computes the errors of a reconstruction.
#pragma once

#include <nlohmann/json_fwd.hpp>
#include <opencv2/core/mat.hpp>
#include <string>

#include "files/image_file.h"
#include "pair/measures.h"

namespace cli {

// R and t of cam1_from_cam0, read from a YAML or JSON file. If the file is a result.json, what
// its pose's camera differs in from the given one is read too: the shift of the principal point and
// the factor of a refined focal length. R is replaced by the nearest rotation, since the file's
// numbers may be rounded. Throws BadInput.
struct KnownPose {
  Matrix3 R{};
  Vector3 t{};
  // The shift in pixels to add to cx and cy of a camera with images of width image_width; if
  // image_width is 0, of a camera with images of any size.
  double principal_point_shift_px[2] = {0, 0};
  double image_width = 0;
  // The factor of fx and fy.
  double focal_scale = 1;
  // The sizes of the images that the pose was estimated with (image_size0 and image_size1); 0 where
  // the file does not say.
  int sizes[2][2] = {{0, 0}, {0, 0}};

  // The camera that the pose refers to: `camera`, of any image size, with the shift added to its
  // principal point, and its focal length multiplied by the factor.
  tv_camera corrected(const tv_camera& camera) const;
};
KnownPose load_pose(const std::string& path);

// The truth from a YAML file: R [9] row-major and t [3] of cam1_from_cam0; optional `baseline`, the
// length of t in metres; optional `depth0`, the path (relative to the file's folder) of a float
// depth map of image 0. Depths are in the unit of the baseline; a depth that is 0, negative or not
// finite is unknown.
struct Truth {
  Matrix3 R{};
  Vector3 t{};
  double baseline = 0;  // the entry `baseline` in metres; without it |t|
  cv::Mat depth0;       // depths of image 0; empty if there is no depth map
};
Truth load_truth(const std::string& path);

// The errors of the reconstruction as JSON; an error that cannot be computed is null.
nlohmann::ordered_json truth_json(const Truth& truth, const Picture& picture0,
                                  const tv_two_view& two_view,
                                  const tv_reconstruction& reconstruction);

// Adds the errors of the dense points' depths: `num_dense_depths`,
// `dense_depth_error_median_percent` and `dense_depth_error_p95_percent` (null without depths).
void add_dense_truth(const Truth& truth, const Picture& picture0,
                     const std::vector<tv_dense_point>& points, nlohmann::ordered_json& json);

// Throws BadInput if the size of the depth map is not that of image 0's file.
void check_truth(const Truth& truth, const Picture& picture0);

}  // namespace cli
