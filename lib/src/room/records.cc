#include "room/records.h"

namespace tv {

int32_t find_record(const tv_room& room, const RoomView& view) {
  const uint64_t digest = digest_of(view);
  int32_t k = room.num_records - 1;
  while (k >= 0 && room.records[k].digest != digest) --k;
  return k;
}

bool add_map(tv_room& room, const RoomView& view) {
  if (!list_near_blocks(room, view, true)) return false;
  add_view(room, view);
  room.records[room.num_records++] = {digest_of(view), room.num_calls, 0};
  ++room.num_maps;
  return true;
}

void remove_map(tv_room& room, const RoomView& view, int32_t record) {
  list_near_blocks(room, view, false);
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
