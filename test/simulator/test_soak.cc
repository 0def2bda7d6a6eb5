// The driver with its H.264 decoder against the simulated drone on a bad link: one per cent each of
// all datagrams are lost, doubled and overtaken, the video is cut ten times, and the drone reboots
// twice, always in flight. Time is virtual; the test suite runs one minute, scripts/drone_soak ten
// (TWOVIEW_SOAK_SECONDS).
#include <unistd.h>
#include <unity.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <cstdio>
#include <map>

#include "support/virtual_drone.h"
#include "twoview_drivers/ardrone/session.h"
#include "twoview_drivers/attitude.h"
#include "twoview_drivers/h264.h"

using simulator::Cut;
using simulator::Exposure;
using simulator::VirtualDrone;

namespace {

constexpr int64_t kMs = 1000000, kStepNs = 2 * kMs;

double wall_s() {
  return std::chrono::duration<double>(std::chrono::steady_clock::now().time_since_epoch()).count();
}

double soak_seconds() {
  const char* text = std::getenv("TWOVIEW_SOAK_SECONDS");
  return text != nullptr ? std::max(40.0, std::atof(text)) : 60;
}

// The resident memory of this process, in kB.
long resident_kb() {
  long size = 0, resident = 0;
  FILE* file = std::fopen("/proc/self/statm", "r");
  if (file == nullptr) return 0;
  if (std::fscanf(file, "%ld %ld", &size, &resident) != 2) resident = 0;
  std::fclose(file);
  return resident * (sysconf(_SC_PAGESIZE) / 1024);
}

// Wraps libavcodec's decoder: measures its time and counts the pictures that are not released.
struct TimedDecoder {
  tvs_decoder inner{};
  double seconds = 0;
  int held = 0;

  static tvs_status decode(void* user, const uint8_t* bytes, size_t size, tvs_picture* picture) {
    TimedDecoder& d = *static_cast<TimedDecoder*>(user);
    const double start = wall_s();
    const tvs_status status = d.inner.decode(d.inner.user, bytes, size, picture);
    d.seconds += wall_s() - start;
    d.held += status == TVS_OK;
    return status;
  }
  static void release(void* user, tvs_picture* picture) {
    TimedDecoder& d = *static_cast<TimedDecoder*>(user);
    --d.held;
    d.inner.release(d.inner.user, picture);
  }
  static void reset(void* user) {
    TimedDecoder& d = *static_cast<TimedDecoder*>(user);
    d.inner.reset(d.inner.user);
  }
};

struct Soak {
  Soak(const simulator::FaultChances& out, const simulator::FaultChances& in)
      : drone(out, in, 1000 * kMs) {}
  VirtualDrone drone;
  TimedDecoder decoder;
  ardrone_session* session = nullptr;
  void* memory = nullptr;
  tvs_frame_source frames{};
  int64_t now = 1000 * kMs;

  // For each clock id, which changes whenever the world frame of the attitudes does: the drone's
  // own yaw (rad) that is 0 in that frame, and the number of the drone's boot.
  std::map<uint32_t, double> psi0;
  std::map<uint32_t, int> boot_of;
  bool may_restart = true;  // whether the next command's number may be 1 again
  long last_command = 0;
  int num_falls = 0, num_take_offs_asked = 0;

  int num_frames = 0, num_unflagged = 0, num_wrong_pictures = 0, num_stale = 0;
  int num_with_attitude = 0, num_beyond_5_sigma = 0, num_late_attitudes = 0;
  double worst_rad = 0, sum_sq = 0;
  uint64_t last_number = 0;
  std::vector<double> own_ms;

  // The state from a cut of the video to the next picture.
  int64_t cut_ns = 0;
  Cut cut = Cut::kClosed;
  bool awaits = false;
  double worst_back_s[3] = {0, 0, 0};
};

Soak* soak;

void on_event(void*, ardrone_event event, const char*) {
  if (event == ARDRONE_EVENT_LINK_LOST || event == ARDRONE_EVENT_REBOOT) soak->may_restart = true;
}

void on_navdata(void*, const uint8_t*, size_t, const ardrone_navdata* navdata, const tvs_imu* imu) {
  if ((imu->valid & TVS_IMU_ATTITUDE) == 0) return;
  const double* q = imu->attitude.world_from_body;
  const double yaw =
      std::atan2(2 * (q[0] * q[3] + q[1] * q[2]), 1 - 2 * (q[2] * q[2] + q[3] * q[3]));
  soak->psi0[imu->attitude.clock_id] = navdata->demo.psi_mdeg * 1.7453292519943295e-5 - yaw;
  soak->boot_of[imu->attitude.clock_id] = soak->drone.boot();
}

void begin(const simulator::FaultChances& out, const simulator::FaultChances& in) {
  soak = new Soak(out, in);
  TEST_ASSERT_EQUAL_INT(TVS_OK, tvs_h264_open(&soak->decoder.inner));
  const tvs_decoder decoder = {sizeof decoder, &soak->decoder, TimedDecoder::decode,
                               TimedDecoder::release, TimedDecoder::reset};
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.decoder = &decoder;
  options.on_event = on_event;
  options.on_navdata = on_navdata;
  const ardrone_transport transport = soak->drone.transport();
  size_t size;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_size(&options, &size));
  soak->memory = std::malloc(size);
  TEST_ASSERT_EQUAL_INT(
      TVS_OK, ardrone_session_init(&soak->session, &options, &transport, soak->memory, size));
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_frames(soak->session, &soak->frames));
}

