#include "report/tables.h"

#include <charconv>

namespace cli {
namespace {

template <class T>
void append_number(std::string& text, T value, char separator) {
  char digits[48];
  const auto end = std::to_chars(digits, digits + sizeof digits, value).ptr;
  text.append(digits, end);
  text += separator;
}

}  // namespace

std::string keypoints_csv(const tv_keypoint* keypoints, size_t count) {
  std::string text = "x,y,size,angle_rad,score,level\n";
  for (size_t i = 0; i < count; ++i) {
    const tv_keypoint& k = keypoints[i];
    for (const float value : {k.x, k.y, k.size, k.angle_rad, k.score})
      append_number(text, value, ',');
    append_number(text, k.level, '\n');
  }
  return text;
}

std::string matches_csv(const tv_keypoint* keypoints0, const tv_keypoint* keypoints1,
                        const tv_correspondence* matches, size_t count) {
  std::string text = "x0,y0,x1,y1,dist_sq,ratio,idx0,idx1\n";
  for (size_t i = 0; i < count; ++i) {
    const tv_correspondence& m = matches[i];
    const tv_keypoint &k0 = keypoints0[m.idx0], &k1 = keypoints1[m.idx1];
    for (const float value : {k0.x, k0.y, k1.x, k1.y}) append_number(text, value, ',');
    append_number(text, m.dist_sq, ',');
    append_number(text, m.ratio, ',');
    append_number(text, m.idx0, ',');
    append_number(text, m.idx1, '\n');
  }
  return text;
}

const char* point_status_name(int32_t status) {
  constexpr const char* names[] = {"ok", "infinite", "behind", "invalid"};
  return names[status];
}

std::string points_csv(const std::vector<tv_point>& points) {
  constexpr double degrees = 57.29577951308232;  // degrees in a radian
  std::string text = "x,y,z,angle_deg,error_px,status\n";
  for (const tv_point& point : points) {
    for (const double value : point.position) append_number(text, value, ',');
    append_number(text, static_cast<float>(point.angle_rad * degrees), ',');
    append_number(text, point.error_px, ',');
    text += point_status_name(point.status) + std::string("\n");
  }
  return text;
}

std::string cloud_ply(const std::vector<CloudPoint>& cloud, const char* unit, bool with_sigma) {
  PlyColumns columns = {{PlyType::kFloat, {"x", "y", "z"}},
                        {PlyType::kUchar, {"red", "green", "blue"}},
                        {PlyType::kFloat, {"angle_deg", "error_px"}}};
  if (with_sigma) columns.push_back({PlyType::kFloat, {"sigma", "sigma_pose"}});
  std::string bytes =
      ply_header({std::string("frame of camera 0: x right, y down, z forward; unit: ") + unit},
                 cloud.size(), columns);
  for (const CloudPoint& point : cloud) {
    for (const double value : {point.x, point.y, point.z})
      append_float(bytes, static_cast<float>(value));
    for (const uint8_t value : {point.red, point.green, point.blue})
      bytes += static_cast<char>(value);
    append_float(bytes, point.angle_deg);
    append_float(bytes, point.error_px);
    if (with_sigma) {
      append_float(bytes, point.sigma);
      append_float(bytes, point.sigma_pose);
    }
  }
  return bytes;
}

}  // namespace cli
