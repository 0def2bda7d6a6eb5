// Tables of keypoints, matches and points as CSV, and the cloud as PLY.
#pragma once

#include <string>
#include <vector>

#include "pair/result.h"

namespace cli {

// x,y,size,angle_rad,score,level; numbers read back to the same floats.
std::string keypoints_csv(const tv_keypoint* keypoints, size_t count);

// x0,y0,x1,y1,dist_sq,ratio,idx0,idx1
std::string matches_csv(const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                        const tv_correspondence* matches, size_t count);

// x,y,z,angle_deg,error_px,status: a row a match, in its order; status ok, infinite (then x y z is
// the direction), behind or invalid (then zeros).
const char* point_status_name(int32_t status);
std::string points_csv(const std::vector<tv_point>& points);

// Binary little-endian: x y z float, red green blue uchar, angle_deg float, error_px float.
std::string cloud_ply(const std::vector<CloudPoint>& cloud);

// Little-endian bytes of a float, appended.
void append_float(std::string& bytes, float value);

}  // namespace cli
