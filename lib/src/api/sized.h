// Structs that grow (twoview/status.h has the rule): initialising them, reading as much of an input
// as the caller has, and writing as much of an output as the caller has room for.
#pragma once

#include <cstddef>

#include "twoview/status.h"

namespace tv {

// Writes the known_size bytes of `defaults` into a struct of struct_size bytes, zeros into the
// bytes after them, and struct_size into the first field; never more than struct_size bytes. Null
// is allowed.
void init_sized(void* object, size_t struct_size, const void* defaults, size_t known_size);

// Writes struct_size and zeros into a struct, as init_sized does. Null is allowed.
inline void init_zeros(void* object, size_t struct_size) {
  init_sized(object, struct_size, object, 0);
}

// TV_OK if struct_size can be that of a struct of any release, else TV_ERR_STRUCT_SIZE.
tv_status check_sized(const void* object);

// Like check_sized; TV_ERR_STRUCT_SIZE also if a byte beyond known_size is not zero.
tv_status check_sized_input(const void* object, size_t known_size);

// Copies an input over the defaults that *checked holds; a null input keeps the defaults. On an
// error *checked stays as it was.
tv_status read_sized(const void* object, size_t known_size, void* checked);

template <typename Struct>
tv_status read_sized(const Struct* object, Struct* checked) {
  return read_sized(object, sizeof(Struct), checked);
}

// Writes as much of an output as the caller's struct_size covers, and leaves struct_size as it is.
void write_sized(const void* packed, size_t known_size, void* object);

template <typename Struct>
void write_sized(const Struct& packed, Struct* object) {
  write_sized(&packed, sizeof(Struct), object);
}

}  // namespace tv
