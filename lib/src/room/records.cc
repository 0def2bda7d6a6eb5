#include "room/records.h"

#include <cstring>

namespace tv {
namespace {

uint64_t mix(uint64_t digest, uint64_t word) {
  digest = (digest ^ word) * 0x9e3779b97f4a7c15u;
  return digest ^ digest >> 29;
}

uint64_t digest_bytes(uint64_t digest, const void* bytes, size_t count) {
  const uint8_t* b = static_cast<const uint8_t*>(bytes);
  for (; count >= 8; b += 8, count -= 8) {
    uint64_t word;
    std::memcpy(&word, b, 8);
    digest = mix(digest, word);
  }
  uint64_t word = count;
  std::memcpy(&word, b, count);
  return count > 0 ? mix(digest, word) : digest;
}

uint64_t digest_rows(uint64_t digest, const void* data, size_t row_bytes, int64_t stride_bytes,
                     int32_t rows) {
  for (int32_t y = 0; data != nullptr && y < rows; ++y) {
    digest = digest_bytes(digest, static_cast<const uint8_t*>(data) + y * stride_bytes, row_bytes);
  }
  return mix(digest, data != nullptr);
}

// A number that tells views apart by their contents.
uint64_t digest_of(const RoomView& view) {
  const tv_depth_map& map = view.map;
  const size_t width = static_cast<size_t>(map.width);
  uint64_t digest = mix(0x7477, static_cast<uint64_t>(map.inferred));
  digest = digest_bytes(digest, &view.camera.model, sizeof view.camera.model);
  digest = digest_bytes(digest, view.rotation.data(), 9 * sizeof(double));
  digest = digest_bytes(digest, view.centre.data(), 3 * sizeof(double));
  digest = digest_rows(digest, map.distance, 4 * width, int64_t{4} * map.stride, map.height);
  digest = digest_rows(digest, map.sigma, 4 * width, int64_t{4} * map.stride, map.height);
  digest = digest_rows(digest, map.witnesses, width, map.stride, map.height);
  digest = digest_rows(digest, map.mask, width, map.mask_stride_bytes, map.height);
  const size_t channels = map.pixels != nullptr ? static_cast<size_t>(map.channels) : 0;
  return digest_rows(digest, map.pixels, width * channels, map.pixel_stride_bytes, map.height);
}

}  // namespace

int32_t find_record(const tv_room& room, const RoomView& view) {
  const uint64_t digest = digest_of(view);
  int32_t k = room.num_records - 1;
  while (k >= 0 && room.records[k].digest != digest) --k;
  return k;
}

bool add_map(tv_room& room, const RoomView& view) {
  if (!add_view(room, view)) return false;
  room.records[room.num_records++] = {digest_of(view), room.num_calls, 0};
  ++room.num_maps;
  return true;
}

void remove_map(tv_room& room, const RoomView& view, int32_t record) {
  subtract_view(room, view, room.records[record].added_at);
  --room.num_maps;
  --room.num_records;
  for (int32_t k = record; k < room.num_records; ++k) room.records[k] = room.records[k + 1];
}

void see_through_again(tv_room& room, const RoomView& view, int32_t record) {
  add_to_new_blocks(room, view, room.records[record].added_at);
  room.records[record].added_at = room.num_calls;
}

}  // namespace tv
