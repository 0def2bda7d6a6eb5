// A session with a vehicle that may send anything at any time, whole packets with any values among
// it: every sample has a unit quaternion, finite values and times that rise within a run; nothing
// is sent but HEARTBEAT, TIMESYNC, SET_MESSAGE_INTERVAL, REQUEST_DATA_STREAM and, of a tracker that
// says anything, estimates whose numbers are finite and status texts.
#include <mavlink.h>

#include "fuzz.h"
#include "twoview_drivers/mavlink/estimate.h"

namespace {

struct Vehicle {
  fuzz::Bytes* bytes;
  mavlink_status_t sender{};
  uint32_t boot_ms = 1000;
  int64_t last_device_ns = INT64_MIN;
  uint32_t clock_id = 0;
  int num_frames = 0, held = 0;
};

tvs_status send(void*, const void* data, size_t size) {
  const uint8_t* bytes = static_cast<const uint8_t*>(data);
  FUZZ_REQUIRE(size >= 12 && bytes[0] == MAVLINK_STX);
  const uint32_t id = bytes[7] | bytes[8] << 8 | bytes[9] << 16;
  FUZZ_REQUIRE(id == MAVLINK_MSG_ID_HEARTBEAT || id == MAVLINK_MSG_ID_TIMESYNC ||
               id == MAVLINK_MSG_ID_COMMAND_LONG || id == MAVLINK_MSG_ID_REQUEST_DATA_STREAM ||
               id == MAVLINK_MSG_ID_ODOMETRY || id == MAVLINK_MSG_ID_VISION_POSITION_ESTIMATE ||
               id == MAVLINK_MSG_ID_STATUSTEXT);
  if (id == MAVLINK_MSG_ID_COMMAND_LONG)  // the command lies behind seven floats
    FUZZ_REQUIRE((bytes[10 + 28] | bytes[10 + 29] << 8) == MAV_CMD_SET_MESSAGE_INTERVAL);
  return TVS_OK;
}

float value(fuzz::Bytes* bytes) { return static_cast<float>(bytes->wild(-7, 7)); }

size_t make_packet(Vehicle* v, uint8_t* to) {
  fuzz::Bytes* b = v->bytes;
  mavlink_message_t m;
  const uint8_t system = b->raw<uint8_t>() < 240 ? 1 : 2;
  v->boot_ms += b->raw<uint8_t>() < 245 ? 20 : b->raw<uint32_t>();
  switch (b->raw<uint8_t>() % 6) {
    case 0: {
      const mavlink_heartbeat_t h = {0, 2, b->raw<uint8_t>(), 0, 4, 3};
      mavlink_msg_heartbeat_encode_status(system, 1, &v->sender, &m, &h);
      break;
    }
    case 1: {
      const mavlink_local_position_ned_t p = {v->boot_ms, value(b), value(b), value(b),
                                              value(b),   value(b), value(b)};
      mavlink_msg_local_position_ned_encode_status(system, 1, &v->sender, &m, &p);
      break;
    }
    case 2: {
      mavlink_altitude_t a = {b->raw<uint64_t>(), value(b), value(b), value(b),
                              value(b),           value(b), value(b)};
      mavlink_msg_altitude_encode_status(system, 1, &v->sender, &m, &a);
      break;
    }
    case 3: {
      mavlink_distance_sensor_t d{};
      d.time_boot_ms = v->boot_ms;
      d.max_distance = b->raw<uint16_t>();
      d.current_distance = b->raw<uint16_t>();
      d.orientation = b->raw<uint8_t>() < 200 ? 25 : 0;
      mavlink_msg_distance_sensor_encode_status(system, 1, &v->sender, &m, &d);
      break;
    }
    case 4: {
      mavlink_timesync_t t{};
      t.tc1 = b->raw<int64_t>();
      t.ts1 = b->raw<int64_t>();
      mavlink_msg_timesync_encode_status(system, b->raw<uint8_t>() < 128 ? 1 : 191, &v->sender, &m,
                                         &t);
      break;
    }
    default: {
      const mavlink_attitude_t a = {v->boot_ms, value(b), value(b), value(b),
                                    value(b),   value(b), value(b)};
      mavlink_msg_attitude_encode_status(system, 1, &v->sender, &m, &a);
      break;
    }
  }
  size_t size = mavlink_msg_to_send_buffer(to, &m);
  if (b->raw<uint8_t>() > 245) to[size / 2] ^= 1;
  return size;
}

tvs_status receive(void* user, void* data, size_t capacity, size_t* size) {
  Vehicle* v = static_cast<Vehicle*>(user);
  if (v->bytes->left() == 0) return TVS_NONE;
  const uint8_t kind = v->bytes->raw<uint8_t>();
  if (kind < 60) return TVS_NONE;
  if (kind < 64) return TVS_ERR_IO;
  FUZZ_REQUIRE(capacity >= MAVLINK_MAX_PACKET_LEN);
  uint8_t* to = static_cast<uint8_t*>(data);
  if (kind < 230) {
    *size = make_packet(v, to);
  } else {
    *size = v->bytes->raw<uint8_t>();
    for (size_t k = 0; k < *size; ++k) to[k] = v->bytes->raw<uint8_t>();
  }
  return TVS_OK;
}

void on_imu(void* user, const tvs_imu* s) {
  Vehicle* v = static_cast<Vehicle*>(user);
  const double* q = s->attitude.world_from_body;
  FUZZ_REQUIRE(std::fabs(q[0] * q[0] + q[1] * q[1] + q[2] * q[2] + q[3] * q[3] - 1) < 1e-6);
  FUZZ_REQUIRE(fuzz::all_finite(s->velocity_m_s, 3) && fuzz::all_finite(s->rate_rad_s, 3));
  FUZZ_REQUIRE(std::isfinite(s->altitude_m) && s->attitude.sigma_rad > 0);
  FUZZ_REQUIRE(s->attitude.clock_id != v->clock_id || s->time.device_ns > v->last_device_ns);
  v->clock_id = s->attitude.clock_id;
  v->last_device_ns = s->time.device_ns;
}

tvs_status next_frame(void* user, tvs_frame* frame) {
  Vehicle* v = static_cast<Vehicle*>(user);
  static const uint8_t pixel = 0;
  if (v->bytes->raw<uint8_t>() < 128) return TVS_NONE;
  frame->image = {&pixel, 1, 1, 1};
  frame->number = static_cast<uint64_t>(v->num_frames++);
  frame->time.host_ns = v->bytes->whole(0, 30000) * int64_t{1000000};
  ++v->held;
  return TVS_OK;
}

void release_frame(void* user, tvs_frame*) { --static_cast<Vehicle*>(user)->held; }

void send_track(Vehicle* v, tvm_session* session, tvm_estimator* estimator, int64_t now) {
  fuzz::Bytes* b = v->bytes;
  tv_odometry_state state{};
  state.struct_size = sizeof state;
  state.status = b->whole(0, 4);
  state.has_pose = b->raw<uint8_t>() < 240;
  state.segment = b->whole(0, 2);
  state.scale_source = b->whole(0, 3);
  state.relocated = b->raw<uint8_t>() > 240;
  state.has_covariance = b->raw<uint8_t>() < 200;
  for (int k = 0; k < 3; ++k) state.world_from_cam_t[k] = b->wild(-7, 7);
  const double mount[9] = {0, 0, 1, 1, 0, 0, 0, 1, 0};
  for (int k = 0; k < 9; ++k) state.world_from_cam_R[k] = mount[k];
  if (b->raw<uint8_t>() > 240) state.world_from_cam_R[0] = b->wild(-7, 7);
  for (int k = 0; k < 6; ++k) state.cam_from_world_covariance[7 * k] = std::fabs(b->wild(-12, 7));
  state.scale_sigma = b->wild(-7, 7);
  tvm_track track{};
  track.struct_size = sizeof track;
  track.state = &state;
  track.host_ns = now - b->whole(0, 300) * int64_t{1000000};
  if (b->raw<uint8_t>() > 128) {
    track.has_previous = 1;
    for (int k = 0; k < 9; ++k) track.previous_R[k] = mount[k];
    for (int k = 0; k < 3; ++k) track.previous_t[k] = b->wild(-7, 7);
  }
  tvm_estimate e{};
  e.struct_size = sizeof e;
  const tvs_status status = tvm_session_send_track(session, estimator, &track, &e);
  FUZZ_REQUIRE(status == TVS_OK || status == TVS_NONE || status == TVS_ERR_ARGUMENT);
  if (status == TVS_ERR_ARGUMENT || e.silence != TVM_SILENCE_NONE) return;
  FUZZ_REQUIRE(fuzz::all_finite(e.position_m, 3) && fuzz::all_finite(e.world_from_body, 4));
  FUZZ_REQUIRE(fuzz::all_finite(e.velocity_m_s, 3) && fuzz::all_finite(e.rate_rad_s, 3));
  FUZZ_REQUIRE(fuzz::all_finite(e.pose_covariance, 36));
  FUZZ_REQUIRE(fuzz::all_finite(e.velocity_covariance, 36));
  FUZZ_REQUIRE(e.quality >= 0 && e.quality <= 100 && e.reset_counter >= 0);
}

}  // namespace