void end() {
  ardrone_session_close(soak->session);
  soak->session = nullptr;
  TEST_ASSERT_EQUAL_INT(0, soak->decoder.held);
  tvs_h264_close(&soak->decoder.inner);
  std::free(soak->memory);
  delete soak;
  soak = nullptr;
}

// Command numbers rise; they start at 1 only after the driver has reported a new link.
void check_commands() {
  for (const std::string& datagram : soak->drone.take_sent()) {
    TEST_ASSERT_TRUE(datagram.size() <= ARDRONE_AT_MAX_BYTES && datagram.back() == '\r');
    for (size_t at = 0; at < datagram.size(); at = datagram.find('\r', at) + 1) {
      const long number = std::strtol(datagram.c_str() + datagram.find('=', at) + 1, nullptr, 10);
      const bool is_first = number == 1 && soak->may_restart;
      soak->num_falls += !is_first && number <= soak->last_command;
      soak->may_restart = soak->may_restart && !is_first;
      soak->last_command = number;
    }
  }
}

void check_attitude(const tvs_frame& frame, const Exposure& exposure) {
  ++soak->num_with_attitude;
  const uint32_t id = frame.attitude.clock_id;
  soak->num_stale += soak->boot_of.count(id) == 0 || soak->boot_of[id] != exposure.boot;
  const simulator::FlightState& t = exposure.truth;
  double truth[4], dot = 0;
  tvs_quaternion_from_euler(t.yaw - soak->psi0[id], t.pitch, t.roll, truth);
  for (int k = 0; k < 4; ++k) dot += truth[k] * frame.attitude.world_from_body[k];
  const double error = 2 * std::acos(std::min(1.0, std::fabs(dot)));
  soak->worst_rad = std::max(soak->worst_rad, error);
  soak->sum_sq += error * error;
  soak->num_beyond_5_sigma += error > 5 * frame.attitude.sigma_rad;
}

void check_frame(const tvs_frame& frame) {
  const bool follows = soak->num_frames > 0 && frame.number == soak->last_number + 1;
  if (soak->num_frames > 0 && !follows && !(frame.flags & TVS_FRAME_GAP)) ++soak->num_unflagged;
  ++soak->num_frames;
  soak->last_number = frame.number;
  soak->num_wrong_pictures += frame.image.width != VirtualDrone::kWidth ||
                              frame.image.height != VirtualDrone::kHeight ||
                              VirtualDrone::number_of(frame.image) != frame.number;
  if (frame.flags & TVS_FRAME_HAS_ATTITUDE) {
    check_attitude(frame, soak->drone.exposure(frame.number));
  }
  if (!soak->awaits) return;
  double& worst = soak->worst_back_s[static_cast<int>(soak->cut)];
  worst = std::max(worst, static_cast<double>(soak->now - soak->cut_ns) * 1e-9);
  soak->awaits = false;
}

// A pilot who always flies: he takes off as soon as the drone allows it, then turns and tilts to
// and fro.
void fly() {
  const ardrone_navdata* n = ardrone_session_navdata(soak->session);
  if (n == nullptr || !ardrone_session_is_up(soak->session)) return;
  if ((n->state & ARDRONE_STATE_FLYING) == 0) {
    soak->num_take_offs_asked += ardrone_session_take_off(soak->session) == TVS_OK;
    return;
  }
  const double t = static_cast<double>(soak->now) * 1e-9;
  const ardrone_move move = {
      static_cast<float>(0.3 * std::sin(2 * t)), static_cast<float>(0.3 * std::cos(1.7 * t)),
      static_cast<float>(0.2 * std::sin(0.9 * t)), static_cast<float>(0.7 * std::sin(0.6 * t))};
  ardrone_session_move(soak->session, &move);
}

void step() {
  soak->now += kStepNs;
  soak->drone.advance(soak->now);
  const double start = wall_s(), decoding = soak->decoder.seconds;
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_session_step(soak->session, soak->now));
  const double own = wall_s() - start - (soak->decoder.seconds - decoding);
  check_commands();
  tvs_frame frame{};
  frame.struct_size = sizeof frame;
  while (soak->frames.next(soak->frames.user, &frame) == TVS_OK) {
    if (soak->own_ms.size() < 20000) soak->own_ms.push_back(own * 1e3);
    check_frame(frame);
    soak->frames.release(soak->frames.user, &frame);
  }
}

void run(double seconds) {
  const int64_t end_ns = soak->now + static_cast<int64_t>(seconds * 1e9);
  for (int k = 0; soak->now < end_ns; ++k) {
    step();
    if (k % 50 == 0) fly();
  }
}

void cut_video(Cut kind) {
  soak->drone.cut(kind);
  soak->cut = kind;
  soak->cut_ns = soak->now;
  soak->awaits = true;
}

