// What a bad radio link does to datagrams, with chances that a test can choose.
#pragma once

#include <cstdint>
#include <vector>

#include "room/random.h"

namespace simulator {

// Each in [0, 1]: the chance that a datagram meets this.
struct FaultChances {
  double lose = 0, duplicate = 0, reorder = 0, truncate = 0, corrupt = 0;
};

class FaultyLink {
 public:
  using Bytes = std::vector<uint8_t>;
  FaultyLink(const FaultChances& chances, uint64_t seed) : chances_(chances), random_(seed) {}

  // What arrives when this is sent: none, one or several datagrams, in the order of arrival. One
  // that is overtaken waits for the next.
  std::vector<Bytes> send(Bytes datagram);

 private:
  bool happens(double chance) { return chance > 0 && random_.uniform(0, 1) < chance; }
  FaultChances chances_;
  room::Random random_;
  std::vector<Bytes> overtaken_;
};

}  // namespace simulator
