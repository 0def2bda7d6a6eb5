// What an odometry keeps in the memory that the caller gives, and where in it each part lies.
// Nothing is allocated afterwards.
#pragma once

#include "odometry/odometry.h"

namespace tv {

struct MemoryPlan {
  tv_camera camera;
  tv_odometry_options options;
  tv_limits limits;      // of the context through which the stages of a frame are called
  size_t context_bytes;  // of that context, of which the last shared_bytes are its scratch
  size_t shared_bytes;
  size_t scratch_bytes;  // beside the context's
  size_t num_bytes;      // of all
};

// What the context must be made for.
tv_limits context_limits(const tv_camera& camera, const tv_odometry_options& options);

// From the camera, the options and the bytes of the context, the bytes of the rest and of all.
void measure_memory(MemoryPlan* plan);

// Lays an odometry out, at memory of num_bytes that is aligned as a context's. What is left to set
// is its context, which is made at *context_memory, and its kernels; then start_anew follows.
Odometry* lay_out(const MemoryPlan& plan, void* memory, uint8_t** context_memory);

}  // namespace tv
