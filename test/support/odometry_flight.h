// A flight through the room of room_scene.h, for tests of the odometry's parts.
#ifndef TEST_SUPPORT_ODOMETRY_FLIGHT_H
#define TEST_SUPPORT_ODOMETRY_FLIGHT_H

#include <unity.h>

#include <cstddef>
#include <cstdint>
#include <cstring>

#include "support/room_scene.h"
#include "twoview/odometry.h"

inline tv_odometry* begin_room_flight(uint8_t* memory, size_t bytes) {
  const tv_camera camera = room_camera();
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  tv_odometry* odometry = nullptr;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&odometry, &camera, &options, memory, bytes));
  return odometry;
}

// Tracks frame n of the flight, or a grey one in its place; a velocity of 0 with a standard
// deviation, or none.
inline tv_odometry_state track_room(tv_odometry* odometry, int n, bool is_blank = false,
                                    double velocity_sigma_m_s = 0) {
  static uint8_t pixels[ROOM_WIDTH * ROOM_HEIGHT];
  room_flight(n, pixels);
  if (is_blank) std::memset(pixels, 99, sizeof pixels);
  tv_odometry_frame frame;
  tv_odometry_frame_init(&frame);
  frame.image = {pixels, ROOM_WIDTH, ROOM_HEIGHT, ROOM_WIDTH};
  frame.time_s = n / 30.0;
  frame.velocity_sigma_m_s = velocity_sigma_m_s;
  tv_odometry_state state;
  tv_odometry_state_init(&state);
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_track(odometry, &frame, &state));
  return state;
}

#endif
