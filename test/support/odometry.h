// An odometry of 640x480 pixels for tests of its parts.
#ifndef TEST_SUPPORT_ODOMETRY_H
#define TEST_SUPPORT_ODOMETRY_H

#include <unity.h>

#include <cstddef>
#include <cstdint>

#include "twoview/odometry.h"

inline tv_odometry* make_vga_odometry(uint8_t* memory, size_t bytes) {
  const tv_camera camera = {TV_CAMERA_PINHOLE, 640, 480, 0, 500, 500, 320, 240, {0}};
  tv_odometry_options options;
  tv_odometry_options_init(&options);
  tv_odometry* odometry = nullptr;
  TEST_ASSERT_EQUAL_INT(TV_OK, tv_odometry_init(&odometry, &camera, &options, memory, bytes));
  return odometry;
}

#endif
