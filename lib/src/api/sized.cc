#include "api/sized.h"

#include <cstdint>
#include <cstring>

namespace tv {
namespace {

constexpr uint32_t kLargest = 4096;  // bytes; a larger struct_size is taken as not initialised

// Reads struct_size, the first field of every struct that grows.
uint32_t size_of(const void* object) {
  uint32_t size;
  std::memcpy(&size, object, sizeof size);
  return size;
}

size_t smaller(size_t a, size_t b) { return a < b ? a : b; }

}  // namespace

void init_sized(void* object, size_t struct_size, const void* defaults, size_t known_size) {
  if (object == nullptr) return;
  const uint32_t size = static_cast<uint32_t>(struct_size);
  if (known_size < struct_size) {
    std::memset(static_cast<uint8_t*>(object) + known_size, 0, struct_size - known_size);
  }
  std::memmove(object, defaults, smaller(known_size, struct_size));
  std::memcpy(object, &size, smaller(sizeof size, struct_size));
}

tv_status check_sized(const void* object) {
  const uint32_t size = size_of(object);
  const bool plausible = size >= sizeof size && size <= kLargest && size % sizeof size == 0;
  return plausible ? TV_OK : TV_ERR_STRUCT_SIZE;
}

tv_status check_sized_input(const void* object, size_t known_size) {
  tv_status status = check_sized(object);
  if (status != TV_OK) return status;
  for (size_t k = known_size; k < size_of(object); ++k) {
    if (static_cast<const uint8_t*>(object)[k] != 0) status = TV_ERR_STRUCT_SIZE;
  }
  return status;
}

tv_status read_sized(const void* object, size_t known_size, void* checked) {
  if (object == nullptr) return TV_OK;
  const tv_status status = check_sized_input(object, known_size);
  if (status != TV_OK) return status;
  const size_t size = smaller(known_size, size_of(object));
  const uint32_t own = static_cast<uint32_t>(known_size);
  std::memcpy(checked, object, size);
  // struct_size is set to that of this library, so that *checked may be passed to another call.
  std::memcpy(checked, &own, sizeof own);
  return TV_OK;
}

void write_sized(const void* packed, size_t known_size, void* object) {
  init_sized(object, size_of(object), packed, known_size);
}

}  // namespace tv