void test_minutes_of_a_bad_link() {
  const double seconds = soak_seconds(), part = seconds / 12;
  simulator::FaultChances faults;
  faults.lose = faults.duplicate = faults.reorder = 0.01;
  begin(faults, faults);
  soak->own_ms.reserve(20000);
  run(part);
  const long before_kb = resident_kb();
  for (int k = 0; k < 10; ++k) {
    cut_video(static_cast<Cut>(k % 3));
    run(k == 3 || k == 6 ? part / 2 : part);
    if (k == 3 || k == 6) {
      soak->drone.reboot();
      run(part / 2);
    }
  }
  run(part);
  const long grown_kb = resident_kb() - before_kb;
  ardrone_counters n;
  ardrone_session_counters(soak->session, &n);
  std::sort(soak->own_ms.begin(), soak->own_ms.end());
  const double median_ms = soak->own_ms[soak->own_ms.size() / 2];
  const double rms = std::sqrt(soak->sum_sq / std::max(1, soak->num_with_attitude));
  std::printf(
      "%.0f s: %d pictures (%.1f a second), %d with attitude, error %.4f rad rms, %.4f worst; "
      "video back in "
      "%.2f s closed, %.2f s reset, %.2f s silent\n",
      seconds, soak->num_frames, soak->num_frames / seconds, soak->num_with_attitude, rms,
      soak->worst_rad, soak->worst_back_s[0], soak->worst_back_s[1], soak->worst_back_s[2]);
  std::printf(
      "navdata %llu (%.0f a second), %llu late, %llu missing, %llu rejected; links %llu, reboots "
      "%llu, "
      "video connections %llu, gaps %llu, take-offs %d; the driver's own time a picture %.3f ms "
      "median, "
      "%.3f ms at 99 of 100; memory %+ld kB\n",
      (unsigned long long)n.navdata_received, (double)n.navdata_received / seconds,
      (unsigned long long)n.navdata_late, (unsigned long long)n.navdata_missing,
      (unsigned long long)n.navdata_rejected, (unsigned long long)n.links,
      (unsigned long long)n.reboots, (unsigned long long)n.video_connections,
      (unsigned long long)n.gaps, soak->num_take_offs_asked, median_ms,
      soak->own_ms[soak->own_ms.size() * 99 / 100], grown_kb);
  TEST_ASSERT_EQUAL_INT(0, soak->num_falls);
  TEST_ASSERT_EQUAL_INT(0, soak->num_unflagged);
  TEST_ASSERT_EQUAL_INT(0, soak->num_wrong_pictures);
  TEST_ASSERT_EQUAL_INT(0, soak->num_stale);
  TEST_ASSERT_EQUAL_INT(0, soak->num_beyond_5_sigma);
  // The attitudes have noise of 0.002 rad on each axis; 0.015 rad are 15 ms of a turn at 1 rad/s.
  TEST_ASSERT_TRUE(soak->worst_rad < 0.015);
  TEST_ASSERT_TRUE(soak->num_with_attitude > 0.95 * soak->num_frames);
  TEST_ASSERT_TRUE(soak->worst_back_s[0] < 1 && soak->worst_back_s[1] < 1);
  TEST_ASSERT_TRUE(soak->worst_back_s[2] < 2);
  TEST_ASSERT_EQUAL_UINT64(2, n.reboots);
  TEST_ASSERT_EQUAL_UINT64(3, n.links);
  TEST_ASSERT_EQUAL_UINT64(13, n.video_connections);
  TEST_ASSERT_EQUAL_INT(3, soak->drone.firmware().num_take_offs());
  // The lower bounds allow for the frames that each cut and boot costs, and for one in a hundred
  // that the latency rule drops.
  TEST_ASSERT_TRUE(soak->num_frames > 29 * (seconds - 12));
  TEST_ASSERT_TRUE((double)n.navdata_received > 190 * (seconds - 6));
  TEST_ASSERT_TRUE(median_ms < 1);
#ifndef TWOVIEW_SANITIZED
  TEST_ASSERT_TRUE(grown_kb < 1024);
#endif
  end();
}

// Packets are also shortened and bits inverted: these packets are refused, and nothing else
// changes.
void test_broken_navdata_is_never_used() {
  simulator::FaultChances faults;
  faults.truncate = faults.corrupt = faults.lose = 0.1;
  begin(faults, {});
  run(20);
  ardrone_counters n;
  ardrone_session_counters(soak->session, &n);
  TEST_ASSERT_TRUE(n.navdata_rejected > 400);
  TEST_ASSERT_TRUE(soak->num_with_attitude > 400);
  TEST_ASSERT_EQUAL_INT(0, soak->num_beyond_5_sigma);
  TEST_ASSERT_EQUAL_INT(0, soak->num_falls);
  TEST_ASSERT_EQUAL_UINT64(1, n.links);
  end();
}

}  // namespace

void setUp() {}
void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_minutes_of_a_bad_link);
  RUN_TEST(test_broken_navdata_is_never_used);
  return UNITY_END();
}
