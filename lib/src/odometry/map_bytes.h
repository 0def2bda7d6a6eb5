// The map as bytes: docs/formats.md, section "The bytes of a map". Tests:
// test/api/test_odometry_api.c, test/fuzz/fuzz_odometry_map.cc.
#pragma once

#include "odometry/odometry.h"

namespace tv {

// Returns how many bytes the map takes, and writes them to `to` unless it is null.
size_t write_map(const Odometry& odometry, uint8_t* to);

// Replaces the map, or adds the map of the bytes to it, with numbers that follow its own. On any
// status but TV_OK, which are those of tv_odometry_load, the odometry is as before.
tv_status read_map(const uint8_t* bytes, size_t num_bytes, bool replaces, Odometry* odometry);

}  // namespace tv
