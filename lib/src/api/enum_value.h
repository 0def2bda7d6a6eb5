// The number in an enum that a caller passed, also where no enumerator has this number. In C++,
// reading such an enum is undefined; in C it is not, and callers of the API may be C.
#pragma once

#include <cstring>

namespace tv {

template <typename Enum>
int enum_value(const Enum& value) {
  static_assert(sizeof(Enum) == sizeof(int), "the ABI's enums are ints");
  int number;
  std::memcpy(&number, &value, sizeof number);
  return number;
}

}  // namespace tv
