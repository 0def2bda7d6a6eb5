// The faults of a bad radio link: datagrams are lost, truncated, corrupted, duplicated or
// reordered, each with a probability that a test chooses.
#pragma once

#include <cstdint>
#include <vector>

#include "room/random.h"

namespace simulator {

// The probability, in [0, 1], that a datagram meets each fault.
struct FaultChances {
  double lose = 0, duplicate = 0, reorder = 0, truncate = 0, corrupt = 0;
};

class FaultyLink {
 public:
  using Bytes = std::vector<uint8_t>;
  FaultyLink(const FaultChances& chances, uint64_t seed) : chances_(chances), random_(seed) {}

  // Returns the datagrams that arrive when this one is sent: none, one or several, in their order
  // of arrival. A datagram that is overtaken arrives after the next one that is not lost.
  std::vector<Bytes> send(Bytes datagram);

 private:
  bool happens(double chance) { return chance > 0 && random_.uniform(0, 1) < chance; }
  FaultChances chances_;
  room::Random random_;
  std::vector<Bytes> overtaken_;
};

}  // namespace simulator
