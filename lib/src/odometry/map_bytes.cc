#include "odometry/map_bytes.h"

#include <algorithm>
#include <cmath>
#include <cstddef>
#include <cstring>
#include <type_traits>

#include "base/math.h"
#include "geometry/essential.h"
#include "odometry/metric.h"
#include "odometry/move_principal_point.h"

namespace tv {
namespace {

constexpr uint8_t kMagic[8] = {'T', 'V', 'M', 'A', 'P', '\r', '\n', 0x1a};
constexpr uint32_t kVersion = 2;
constexpr bool kLittleEndian = __BYTE_ORDER__ == __ORDER_LITTLE_ENDIAN__;
constexpr size_t kUnchecked = 16;  // the checksum is that of the bytes from here on
// Ranges in which nothing that is computed from the numbers overflows.
constexpr double kLargest = 1e15;
constexpr int32_t kMost = 1 << 28;
constexpr int kCounts = 4;  // of a Header and of the odometry, from num_frames to num_loops
constexpr float kLargestPixel = 1e5f, kLargestSize = 4096;

// CRC-32 as of PNG and zlib, four bits at a time.
constexpr uint32_t kRemainders[16] = {
    0x00000000, 0x1db71064, 0x3b6e20c8, 0x26d930ac, 0x76dc4190, 0x6b6b51f4, 0x4db26158, 0x5005713c,
    0xedb88320, 0xf00f9344, 0xd6d6a3e8, 0xcb61b38c, 0x9b64c2b0, 0x86d3d2d4, 0xa00ae278, 0xbdbdf21c};

uint32_t checksum(const uint8_t* bytes, size_t num) {
  uint32_t crc = ~0u;
  for (size_t k = 0; k < num; ++k) {
    crc ^= bytes[k];
    crc = (crc >> 4) ^ kRemainders[crc & 15];
    crc = (crc >> 4) ^ kRemainders[crc & 15];
  }
  return ~crc;
}

// Numbers go from the map to `to`, or from `from` to the map. The tables list the numbers of each
// struct once for both directions; with neither array they are only counted.
struct Stream {
  uint8_t* to;
  const uint8_t* from;
  size_t at;
  size_t end;   // of `from`
  bool is_bad;  // `from` has too few bytes
};

void pass_numbers(Stream* s, void* numbers, size_t width, size_t bytes) {
  uint8_t* own = static_cast<uint8_t*>(numbers);
  if (s->from != nullptr && bytes > s->end - s->at) {
    s->is_bad = true;
    std::memset(own, 0, bytes);
    return;
  }
  for (size_t k = 0; k < bytes; ++k) {
    const size_t within = k % width;
    uint8_t* byte = own + (kLittleEndian ? k : k - within + width - 1 - within);
    if (s->to != nullptr) s->to[s->at + k] = *byte;
    if (s->from != nullptr) *byte = s->from[s->at + k];
  }
  s->at += bytes;
}

struct Header {
  uint8_t magic[8];
  uint32_t version, checksum;
  uint64_t num_bytes;
  tv_camera camera;
  int32_t num_points, num_keyframes, num_removed;
  int32_t next_point_id, next_keyframe_id;
  int32_t num_frames, num_segments, num_relocations, num_loops;
  int32_t is_upright;
  int32_t scale_source, evidence;       // tv_scale_source
  double product, square, scale_sigma;  // of the scale: ScaleEstimate
  double principal_point[2];            // as it was moved: the camera is the one that was given
};

// Numbers of one type that follow each other in their struct.
struct Numbers {
  uint16_t offset;
  uint8_t width, count;
};

template <typename Member>
using NumberOf = std::remove_all_extents_t<Member>;

// The numbers of a struct from the member `first` to the member `last`.
#define TV_NUMBERS(Struct, first, last)                                              \
  Numbers {                                                                          \
    offsetof(Struct, first), sizeof(NumberOf<decltype(Struct{}.first)>),             \
        (offsetof(Struct, last) + sizeof(Struct{}.last) - offsetof(Struct, first)) / \
            sizeof(NumberOf<decltype(Struct{}.first)>)                               \
  }

constexpr Numbers kOfHeader[] = {
    TV_NUMBERS(Header, magic, magic),
    TV_NUMBERS(Header, version, checksum),
    TV_NUMBERS(Header, num_bytes, num_bytes),
    TV_NUMBERS(Header, camera.model, camera.reserved),
    TV_NUMBERS(Header, camera.fx, camera.k),
    TV_NUMBERS(Header, num_points, evidence),
    TV_NUMBERS(Header, product, principal_point),
};
constexpr Numbers kOfPoint[] = {
    TV_NUMBERS(MapPoint, position, position),     TV_NUMBERS(MapPoint, id, segment),
    TV_NUMBERS(MapPoint, num_visible, made_at),   TV_NUMBERS(MapPoint, grey, grey),
    TV_NUMBERS(MapPoint, depth_sigma, seen_from),
};
constexpr Numbers kOfKeyframe[] = {
    TV_NUMBERS(MapKeyframe, id, frame),
    TV_NUMBERS(MapKeyframe, num_keypoints, num_keypoints),
    TV_NUMBERS(MapKeyframe, time_s, scale),
};
constexpr Numbers kOfRemoved[] = {
    TV_NUMBERS(RemovedKeyframe, id, kept_id),
    TV_NUMBERS(RemovedKeyframe, kept_from_removed.R, scale),
};

void pass_all(Stream* s, void* of_struct, const Numbers* numbers, size_t num) {
  for (; num > 0; --num, ++numbers) {
    pass_numbers(s, static_cast<uint8_t*>(of_struct) + numbers->offset, numbers->width,
                 size_t{numbers->width} * numbers->count);
  }
}

// All numbers of a struct, by its table.
template <size_t n>
void pass(Stream* s, void* of_struct, const Numbers (&numbers)[n]) {
  pass_all(s, of_struct, numbers, n);
}

void pass_point(Stream* s, MapPoint* point, uint8_t* descriptor) {
  pass(s, point, kOfPoint);
  pass_numbers(s, descriptor, 1, TV_DESCRIPTOR_BYTES);
}

void pass_keypoint(Stream* s, MapKeypoint* keypoint, int32_t* seen) {
  static_assert(sizeof *keypoint == 3 * sizeof keypoint->x, "x, y and size, and nothing else");
  pass_numbers(s, keypoint, sizeof keypoint->x, sizeof *keypoint);
  pass_numbers(s, seen, sizeof *seen, sizeof *seen);
}

// Of a scale that was contradicted nothing is known to whoever reads the map.
void write_scale(const MetricScale& scale, Header* h) {
  if (scale.is_contradicted) return;
  const ScaleEstimate estimate = estimate_of(scale);
  h->scale_source = scale.source;
  h->scale_sigma = scale.sigma;
  h->evidence = estimate.source;
  h->product = estimate.product;
  h->square = estimate.square;
}

bool is_index(int32_t n, int32_t end) { return n >= 0 && n < end; }
bool is_measure(double x, double sigma) { return is_finite(x) && is_finite(sigma) && sigma >= 0; }
bool is_scale(double x) { return x >= 1 / kLargest && x <= kLargest; }

bool are_counts(const int32_t* first, const int32_t* last) {
  for (; first <= last; ++first) {
    if (!is_index(*first, kMost + 1)) return false;
  }
  return true;
}

template <typename Number>
bool are_lengths(const Number* first, const Number* last) {
  for (; first <= last; ++first) {
    if (!(std::fabs(static_cast<double>(*first)) <= kLargest)) return false;
  }
  return true;
}

bool is_pose(const Rigid& pose) { return is_rotation(pose.R) && are_lengths(pose.t, pose.t + 2); }

bool is_header(const Header& h) {
  return are_counts(&h.num_points, &h.num_loops) && is_index(h.is_upright, 2) &&
         is_index(h.scale_source, 4) && is_index(h.evidence, 4) &&
         is_measure(h.product, h.square) && is_measure(0, h.scale_sigma) &&
         (h.evidence == TV_SCALE_UNIT
              ? h.square == 0 && h.product == 0
              : h.square > 0 && is_finite(h.product / h.square * h.product)) &&
         std::fabs(h.principal_point[0] - h.camera.cx) < h.camera.fx &&
         std::fabs(h.principal_point[1] - h.camera.cy) < h.camera.fx &&
         tv_camera_check(&h.camera) == TV_OK;
}

bool is_point(const Header& h, const MapPoint& p) {
  return is_index(p.id, h.next_point_id) && is_index(p.segment, h.num_segments) &&
         are_counts(&p.num_visible, &p.num_found) && is_index(p.made_at, h.next_keyframe_id) &&
         is_index(p.grey, 256) && are_lengths(p.position, p.position + 2) && p.depth_sigma >= 0 &&
         are_lengths(&p.depth_sigma, &p.seen_from[2]);
}

bool is_keyframe(const Header& h, const MapKeyframe& k) {
  return is_index(k.id, h.next_keyframe_id) && is_index(k.segment, h.num_segments) &&
         is_index(k.frame, h.num_frames) && are_counts(&k.num_keypoints, &k.num_keypoints) &&
         is_finite(k.time_s) && is_pose(k.cam_from_world) && k.down_sigma_rad >= 0 &&
         are_lengths(k.down, &k.down_sigma_rad) && is_measure(k.height_m, k.height_sigma_m) &&
         is_scale(k.scale);
}

bool is_keypoint(const Header& h, const MapKeypoint& k, int32_t seen) {
  return std::fabs(k.x) <= kLargestPixel && std::fabs(k.y) <= kLargestPixel && k.size > 0 &&
         k.size <= kLargestSize && (seen == kNoPoint || is_index(seen, h.num_points));
}

bool is_removed(const Header& h, const RemovedKeyframe& r) {
  return is_index(r.id, h.next_keyframe_id) && is_index(r.kept_id, h.next_keyframe_id) &&
         r.id != r.kept_id && is_pose(r.kept_from_removed) && is_scale(r.scale);
}

// The given camera without the coefficients that its model ignores.
tv_camera camera_of(const Odometry& odometry) {
  tv_camera camera = odometry.given_camera;
  if (camera.model == TV_CAMERA_PINHOLE) std::fill_n(camera.k, 8, 0.0);
  return camera;
}

// Whether a keyframe of the segment has a direction of gravity: is_upright(map, segment) of the
// keyframes that follow in the stream.
bool is_upright_in(Stream s, const Header& h, int32_t segment) {
  bool found = false;
  for (int32_t n = 0; n < h.num_keyframes && !found; ++n) {
    MapKeyframe keyframe{};
    pass(&s, &keyframe, kOfKeyframe);
    found = keyframe.segment == segment && keyframe.down_sigma_rad > 0;
    s.at += static_cast<size_t>(keyframe.num_keypoints) * (sizeof(MapKeypoint) + sizeof(int32_t));
  }
  return found;
}

// What the numbers of a map that is added to another one begin with.
struct Base {
  int32_t point_id, keyframe_id, segment, frame;
};

// Reads the parts of a map's bytes that follow the header, in this order. `places` has room for the
// places of the points, and what is read is added to `map`; with a null `places` the bytes are only
// checked. False: the bytes are no map.
struct BodyReader {
  const Header& h;
  Stream* s;
  int32_t* places;
  Map* map;
  const Base& base;

