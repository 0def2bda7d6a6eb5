#include "room_model/surface_files.h"

#include <algorithm>
#include <cmath>
#include <nlohmann/json.hpp>

#include "report/ply.h"
#include "twoview/version.h"

namespace cli {
namespace {

using Json = nlohmann::ordered_json;

void append_bits(std::string& bytes, uint32_t value, int num_bytes) {
  for (int k = 0; k < num_bytes; ++k) bytes += static_cast<char>(value >> 8 * k & 255);
}

// A byte of sRGB as linear light, which is what glTF's COLOR_0 holds. A float: 8 bits would lose
// the dark tones, and MeshLab (2025.7) reads 16 bits as if they were 8.
float linear_light(uint8_t srgb) {
  const double v = srgb / 255.0;
  const double linear = v <= 0.04045 ? v / 12.92 : std::pow((v + 0.055) / 1.055, 2.4);
  return static_cast<float>(linear);
}

// The chunk with its length and kind, filled up to a multiple of four bytes.
std::string chunk(uint32_t kind, std::string bytes, char filler) {
  while (bytes.size() % 4 != 0) bytes += filler;
  std::string head;
  append_bits(head, static_cast<uint32_t>(bytes.size()), 4);
  append_bits(head, kind, 4);
  return head + bytes;
}

// glTF's numbers for types of components, targets and primitives.
enum { kUnsignedInt = 5125, kFloat = 5126 };
enum { kArrayBuffer = 34962, kElementArrayBuffer = 34963, kTriangles = 4 };
constexpr uint32_t kJsonChunk = 0x4E4F534A, kBinChunk = 0x004E4942, kMagic = 0x46546C67;

// The buffer of a GLB with its views and accessors, one each.
class Buffer {
 public:
  // Returns the number of the accessor.
  int add(const std::string& bytes, int component, const char* type, size_t count, int target) {
    views_.push_back({{"buffer", 0},
                      {"byteOffset", bytes_.size()},
                      {"byteLength", bytes.size()},
                      {"target", target}});
    accessors_.push_back({{"bufferView", views_.size() - 1},
                          {"componentType", component},
                          {"count", count},
                          {"type", type}});
    bytes_ += bytes;  // all lengths are multiples of four, as views need
    return static_cast<int>(accessors_.size()) - 1;
  }
  Json& accessor(int number) { return accessors_[static_cast<size_t>(number)]; }
  const Json& accessors() const { return accessors_; }
  const Json& views() const { return views_; }
  const std::string& bytes() const { return bytes_; }

 private:
  std::string bytes_;
  Json views_ = Json::array(), accessors_ = Json::array();
};

}  // namespace

std::string room_ply(const RoomModel& model, const std::string& unit) {
  std::string bytes =
      ply_header({"the world of the trajectory; unit: " + unit,
                  "sigma: standard deviation along the normal; inferred 1: no view measured it"},
                 model.vertices.size(),
                 {{PlyType::kFloat, {"x", "y", "z", "nx", "ny", "nz"}},
                  {PlyType::kUchar, {"red", "green", "blue"}},
                  {PlyType::kFloat, {"sigma"}},
                  {PlyType::kUchar, {"inferred"}}},
                 model.triangles.size());
  bytes.reserve(bytes.size() + 32 * model.vertices.size() + 13 * model.triangles.size());
  for (const tv_room_vertex& v : model.vertices) {
    for (const float value : v.position) append_float(bytes, value);
    for (const float value : v.normal) append_float(bytes, value);
    for (const uint8_t value : v.rgb) bytes += static_cast<char>(value);
    append_float(bytes, v.sigma);
    bytes += static_cast<char>(v.inferred);
  }
  for (const tv_room_triangle& t : model.triangles) {
    bytes += static_cast<char>(3);
    for (const int32_t idx : t.idx_vertex) append_bits(bytes, static_cast<uint32_t>(idx), 4);
  }
  return bytes;
}

std::string room_glb(const RoomModel& model) {
  // The room's axes are (x, y, up); glTF's are x, y up, and z = -y of the room.
  const auto turned = [&model](const float v[3]) {
    const Vector3 r = applied(model.axes, {v[0], v[1], v[2]});
    return Vector3{r[0], r[2], -r[1]};
  };
  std::string positions, normals, colours, sigmas, indices;
  float low[3] = {INFINITY, INFINITY, INFINITY}, high[3] = {-INFINITY, -INFINITY, -INFINITY};
  for (const tv_room_vertex& v : model.vertices) {
    Vector3 at = turned(v.position);
    at[1] -= model.floor;
    const Vector3 normal = turned(v.normal);
    for (size_t k = 0; k < 3; ++k) {
      const float value = static_cast<float>(at[k]);
      low[k] = std::min(low[k], value);
      high[k] = std::max(high[k], value);
      append_float(positions, value);
      append_float(normals, static_cast<float>(normal[k]));
    }
    for (const uint8_t value : v.rgb) append_float(colours, linear_light(value));
    append_float(colours, 1);  // alpha: assimp-py 1.2.0 (2026) takes 0 without it
    append_float(sigmas, v.sigma);
  }
  for (const tv_room_triangle& t : model.triangles)
    for (const int32_t idx : t.idx_vertex) append_bits(indices, static_cast<uint32_t>(idx), 4);
  const size_t count = model.vertices.size();
  Buffer buffer;
  const int position = buffer.add(positions, kFloat, "VEC3", count, kArrayBuffer);
  buffer.accessor(position)["min"] = {low[0], low[1], low[2]};
  buffer.accessor(position)["max"] = {high[0], high[1], high[2]};
  const int normal = buffer.add(normals, kFloat, "VEC3", count, kArrayBuffer);
  const int colour = buffer.add(colours, kFloat, "VEC4", count, kArrayBuffer);
  const int sigma = buffer.add(sigmas, kFloat, "SCALAR", count, kArrayBuffer);
  const int index =
      buffer.add(indices, kUnsignedInt, "SCALAR", 3 * model.triangles.size(), kElementArrayBuffer);
  Json json;
  json["asset"] = {{"version", "2.0"},
                   {"generator", std::string("twoview ") + tv_version_string()}};
  json["scene"] = 0;
  json["scenes"] = {{{"nodes", {0}}}};
  json["nodes"] = {{{"mesh", 0}, {"name", "room"}}};
  // What a camera saw holds its light already: a rough surface that lights change least.
  json["materials"] = {{{"pbrMetallicRoughness", {{"metallicFactor", 0}, {"roughnessFactor", 1}}},
                        {"doubleSided", true}}};
  json["meshes"] = {
      {{"name", "room"},
       {"primitives",
        {{{"attributes",
           {{"POSITION", position}, {"NORMAL", normal}, {"COLOR_0", colour}, {"_SIGMA", sigma}}},
          {"indices", index},
          {"material", 0},
          {"mode", static_cast<int>(kTriangles)}}}}}};
  json["accessors"] = buffer.accessors();
  json["bufferViews"] = buffer.views();
  json["buffers"] = {{{"byteLength", buffer.bytes().size()}}};
  const std::string chunks =
      chunk(kJsonChunk, json.dump(), ' ') + chunk(kBinChunk, buffer.bytes(), '\0');
  std::string glb;
  append_bits(glb, kMagic, 4);
  append_bits(glb, 2, 4);
  append_bits(glb, static_cast<uint32_t>(12 + chunks.size()), 4);
  return glb + chunks;
}

}  // namespace cli