int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static uint64_t memory[(1 << 18) / 8];
  fuzz::Bytes bytes(data, size);
  Vehicle vehicle;
  vehicle.bytes = &bytes;
  const tvm_transport transport = {sizeof transport, &vehicle, send, receive, nullptr, nullptr};
  tvm_session_options options;
  tvm_session_options_init(&options);
  options.user = &vehicle;
  options.on_imu = on_imu;
  options.listen_only = bytes.raw<uint8_t>() & 1;
  tvm_session* session;
  FUZZ_REQUIRE(tvm_session_init(&session, &options, &transport, memory, sizeof memory) == TVS_OK);
  const tvs_frame_source camera = {sizeof camera, &vehicle, next_frame, release_frame};
  tvs_frame_source frames;
  FUZZ_REQUIRE(tvm_session_frames(session, &camera, &frames) == TVS_OK);
  tvm_estimator_options estimates;
  tvm_estimator_options_init(&estimates);
  estimates.messages = bytes.whole(1, 3);
  estimates.weak = bytes.whole(0, 1);
  estimates.world = bytes.whole(0, 1);
  tvm_estimator estimator;
  FUZZ_REQUIRE(tvm_estimator_init(&estimator, &estimates) == TVS_OK);
  int64_t now = 0;
  while (bytes.left() > 0) {
    const uint8_t wait = bytes.raw<uint8_t>();
    now += wait < 230 ? wait * 200000 : int64_t{wait - 229} * 200000000;
    const tvs_status status = tvm_session_step(session, now);
    FUZZ_REQUIRE(status == TVS_OK || status == TVS_ERR_IO);
    if (bytes.raw<uint8_t>() > 200) send_track(&vehicle, session, &estimator, now);
    tvs_frame frame{};
    frame.struct_size = sizeof frame;
    while (frames.next(frames.user, &frame) == TVS_OK) frames.release(frames.user, &frame);
  }
  FUZZ_REQUIRE(tvm_session_frames(session, &camera, &frames) == TVS_OK);  // gives all frames back
  FUZZ_REQUIRE(vehicle.held == 0);
  return 0;
}
