// Fuzzes a whole track: frames of a small room in any order, blank and noisy ones, gaps, times that
// stand, lying sensors, resets, maps that are saved and loaded. Two odometries whose memory held
// other bytes before must give equal states and maps.
#include <vector>

#include "fuzz.h"
#include "support/random.h"
#include "support/room_scene.h"
#include "twoview/odometry.h"

namespace {

constexpr int kFrames = 32;
uint8_t pictures[kFrames][ROOM_WIDTH * ROOM_HEIGHT];

void draw(fuzz::Bytes* given, int* at, uint8_t* pixels) {
  const size_t size = ROOM_WIDTH * ROOM_HEIGHT;
  const int kind = given->whole(0, 15);
  if (kind == 0) {
    std::memset(pixels, given->whole(0, 255), size);
  } else if (kind == 1) {
    uint64_t seed = given->raw<uint16_t>();
    random_bytes(&seed, pixels, size);
  } else {
    if (kind == 2) *at = given->whole(0, kFrames - 1);
    std::memcpy(pixels, pictures[*at], size);
    // A person, or a hand, in front of the camera.
    if (kind == 3) std::memset(pixels, 90, size * static_cast<size_t>(given->whole(1, 9)) / 10);
    *at = (*at + given->whole(0, 2)) % kFrames;
  }
}

struct Flown {
  tv_status status;
  tv_odometry_state state;
};

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];
  if (pictures[0][0] == 0) {
    for (int n = 0; n < kFrames; ++n) room_flight(n, pictures[n]);
    pictures[0][0] = 1;
  }
  const tv_camera camera = room_camera();
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  fuzz::Bytes given(data, size);
  options.max_keypoints = given.whole(100, 300);
  options.max_keyframes = given.whole(8, 12);
  options.max_points = given.whole(500, 800);
  options.window = given.whole(3, 20);
  size_t size_bytes = 0;
  FUZZ_REQUIRE(tv_odometry_size(&camera, &options, &size_bytes) == TV_OK);
  tv_odometry* odometry[2];
  void* memory[2];
  for (int k = 0; k < 2; ++k) {
    FUZZ_REQUIRE(posix_memalign(&memory[k], TV_CONTEXT_ALIGNMENT, size_bytes) == 0);
    std::memset(memory[k], 255 * k, size_bytes);
    FUZZ_REQUIRE(tv_odometry_init(&odometry[k], &camera, &options, memory[k], size_bytes) == TV_OK);
  }
  int at = 0;
  double time_s = 0;
  for (int n = 0; n < 60 && (given.left() > 0 || n < 24); ++n) {
    tv_odometry_frame frame;
    tv_odometry_frame_init(&frame);
    draw(&given, &at, pixels);
    frame.image = {pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
    frame.gap = given.whole(0, 15) == 1;
    time_s += given.whole(0, 31) == 1 ? given.wild(-1, 5) : 0.033;
    frame.time_s = time_s;
    if (given.whole(0, 3) == 1) {
      for (double& r : frame.world_from_cam) r = given.wild(-1, 1);
      frame.attitude_sigma_rad = given.wild(0, 0.1);
      frame.height_m = given.wild(0, 3);
      frame.height_sigma_m = given.wild(0, 1);
      for (double& v : frame.velocity_m_s) v = given.wild(-2, 2);
      frame.velocity_sigma_m_s = given.wild(0, 1);
    }
    if (given.whole(0, 3) == 1) {
      for (int c = 0; c < 3; ++c) frame.previous_from_cam[4 * c] = 1;
      frame.previous_from_cam[given.whole(0, 8)] += given.wild(-1e-9, 1e-9);
      frame.turn_sigma_rad = given.wild(0, 0.1);
    }
    Flown flown[2];
    std::vector<uint8_t> maps[2];
    const int also = given.whole(0, 40);
    for (int k = 0; k < 2; ++k) {
      std::memset(&flown[k], 0, sizeof flown[k]);
      tv_odometry_state_init(&flown[k].state);
      flown[k].status = tv_odometry_track(odometry[k], &frame, &flown[k].state);
      if (also == 1) FUZZ_REQUIRE(tv_odometry_reset(odometry[k]) == TV_OK);
      if (also > 4) continue;
      size_t num_bytes = 0;
      FUZZ_REQUIRE(tv_odometry_save_size(odometry[k], &num_bytes) == TV_OK);
      maps[k].resize(num_bytes);
      FUZZ_REQUIRE(tv_odometry_save(odometry[k], maps[k].data(), num_bytes, &num_bytes) == TV_OK);
      // Whatever was saved can be loaded.
      if (also == 2) {
        FUZZ_REQUIRE(tv_odometry_load(odometry[k], maps[k].data(), num_bytes) == TV_OK);
      }
    }
    FUZZ_REQUIRE(std::memcmp(&flown[0], &flown[1], sizeof flown[0]) == 0 && maps[0] == maps[1]);
    const tv_odometry_state& state = flown[0].state;
    if (flown[0].status != TV_OK) {
      FUZZ_REQUIRE(flown[0].status == TV_ERR_TIME || flown[0].status == TV_ERR_NOT_FINITE);
      time_s = time_s - time_s == 0 ? time_s + 2 : 0;
      continue;
    }
    FUZZ_REQUIRE(state.status >= 0 && state.status < TV_ODOMETRY_NUM_STATUSES);
    FUZZ_REQUIRE(state.num_keyframes <= options.max_keyframes);
    FUZZ_REQUIRE(state.num_points <= options.max_points);
    FUZZ_REQUIRE(fuzz::all_finite(state.world_from_cam_R, 9));
    FUZZ_REQUIRE(fuzz::all_finite(state.world_from_cam_t, 3));
    FUZZ_REQUIRE(fuzz::all_finite(state.cam_from_world_covariance, 36));
  }
  for (void* block : memory) std::free(block);
  return 0;
}
