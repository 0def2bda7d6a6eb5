// Fuzzes tv_odometry_load: the bytes of a small map, altered, with a length and a checksum that are
// right, so that the checks of the content are reached. What is loaded is saved as equal bytes, and
// frames are tracked in it.
#include <vector>

#include "fuzz.h"
#include "support/room_scene.h"
#include "twoview/odometry.h"

namespace {

constexpr int kFrames = 48;
uint8_t pixels[kFrames][ROOM_WIDTH * ROOM_HEIGHT];

tv_odometry* make_odometry() {
  const tv_camera camera = room_camera();
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  options.max_keypoints = 160;
  options.max_keyframes = 8;
  options.max_points = 500;
  size_t size_bytes = 0;
  FUZZ_REQUIRE(tv_odometry_size(&camera, &options, &size_bytes) == TV_OK);
  void* memory = nullptr;
  FUZZ_REQUIRE(posix_memalign(&memory, TV_CONTEXT_ALIGNMENT, size_bytes) == 0);
  tv_odometry* odometry = nullptr;
  FUZZ_REQUIRE(tv_odometry_init(&odometry, &camera, &options, memory, size_bytes) == TV_OK);
  return odometry;
}

void track(tv_odometry* odometry, int n, double time_s, tv_odometry_state* state) {
  tv_odometry_frame frame;
  tv_odometry_frame_init(&frame);
  frame.image = {pixels[n], ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
  frame.time_s = time_s;
  tv_odometry_state_init(state);
  FUZZ_REQUIRE(tv_odometry_track(odometry, &frame, state) == TV_OK);
}

std::vector<uint8_t> save(const tv_odometry* odometry) {
  size_t size_bytes = 0, num_bytes = 0;
  FUZZ_REQUIRE(tv_odometry_save_size(odometry, &size_bytes) == TV_OK);
  std::vector<uint8_t> bytes(size_bytes);
  FUZZ_REQUIRE(tv_odometry_save(odometry, bytes.data(), size_bytes, &num_bytes) == TV_OK);
  FUZZ_REQUIRE(num_bytes == size_bytes);
  return bytes;
}

void put(uint8_t* at, uint64_t number, int width) {
  for (; width > 0; --width, number >>= 8) *at++ = static_cast<uint8_t>(number);
}

void seal(std::vector<uint8_t>* bytes) {
  if (bytes->size() < 24) return;
  put(bytes->data() + 16, bytes->size(), 8);
  uint32_t crc = ~0u;
  for (size_t k = 16; k < bytes->size(); ++k) {
    crc ^= (*bytes)[k];
    for (int bit = 0; bit < 8; ++bit) crc = (crc >> 1) ^ (0xedb88320u & (0u - (crc & 1u)));
  }
  put(bytes->data() + 12, ~crc, 4);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static tv_odometry* odometry = nullptr;
  static std::vector<uint8_t> map;
  tv_odometry_state state;
  if (odometry == nullptr) {
    odometry = make_odometry();
    for (int n = 0; n < kFrames; ++n) {
      room_flight(n, pixels[n]);
      track(odometry, n, n, &state);
    }
    FUZZ_REQUIRE(state.num_keyframes > 2);
    map = save(odometry);
  }
  fuzz::Bytes given(data, size);
  std::vector<uint8_t> bytes = map;
  const bool sealed = given.whole(0, 7) != 0;
  if (given.whole(0, 7) == 0) bytes.resize(given.raw<uint32_t>() % (2 * map.size()));
  while (given.left() > 0 && !bytes.empty()) {
    // Most numbers begin at a multiple of 4; the header and the first keyframe are met more often.
    size_t at = given.raw<uint32_t>();
    const int where = given.whole(0, 3);
    if (where == 0) at %= 224;
    at = at % bytes.size() / 4 * 4 + (where == 1 ? at % 4 : 0);
    const int width = given.whole(0, 2) == 0 ? 8 : given.whole(1, 4);
    const uint64_t number = given.raw<uint64_t>();
    if (at + static_cast<size_t>(width) <= bytes.size()) put(bytes.data() + at, number, width);
  }
  if (sealed) seal(&bytes);
  FUZZ_REQUIRE(tv_odometry_load(odometry, map.data(), map.size()) == TV_OK);
  const tv_status status = tv_odometry_load(odometry, bytes.data(), bytes.size());
  FUZZ_REQUIRE(status == TV_OK || status == TV_ERR_MAP || status == TV_ERR_CAMERA ||
               status == TV_ERR_LIMITS);
  FUZZ_REQUIRE(save(odometry) == (status == TV_OK ? bytes : map));
  if (status != TV_OK) return 0;
  for (int k = 0; k < 4; ++k) {
    track(odometry, kFrames - 4 + k, k, &state);
    FUZZ_REQUIRE(!state.has_pose || (fuzz::all_finite(state.world_from_cam_R, 9) &&
                                     fuzz::all_finite(state.world_from_cam_t, 3)));
  }
  return 0;
}
