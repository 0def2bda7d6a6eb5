// The number in an enum that a caller passed, whatever it is. In C++ even to read an enum out of
// its range is undefined; in C it is not, and the API's callers are C.
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