  bool stores() const { return places != nullptr; }
  bool read_points() const;
  bool read_keyframe(bool* fits, MapKeyframe* keyframe) const;
  bool read_keyframes(bool* fits) const;
  bool read_removed() const;
};

bool BodyReader::read_points() const {
  int32_t last_id = -1;
  for (int32_t n = 0; n < h.num_points; ++n) {
    MapPoint point{};
    uint8_t descriptor[TV_DESCRIPTOR_BYTES];
    pass_point(s, &point, descriptor);
    if (s->is_bad || !is_point(h, point) || point.id <= last_id) return false;
    last_id = point.id;
    if (!stores()) continue;
    point.id += base.point_id;
    point.segment += base.segment;
    point.made_at += base.keyframe_id;
    places[n] = add_point(map, point.position, descriptor, point.segment);
    map->points[places[n]] = point;
  }
  return true;
}

// Reads what a keyframe sees, after the keyframe, and adds both.
bool BodyReader::read_keyframe(bool* fits, MapKeyframe* keyframe) const {
  *fits = *fits && keyframe->num_keypoints <= map->sizes.max_keypoints;
  MapKeypoint* own = nullptr;
  int32_t* seen = nullptr;
  if (stores()) {
    keyframe->room = map->free_rooms[--map->num_free_rooms];
    keyframe->described = -1;
    keyframe->id += base.keyframe_id;
    keyframe->segment += base.segment;
    keyframe->frame += base.frame;
    map->keyframes[map->num_keyframes++] = *keyframe;
    own = keypoints_of(*map, *keyframe);
    seen = seen_by(*map, *keyframe);
  }
  for (int32_t k = 0; k < keyframe->num_keypoints; ++k) {
    MapKeypoint keypoint;
    int32_t point;
    pass_keypoint(s, &keypoint, &point);
    if (s->is_bad || !is_keypoint(h, keypoint, point)) return false;
    if (!stores()) continue;
    own[k] = keypoint;
    seen[k] = kNoPoint;
    if (point != kNoPoint) observe(map, map->num_keyframes - 1, k, places[point]);
  }
  return true;
}

bool BodyReader::read_keyframes(bool* fits) const {
  int32_t last_id = -1, newest_segment = -1;
  const Stream begin = *s;
  for (int32_t n = 0; n < h.num_keyframes; ++n) {
    MapKeyframe keyframe{};
    pass(s, &keyframe, kOfKeyframe);
    if (s->is_bad || !is_keyframe(h, keyframe) || keyframe.id <= last_id) return false;
    last_id = keyframe.id;
    newest_segment = keyframe.segment;
    if (!read_keyframe(fits, &keyframe)) return false;
  }
  return stores() || is_upright_in(begin, h, newest_segment) == (h.is_upright != 0);
}

bool BodyReader::read_removed() const {
  int32_t last_id = -1;
  const int32_t surplus = map->num_removed + h.num_removed - max_removed(map->sizes);
  if (stores() && surplus > 0) forget_removed(map, surplus);
  for (int32_t n = 0; n < h.num_removed; ++n) {
    RemovedKeyframe removed;
    pass(s, &removed, kOfRemoved);
    if (s->is_bad || !is_removed(h, removed) || removed.id <= last_id) return false;
    last_id = removed.id;
    if (!stores()) continue;
    removed.id += base.keyframe_id;
    removed.kept_id += base.keyframe_id;
    map->removed[map->num_removed++] = removed;
  }
  return true;
}

// Reads what follows the header, as BodyReader does. *fits: whether there is room for it.
bool read_body(const Header& h, Stream* s, int32_t* places, Map* map, const Base& base,
               bool* fits) {
  const MapSizes& sizes = map->sizes;
  *fits = h.num_points <= sizes.max_points - map->num_points &&
          h.num_keyframes <= sizes.max_keyframes - map->num_keyframes &&
          h.num_removed <= max_removed(sizes) && h.next_point_id <= kMost - base.point_id &&
          h.next_keyframe_id <= kMost - base.keyframe_id &&
          h.num_segments <= kMost - base.segment && h.num_frames <= kMost - base.frame;
  const BodyReader reader{h, s, places, map, base};
  return reader.read_points() && reader.read_keyframes(fits) && reader.read_removed() &&
         s->at == s->end;
}

// The header but for its number of bytes and its checksum.
void fill_header(const Odometry& odometry, Header* h) {
  const Map& map = odometry.map;
  std::memcpy(h->magic, kMagic, sizeof kMagic);
  h->version = kVersion;
  h->camera = camera_of(odometry);
  h->principal_point[0] = odometry.camera.model.cx;
  h->principal_point[1] = odometry.camera.model.cy;
  h->num_points = map.num_points;
  h->num_keyframes = map.num_keyframes;
  h->num_removed = map.num_removed;
  h->next_point_id = map.next_point_id;
  h->next_keyframe_id = map.next_keyframe_id;
  static_assert(offsetof(Header, num_loops) - offsetof(Header, num_frames) ==
                        (kCounts - 1) * sizeof h->num_frames &&
                    offsetof(Odometry, num_loops) - offsetof(Odometry, num_frames) ==
                        (kCounts - 1) * sizeof h->num_frames,
                "they follow each other in both");
  std::copy_n(&odometry.num_frames, kCounts, &h->num_frames);
  // Of the last keyframe's segment.
  const int32_t segment =
      map.num_keyframes > 0 ? map.keyframes[map.num_keyframes - 1].segment : odometry.segment;
  h->is_upright = is_upright(map, segment);
  if (segment == odometry.segment)
    write_scale(odometry.scale, h);
  else if (segment == odometry.other_segment)
    write_scale(odometry.other_scale, h);
}

}  // namespace

size_t write_map(const Odometry& odometry, uint8_t* to) {
  const Map& map = odometry.map;
  Arena scratch = odometry.scratch;
  const size_t room = static_cast<size_t>(map.end_points);
  int32_t* places = arena_alloc<int32_t>(scratch, room);
  int32_t* ranks = arena_alloc<int32_t>(scratch, room);
  rank_points(map, places, ranks);
  Header h{};
  fill_header(odometry, &h);
  Stream s{to, nullptr, 0, 0, false};
  pass(&s, &h, kOfHeader);
  for (int32_t n = 0; n < map.num_points; ++n) {
    MapPoint point = map.points[places[n]];
    uint8_t descriptor[TV_DESCRIPTOR_BYTES];
    std::memcpy(descriptor, descriptor_of(map, places[n]), sizeof descriptor);
    pass_point(&s, &point, descriptor);
  }
  for (int32_t n = 0; n < map.num_keyframes; ++n) {
    MapKeyframe keyframe = map.keyframes[n];
    const MapKeypoint* own = keypoints_of(map, keyframe);
    const int32_t* seen = seen_by(map, keyframe);
    pass(&s, &keyframe, kOfKeyframe);
    for (int32_t k = 0; k < keyframe.num_keypoints; ++k) {
      MapKeypoint keypoint = own[k];
      int32_t point = seen[k] == kNoPoint ? kNoPoint : ranks[seen[k]];
      pass_keypoint(&s, &keypoint, &point);
    }
  }
  for (int32_t n = 0; n < map.num_removed; ++n) {
    RemovedKeyframe removed = map.removed[n];
    pass(&s, &removed, kOfRemoved);
  }
  const size_t num_bytes = s.at;
  if (to != nullptr) {  // the header again, now that what it tells is known
    h.num_bytes = num_bytes;
    s.at = 0;
    pass(&s, &h, kOfHeader);
    h.checksum = checksum(to + kUnchecked, num_bytes - kUnchecked);
    s.at = 0;
    pass(&s, &h, kOfHeader);
  }
  return num_bytes;
}

tv_status read_map(const uint8_t* bytes, size_t num_bytes, bool replaces, Odometry* odometry) {
  Map* map = &odometry->map;
  Header h;
  Stream s{nullptr, bytes, 0, num_bytes, false};
  pass(&s, &h, kOfHeader);
  if (s.is_bad || std::memcmp(h.magic, kMagic, sizeof kMagic) != 0 || h.version != kVersion ||
      h.num_bytes != num_bytes ||
      h.checksum != checksum(bytes + kUnchecked, num_bytes - kUnchecked) || !is_header(h)) {
    return TV_ERR_MAP;
  }
  const size_t begin = s.at;
  Base base{};
  Map nothing{};
  nothing.sizes = map->sizes;
  if (!replaces) {
    base = {map->next_point_id, map->next_keyframe_id, odometry->num_segments,
            odometry->num_frames};
  }
  bool fits;
  if (!read_body(h, &s, nullptr, replaces ? &nothing : map, base, &fits)) return TV_ERR_MAP;
  const tv_camera camera = camera_of(*odometry);
  if (std::memcmp(&h.camera, &camera, sizeof camera) != 0) return TV_ERR_CAMERA;
  if (!fits) return TV_ERR_LIMITS;
  if (replaces) start_anew(odometry);
  const int32_t num_before = map->num_keyframes;
  Arena scratch = odometry->scratch;
  int32_t* places = arena_alloc<int32_t>(scratch, static_cast<size_t>(h.num_points));
  odometry->last_time_s = -HUGE_VAL;  // the next frame may have any time
  s.at = begin;
  read_body(h, &s, places, map, base, &fits);
  // Two maps keep the former one's camera.
  const double own[2] = {odometry->camera.model.cx, odometry->camera.model.cy};
  move_principal_point(odometry, num_before == 0 ? h.principal_point : own, h.principal_point,
                       num_before);
  map->next_point_id = base.point_id + h.next_point_id;
  map->next_keyframe_id += h.next_keyframe_id;
  for (int n = 0; n < kCounts; ++n) (&odometry->num_frames)[n] += (&h.num_frames)[n];
  if (h.num_keyframes > 0) {
    enter_segment(odometry, map->keyframes[map->num_keyframes - 1].segment);
    odometry->scale = scale_of({h.evidence, h.product, h.square}, h.scale_source, h.scale_sigma);
  }
  if (map->num_keyframes > 0) {
    odometry->tracking = {TrackingState::kLost, 1};
    odometry->frame.has_pose = odometry->has_motion = false;
    odometry->next_search = map->num_keyframes - 1;
    odometry->confirmed_id = map->keyframes[odometry->next_search].id;
    odometry->confirmed = Reach{};
    odometry->keyframe_inliers = map->keyframes[odometry->next_search].num_observations;
  }
  return TV_OK;
}

}  // namespace tv
