// The simulated drone in virtual time: its firmware, flight, film and bad link are the other side
// of the driver's transport, in place of sockets, so that ten minutes of flight take one. Each
// picture shows its own number, and the true state at each number is kept, so that the driver's
// report on a picture can be compared with the truth.
#pragma once

#include <algorithm>
#include <cstdlib>
#include <cstring>
#include <deque>
#include <string>
#include <utility>
#include <vector>

#include "encode.h"
#include "simulator/faults.h"
#include "simulator/film.h"
#include "simulator/firmware.h"
#include "twoview_drivers/ardrone/transport.h"

namespace simulator {

enum class Cut { kClosed, kReset, kSilent };

struct Exposure {
  uint64_t index = 0;
  int boot = 0;
  int64_t uptime_ns = 0;
  FlightState truth;
};

class VirtualDrone {
 public:
  static constexpr int kWidth = 640, kHeight = 360, kBits = 32, kBlock = 16;
  static constexpr int64_t kMs = 1000000;

  VirtualDrone(const FaultChances& from_drone, const FaultChances& to_drone, int64_t now_ns)
      : now_(now_ns),
        next_exposure_(now_ns),
        firmware_(room_, {0, 0, 0}, 0, Sensors(), now_ns),
        navdata_out_(from_drone, 21),
        commands_in_(to_drone, 22),
        random_(23),
        film_(kWidth, kHeight, 30, 1500),
        luma_(size_t{kWidth} * kHeight),
        exposures_(1024) {}

  void advance(int64_t now_ns) {
    now_ = now_ns;
    firmware_.advance(now_);
    if (is_dead()) return;
    while (const auto packet = firmware_.next_navdata(now_)) {
      for (FaultyLink::Bytes& datagram : navdata_out_.send(*packet)) {
        navdata_.push_back(std::move(datagram));
      }
    }
    while (now_ >= next_exposure_) expose();
  }

  void cut(Cut kind) {
    cut_ = kind;
    is_cut_ = is_open_;
    video_.clear();
  }
  void reboot() {
    firmware_.reboot(now_);
    ++boot_;
    cut(Cut::kReset);
    navdata_.clear();
    dead_until_ = now_ + 1000 * kMs;
  }

  bool is_dead() const { return now_ < dead_until_; }
  int boot() const { return boot_; }
  const Firmware& firmware() const { return firmware_; }
  const Exposure& exposure(uint64_t index) const { return exposures_[index % exposures_.size()]; }

  // Reads the picture number that is drawn as black and white blocks into a decoded picture.
  static uint64_t number_of(const tv_image& image) {
    uint64_t number = 0;
    for (int bit = 0; bit < kBits; ++bit) {
      const int x = bit % 32 * kBlock + kBlock / 2;
      number |= uint64_t{image.data[kBlock / 2 * image.stride_bytes + x] > 128} << bit;
    }
    return number;
  }

  ardrone_transport transport() {
    return {sizeof(ardrone_transport), this, open, send, receive, close, nullptr};
  }

  // The datagrams of the driver in the order of sending, before the link changes them.
  std::vector<std::string> take_sent() { return std::exchange(sent_, {}); }

