#include "simulator/faults.h"

#include <utility>

namespace simulator {

std::vector<FaultyLink::Bytes> FaultyLink::send(Bytes datagram) {
  std::vector<Bytes> arrived;
  if (happens(chances_.lose) || datagram.empty()) return arrived;
  const double size = static_cast<double>(datagram.size());
  if (happens(chances_.truncate)) datagram.resize(static_cast<size_t>(random_.uniform(0, size)));
  if (happens(chances_.corrupt) && !datagram.empty()) {
    const size_t at = static_cast<size_t>(random_.uniform(0, static_cast<double>(datagram.size())));
    datagram[at] = static_cast<uint8_t>(datagram[at] ^ (1u << (random_.next() & 7)));
  }
  if (overtaken_.empty() && happens(chances_.reorder)) {
    overtaken_.push_back(std::move(datagram));
    return arrived;
  }
  const bool twice = happens(chances_.duplicate);
  arrived.push_back(datagram);
  if (twice) arrived.push_back(std::move(datagram));
  for (Bytes& late : overtaken_) arrived.push_back(std::move(late));
  overtaken_.clear();
  return arrived;
}

}  // namespace simulator
