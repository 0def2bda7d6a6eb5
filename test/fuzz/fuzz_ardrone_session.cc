// A session with a drone that may send anything at any time: no take-off that was not requested, no
// command number that decreases within a link, every datagram complete, every picture released.
#include <cstdlib>
#include <string>

#include "encode.h"
#include "fuzz.h"
#include "twoview_drivers/ardrone/session.h"

namespace {

struct Drone {
  fuzz::Bytes* bytes;
  bool may_fly = false, lost = false;
  int held = 0;
  long last = 0;
  uint32_t sequence = 0;
};

tvs_status open(void* user, ardrone_channel, int64_t) {
  return static_cast<Drone*>(user)->bytes->raw<uint8_t>() < 250 ? TVS_OK : TVS_ERR_IO;
}

void close(void*, ardrone_channel) {}

void check_line(Drone* drone, const std::string& line) {
  FUZZ_REQUIRE(line.compare(0, 3, "AT*") == 0);
  const long number = std::strtol(line.c_str() + line.find('=') + 1, nullptr, 10);
  FUZZ_REQUIRE(number > drone->last || (number == 1 && drone->lost));
  drone->last = number;
  drone->lost = false;
  if (line.compare(0, 7, "AT*REF=") == 0) {
    const long bits = std::strtol(line.c_str() + line.find(',') + 1, nullptr, 10);
    FUZZ_REQUIRE(drone->may_fly || (bits >> 9 & 1) == 0);
  }
}

tvs_status send(void* user, ardrone_channel channel, const void* data, size_t size) {
  FUZZ_REQUIRE(size > 0 && size <= ARDRONE_AT_MAX_BYTES);
  if (channel != ARDRONE_CHANNEL_AT) return TVS_OK;
  const std::string text(static_cast<const char*>(data), size);
  FUZZ_REQUIRE(text.back() == '\r');
  for (size_t at = 0; at < text.size();) {
    const size_t end = text.find('\r', at);
    check_line(static_cast<Drone*>(user), text.substr(at, end - at));
    at = end + 1;
  }
  return TVS_OK;
}

// A navdata packet with values from the input; some packets have a wrong byte.
size_t make_navdata(Drone* drone, uint8_t* to, size_t capacity) {
  static ardrone_navdata navdata;
  size_t size = 0;
  navdata = {};
  drone->sequence += drone->bytes->raw<uint8_t>() < 200 ? 1 : drone->bytes->raw<uint32_t>();
  navdata.sequence = drone->sequence;
  navdata.state = drone->bytes->raw<uint32_t>();
  navdata.present = 3;
  navdata.demo.psi_mdeg = drone->bytes->raw<float>();
  navdata.time.stamp = drone->bytes->raw<uint32_t>();
  ardrone_encode_navdata(&navdata, to, capacity, &size);
  if (drone->bytes->raw<uint8_t>() > 240) to[size / 2] ^= 1;
  return size;
}

size_t make_packet(Drone* drone, uint8_t* to, size_t capacity) {
  static uint32_t number;
  const uint8_t payload[32] = {};
  ardrone_pave_header header{};
  size_t size = 0;
  header.version = 2;
  header.header_size = 64;
  header.payload_size = drone->bytes->raw<uint8_t>() % 33;
  header.encoded_width = header.encoded_height = 16;
  number += drone->bytes->raw<uint8_t>() < 200;
  header.frame_number = number;
  header.timestamp_ms = drone->bytes->raw<uint32_t>();
  header.frame_type = drone->bytes->raw<uint8_t>() % 5;
  header.control = drone->bytes->raw<uint8_t>() > 250;
  ardrone_encode_pave(&header, payload, to, capacity, &size);
  return size;
}

tvs_status receive(void* user, ardrone_channel channel, void* data, size_t capacity, size_t* size) {
  Drone* drone = static_cast<Drone*>(user);
  uint8_t made[512];
  if (drone->bytes->left() == 0) return TVS_NONE;
  const uint8_t kind = drone->bytes->raw<uint8_t>();
  if (kind < 60) return TVS_NONE;
  if (kind < 65) return TVS_END;
  if (kind < 68) return TVS_ERR_IO;
  size_t count = 0;
  if (kind < 230 && channel == ARDRONE_CHANNEL_NAVDATA) {
    count = make_navdata(drone, made, sizeof made);
  } else if (kind < 230 && channel != ARDRONE_CHANNEL_CONTROL) {
    count = make_packet(drone, made, sizeof made);
  } else {
    count = drone->bytes->raw<uint8_t>();
    for (size_t k = 0; k < count; ++k) made[k] = drone->bytes->raw<uint8_t>();
  }
  *size = count < capacity ? count : capacity;
  std::memcpy(data, made, *size);
  return *size > 0 || channel == ARDRONE_CHANNEL_NAVDATA ? TVS_OK : TVS_NONE;
}

void on_event(void* user, ardrone_event event, const char*) {
  Drone* drone = static_cast<Drone*>(user);
  if (event != ARDRONE_EVENT_LINK_LOST && event != ARDRONE_EVENT_REBOOT) return;
  drone->may_fly = false;
  drone->lost = true;
}

tvs_status decode(void* user, const uint8_t* data, size_t size, tvs_picture* picture) {
  static const uint8_t pixel = 0;
  FUZZ_REQUIRE(data != nullptr);
  if (size % 5 == 4) return TVS_ERR_DATA;
  ++static_cast<Drone*>(user)->held;
  picture->image = {&pixel, 1, 1, 1};
  return TVS_OK;
}

void release(void* user, tvs_picture*) { --static_cast<Drone*>(user)->held; }
void reset(void*) {}

void act(ardrone_session* session, Drone* drone, fuzz::Bytes* bytes) {
  const ardrone_move move = {bytes->raw<float>(), bytes->raw<float>(), 0, 0};
  switch (bytes->raw<uint8_t>() % 24) {
    case 0: drone->may_fly |= ardrone_session_take_off(session) == TVS_OK; break;
    case 1:
      ardrone_session_land(session);
      drone->may_fly = false;
      break;
    case 2: ardrone_session_move(session, &move); break;
    case 3:
      ardrone_session_cut_motors(session);
      drone->may_fly = false;
      break;
    case 4: ardrone_session_rearm(session); break;
    case 5: ardrone_session_flat_trim(session); break;
    case 6: ardrone_session_read_config(session); break;
    case 7: ardrone_session_read_ids(session); break;
    case 8: ardrone_session_set(session, "control:outdoor", "TRUE"); break;
    default: break;
  }
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static uint64_t memory[(4 << 20) / 8];
  fuzz::Bytes bytes(data, size);
  Drone drone;
  drone.bytes = &bytes;
  const tvs_decoder decoder = {sizeof decoder, &drone, decode, release, reset};
  const ardrone_transport transport = {sizeof transport, &drone, open,   send,
                                       receive,          close,  nullptr};
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.user = &drone;
  options.on_event = on_event;
  options.decoder = &decoder;
  const uint8_t choice = bytes.raw<uint8_t>();
  options.use_ids = choice & 1;
  options.recording = choice >> 1 & 1;
  options.skip_to_latest = choice >> 2 & 1;
  options.queue_frames = choice >> 3 & 3;
  ardrone_session* session;
  FUZZ_REQUIRE(ardrone_session_init(&session, &options, &transport, memory, sizeof memory) ==
               TVS_OK);
  int64_t now = 0;
  while (bytes.left() > 0) {
    act(session, &drone, &bytes);
    const uint8_t wait = bytes.raw<uint8_t>();
    now += wait < 200 ? wait * 200000 : int64_t{wait - 199} * 100000000;
    FUZZ_REQUIRE(ardrone_session_step(session, now) == TVS_OK);
  }
  ardrone_session_close(session);
  FUZZ_REQUIRE(drone.held == 0);
  return 0;
}