 private:
  void paint() {
    const int shift = static_cast<int>(num_exposed_ % 64);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        luma_[static_cast<size_t>(y * kWidth + x)] =
            static_cast<uint8_t>(96 + ((x + shift) * 7 / 5 ^ y * 3 / 4) % 64);
      }
    }
    for (int y = 0; y < kBlock; ++y) {
      for (int x = 0; x < kBits * kBlock; ++x) {
        luma_[static_cast<size_t>(y * kWidth + x)] = num_exposed_ >> (x / kBlock) & 1 ? 235 : 16;
      }
    }
  }

  void expose() {
    next_exposure_ += 33333333;
    if (!is_open_) return;
    const Exposure now = {++num_exposed_, boot_, firmware_.uptime_ns(now_), firmware_.truth()};
    exposures_[num_exposed_ % exposures_.size()] = now;
    paint();
    const FilmPacket film = film_.encode(luma_.data(), kWidth);
    ardrone_pave_header header{};
    header.version = 2;
    header.codec = ARDRONE_PAVE_H264;
    header.header_size = 68;
    header.payload_size = static_cast<uint32_t>(film.payload.size());
    header.encoded_width = kWidth;
    header.encoded_height = 368;
    header.display_width = kWidth;
    header.display_height = kHeight;
    header.frame_number = static_cast<uint32_t>(num_exposed_);
    header.timestamp_ms = static_cast<uint32_t>(now.uptime_ns / kMs);
    header.total_chunks = header.total_slices = 1;
    header.frame_type = film.is_key ? ARDRONE_PAVE_IDR : ARDRONE_PAVE_P;
    std::vector<uint8_t> bytes(header.header_size + film.payload.size());
    size_t size = 0;
    if (ardrone_encode_pave(&header, film.payload.data(), bytes.data(), bytes.size(), &size) !=
        TVS_OK) {
      std::abort();
    }
    if (is_cut_) return;
    // Delays of the encoder and the radio; TCP keeps the order.
    const int64_t due = now_ + static_cast<int64_t>(random_.uniform(30, 90)) * kMs;
    last_due_ = due > last_due_ ? due : last_due_;
    video_.push_back({last_due_, std::move(bytes)});
  }

  static tvs_status open(void* user, ardrone_channel channel, int64_t) {
    VirtualDrone& d = *static_cast<VirtualDrone*>(user);
    if (channel != ARDRONE_CHANNEL_VIDEO) return TVS_OK;
    if (d.is_dead()) return TVS_ERR_IO;
    d.is_open_ = true;
    d.is_cut_ = false;
    d.video_.clear();
    return TVS_OK;
  }
  static void close(void* user, ardrone_channel channel) {
    VirtualDrone& d = *static_cast<VirtualDrone*>(user);
    if (channel == ARDRONE_CHANNEL_VIDEO) d.is_open_ = false;
  }
  static tvs_status send(void* user, ardrone_channel channel, const void* data, size_t size) {
    VirtualDrone& d = *static_cast<VirtualDrone*>(user);
    const char* text = static_cast<const char*>(data);
    if (channel == ARDRONE_CHANNEL_AT) d.sent_.emplace_back(text, size);
    if (d.is_dead()) return TVS_OK;
    for (const FaultyLink::Bytes& datagram : d.commands_in_.send({text, text + size})) {
      if (channel == ARDRONE_CHANNEL_NAVDATA)
        d.firmware_.receive_hello(d.now_);
      else
        d.firmware_.receive_commands(
            {reinterpret_cast<const char*>(datagram.data()), datagram.size()}, d.now_);
    }
    return TVS_OK;
  }
  static tvs_status receive(void* user, ardrone_channel channel, void* to, size_t capacity,
                            size_t* size) {
    VirtualDrone& d = *static_cast<VirtualDrone*>(user);
    if (channel == ARDRONE_CHANNEL_NAVDATA) {
      if (d.navdata_.empty()) return TVS_NONE;
      *size = std::min(capacity, d.navdata_.front().size());
      // The faulty link may have cut the packet to 0 bytes.
      if (*size > 0) std::memcpy(to, d.navdata_.front().data(), *size);
      d.navdata_.pop_front();
      return TVS_OK;
    }
    if (channel != ARDRONE_CHANNEL_VIDEO || !d.is_open_) return TVS_ERR_IO;
    if (d.is_cut_ && d.cut_ != Cut::kSilent) return d.cut_ == Cut::kClosed ? TVS_END : TVS_ERR_IO;
    if (d.is_cut_ || d.video_.empty() || d.video_.front().due_ns > d.now_) return TVS_NONE;
    std::vector<uint8_t>& bytes = d.video_.front().bytes;
    *size = std::min({capacity, bytes.size(), static_cast<size_t>(d.random_.uniform(1, 1448))});
    std::memcpy(to, bytes.data(), *size);
    bytes.erase(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(*size));
    if (bytes.empty()) d.video_.pop_front();
    return TVS_OK;
  }

  struct Sending {
    int64_t due_ns;
    std::vector<uint8_t> bytes;
  };
  int64_t now_, next_exposure_, dead_until_ = 0, last_due_ = 0;
  int boot_ = 1;
  room::Room room_;
  Firmware firmware_;
  FaultyLink navdata_out_, commands_in_;
  room::Random random_;
  Film film_;
  std::vector<uint8_t> luma_;
  uint64_t num_exposed_ = 0;
  std::vector<Exposure> exposures_;  // a ring buffer of the latest pictures
  std::deque<FaultyLink::Bytes> navdata_;
  std::deque<Sending> video_;
  bool is_open_ = false, is_cut_ = false;
  Cut cut_ = Cut::kClosed;
  std::vector<std::string> sent_;
};

}  // namespace simulator
