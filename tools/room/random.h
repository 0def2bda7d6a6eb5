// The random numbers of the room and its textures: SplitMix64 (G. L. Steele, D. Lea, C. H. Flood,
// 2014). A seed gives the same next() and uniform() on every platform; normal() uses the platform's
// log and cos.
#pragma once

#include <cmath>
#include <cstdint>

namespace room {

class Random {
 public:
  explicit Random(uint64_t seed) : state_(seed) {}
  uint64_t next() {
    uint64_t z = (state_ += 0x9E3779B97F4A7C15u);
    z = (z ^ (z >> 30)) * 0xBF58476D1CE4E5B9u;
    z = (z ^ (z >> 27)) * 0x94D049BB133111EBu;
    return z ^ (z >> 31);
  }
  double uniform(double low, double high) {
    return low + (high - low) * (static_cast<double>(next() >> 11) * 0x1p-53);
  }
  // A standard normal number, by the method of Box and Muller.
  double normal() {
    const double radius = std::sqrt(-2 * std::log(1 - uniform(0, 1)));
    return radius * std::cos(2 * 3.14159265358979323846 * uniform(0, 1));
  }

 private:
  uint64_t state_;
};

}  // namespace room
