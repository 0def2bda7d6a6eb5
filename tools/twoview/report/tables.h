// Writes tables of keypoints, matches and points as CSV, and the cloud as PLY.
#pragma once

#include <string>
#include <vector>

#include "pair/result.h"
#include "report/ply.h"

namespace cli {

// The columns are x,y,size,angle_rad,score,level. Numbers read back to the same floats.
std::string keypoints_csv(const tv_keypoint* keypoints, size_t count);

// The columns are x0,y0,x1,y1,dist_sq,ratio,idx0,idx1.
std::string matches_csv(const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                        const tv_correspondence* matches, size_t count);

// The word for a tv_point_status: ok, infinite, behind or invalid.
const char* point_status_name(int32_t status);
// The columns are x,y,z,angle_deg,error_px,status, one row a match in the order of the matches. For
// the status infinite x y z is the direction, for invalid x y z are zeros.
std::string points_csv(const std::vector<tv_point>& points);

// The cloud as PLY: x y z float, red green blue uchar, angle_deg float,
// error_px float and, where wanted, sigma float and sigma_pose float. unit: the words for the unit
// of x y z, which a comment tells.
std::string cloud_ply(const std::vector<CloudPoint>& cloud, const char* unit,
                      bool with_sigma = false);

}  // namespace cli
