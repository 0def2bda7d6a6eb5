// The simulated drone follows the protocol's rules; the tests send and compare bytes.
#include <unity.h>

#include <cmath>
#include <cstring>
#include <string>

#include "simulator/firmware.h"
#include "twoview_drivers/ardrone/navdata.h"

using simulator::Firmware;
using simulator::FlightMode;

namespace {

constexpr int64_t kMs = 1000000;

const room::Room& the_room() {
  static const room::Room room;
  return room;
}

// A drone, a virtual clock, and a controller that numbers its commands.
struct Bench {
  int64_t now = 5000 * kMs;
  int sequence = 0;
  Firmware drone{the_room(), {0, 0, 0}, 0, simulator::Sensors(), now};

  void send(const std::string& name, const std::string& arguments = "") {
    std::string line = "AT*" + name + "=" + std::to_string(++sequence);
    if (!arguments.empty()) line += "," + arguments;
    drone.receive_commands(line + "\r", now);
  }
  void wait(int64_t ms) {
    now += ms * kMs;
    drone.advance(now);
  }
  // Lets time pass while the controller repeats its commands every 30 ms.
  void keep(const std::string& ref, int64_t ms) {
    for (int64_t t = 0; t < ms; t += 30) {
      send("REF", ref);
      wait(30);
    }
  }
  ardrone_navdata navdata() {
    ardrone_navdata navdata{};
    for (int k = 0; k < 200; ++k) {
      if (const auto bytes = drone.next_navdata(now)) {
        TEST_ASSERT_EQUAL_INT(TVS_OK,
                              ardrone_navdata_decode(bytes->data(), bytes->size(), &navdata));
        return navdata;
      }
      wait(5);
    }
    TEST_FAIL_MESSAGE("no navdata");
    return navdata;
  }
  // Starts as a driver does: wakes the drone, requests the navdata mode, acknowledges.
  void start(const std::string& demo) {
    drone.receive_hello(now);
    send("CONFIG", "\"general:navdata_demo\",\"" + demo + "\"");
    send("CTRL", "5,0");
  }
};

const std::string kFly = "290718208", kLand = "290717696", kEmergency = "290717952";

void test_a_fresh_drone_is_silent_then_in_bootstrap() {
  Bench b;
  TEST_ASSERT_FALSE(b.drone.next_navdata(b.now).has_value());
  b.drone.receive_hello(b.now);
  const auto first = b.drone.next_navdata(b.now);
  TEST_ASSERT_TRUE(first && first->size() == 24);
  b.wait(200);
  const ardrone_navdata navdata = b.navdata();
  TEST_ASSERT_TRUE(navdata.state & ARDRONE_STATE_BOOTSTRAP);
  TEST_ASSERT_EQUAL_UINT32(0, navdata.present);
  TEST_ASSERT_EQUAL_UINT32(2, navdata.sequence);
}

void test_a_configuration_is_acknowledged_until_the_host_says_so() {
  Bench b;
  b.drone.receive_hello(b.now);
  b.send("CONFIG", "\"general:navdata_demo\",\"FALSE\"");
  TEST_ASSERT_TRUE(b.navdata().state & ARDRONE_STATE_ACKNOWLEDGE);
  b.wait(100);
  TEST_ASSERT_TRUE(b.navdata().state & ARDRONE_STATE_ACKNOWLEDGE);
  b.send("CTRL", "5,0");
  b.wait(100);
  const ardrone_navdata navdata = b.navdata();
  TEST_ASSERT_FALSE(navdata.state & (ARDRONE_STATE_ACKNOWLEDGE | ARDRONE_STATE_BOOTSTRAP));
  TEST_ASSERT_TRUE(ARDRONE_HAS(&navdata, ARDRONE_TAG_DEMO));
  TEST_ASSERT_TRUE(ARDRONE_HAS(&navdata, ARDRONE_TAG_ALTITUDE));
}

int packets_in_a_second(const char* demo) {
  Bench b;
  b.start(demo);
  int count = 0;
  for (int k = 0; k < 1000; ++k) {
    b.wait(1);
    while (b.drone.next_navdata(b.now)) ++count;
  }
  return count;
}

void test_demo_mode_is_15_hz_and_full_mode_200() {
  TEST_ASSERT_INT_WITHIN(1, 15, packets_in_a_second("TRUE"));
  TEST_ASSERT_INT_WITHIN(2, 200, packets_in_a_second("FALSE"));
}

void test_only_rising_numbers_are_obeyed_and_one_begins_anew() {
  Bench b;
  b.start("TRUE");
  b.drone.receive_commands("AT*REF=100,290717696\r", b.now);
  const int obeyed = b.drone.num_obeyed();
  b.drone.receive_commands("AT*REF=100,290718208\rAT*REF=7,290718208\r", b.now);
  TEST_ASSERT_EQUAL_INT(obeyed, b.drone.num_obeyed());
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanded);
  b.drone.receive_commands("AT*REF=1,290718208\r", b.now);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kTakingOff);
  TEST_ASSERT_EQUAL_INT(1, b.drone.last_command());
}

void test_lines_that_are_none_are_refused() {
  Bench b;
  b.start("TRUE");
  const int obeyed = b.drone.num_obeyed();
  b.drone.receive_commands("AT*REF=50,290718208\n", b.now);
  b.drone.receive_commands("AT*REF=51,290718208", b.now);
  b.drone.receive_commands("REF=52,290718208\r", b.now);
  b.drone.receive_commands("AT*CONFIG=53,\"" + std::string(1100, 'a') + "\",\"1\"\r", b.now);
  b.drone.receive_commands("AT*REF=99999999999,290718208\r", b.now);
  TEST_ASSERT_EQUAL_INT(obeyed, b.drone.num_obeyed());
  TEST_ASSERT_EQUAL_INT(5, b.drone.num_refused());
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanded);
}

void test_it_flies_on_ref_alone_and_lands_when_the_controller_dies() {
  Bench b;
  b.start("TRUE");
  b.send("PCMD", "1,0,-1085485875,0,0");
  b.wait(1000);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanded);
  b.keep(kFly, 6000);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kHovering);
  TEST_ASSERT_TRUE(b.navdata().state & ARDRONE_STATE_FLYING);
  b.wait(1900);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kHovering);
  b.wait(200);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanding);
  TEST_ASSERT_EQUAL_INT(0, b.drone.last_command());
  b.wait(6000);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanded);
}

void test_the_watchdog_bit_rises_in_silence_and_falls_on_comwdg() {
  Bench b;
  b.start("TRUE");
  b.wait(40);
  TEST_ASSERT_FALSE(b.navdata().state & ARDRONE_STATE_COM_WATCHDOG);
  b.wait(100);
  TEST_ASSERT_TRUE(b.navdata().state & ARDRONE_STATE_COM_WATCHDOG);
  b.send("COMWDG");
  b.wait(1);
  const auto bytes = [&] {
    b.now += 70 * kMs;
    return b.drone.next_navdata(b.now);
  }();
  ardrone_navdata navdata{};
  TEST_ASSERT_EQUAL_INT(TVS_OK, ardrone_navdata_decode(bytes->data(), bytes->size(), &navdata));
  TEST_ASSERT_FALSE(navdata.state & ARDRONE_STATE_COM_WATCHDOG);
}

void test_emergency_acts_on_its_edge() {
  Bench b;
  b.start("TRUE");
  b.keep(kFly, 6000);
  b.send("REF", kEmergency);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kMotorsCut);
  b.wait(1500);
  b.send("REF", kEmergency);  // the bit is set already, so there is no rising edge
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kMotorsCut);
  TEST_ASSERT_TRUE(b.navdata().state & ARDRONE_STATE_EMERGENCY);
  b.send("REF", kLand);
  b.send("REF", kEmergency);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanded);
}

void test_720p_needs_ids_of_ones_own() {
  Bench b;
  b.start("TRUE");
  const auto set = [&](const char* key, const char* value, bool with_ids) {
    if (with_ids) b.send("CONFIG_IDS", "\"0a1b2c3d\",\"0a1b2c3e\",\"0a1b2c3f\"");
    b.send("CONFIG", std::string("\"") + key + "\",\"" + value + "\"");
    b.send("CTRL", "5,0");
  };
  set("video:video_codec", "131", false);
  TEST_ASSERT_FALSE(b.drone.wants_720p());
  set("custom:session_id", "0a1b2c3d", false);
  set("custom:profile_id", "0a1b2c3e", false);
  set("custom:application_id", "0a1b2c3f", false);
  set("video:video_codec", "131", false);
  TEST_ASSERT_FALSE(b.drone.wants_720p());
  set("video:video_codec", "131", true);
  TEST_ASSERT_TRUE(b.drone.wants_720p());
}

void test_the_control_channel_gives_texts_that_end_in_zero() {
  Bench b;
  b.start("TRUE");
  TEST_ASSERT_FALSE(b.drone.take_control_text().has_value());
  b.send("CTRL", "4,0");
  const auto text = b.drone.take_control_text();
  TEST_ASSERT_TRUE(text && text->back() == '\0');
  TEST_ASSERT_TRUE(text->find("general:num_version_soft = 2.4.8\n") != std::string::npos);
  TEST_ASSERT_FALSE(b.drone.take_control_text().has_value());
  b.send("CTRL", "5,0");
  b.send("CTRL", "6,0");
  const auto ids = b.drone.take_control_text();
  TEST_ASSERT_TRUE(ids && ids->find("[applis]\r00000000,default\r") == 0);
}

void test_navdata_tells_the_truth_in_its_units() {
  Bench b;
  b.start("FALSE");
  b.keep(kFly, 6000);
  for (int k = 0; k < 25; ++k) {  // flies forward and to the right, and turns
    b.send("REF", kFly);
    b.send("PCMD", "1,1045220557,-1097229926,0,1045220557");  // the sticks 0.2 -0.4 0 0.2
    b.wait(30);
  }
  const simulator::FlightState truth = b.drone.truth();
  const ardrone_navdata n = b.navdata();
  constexpr double kDegrees = 180 / 3.14159265358979323846;
  TEST_ASSERT_TRUE(truth.pitch < -0.05 && truth.roll > 0.02 && truth.yaw > 0.02);
  TEST_ASSERT_DOUBLE_WITHIN(600, truth.pitch * kDegrees * 1000, n.demo.theta_mdeg);
  TEST_ASSERT_DOUBLE_WITHIN(600, truth.roll * kDegrees * 1000, n.demo.phi_mdeg);
  TEST_ASSERT_DOUBLE_WITHIN(600, truth.yaw * kDegrees * 1000, n.demo.psi_mdeg);
  const simulator::Vec3 v = simulator::body_velocity(truth);
  TEST_ASSERT_DOUBLE_WITHIN(50, 1000 * v[0], n.demo.velocity_mm_s[0]);
  TEST_ASSERT_DOUBLE_WITHIN(50, 1000 * v[1], n.demo.velocity_mm_s[1]);
  TEST_ASSERT_TRUE(n.demo.velocity_mm_s[2] == 0);
  TEST_ASSERT_DOUBLE_WITHIN(20, -1000 * truth.position[2], n.demo.altitude_mm);
  TEST_ASSERT_DOUBLE_WITHIN(120, -1000, n.phys_measures.acceleration_mg[2]);
}

void test_a_reboot_counts_from_one_again() {
  Bench b;
  b.start("TRUE");
  b.keep(kFly, 4000);
  b.wait(100);
  b.navdata();
  b.drone.reboot(b.now);
  TEST_ASSERT_FALSE(b.drone.next_navdata(b.now).has_value());
  b.drone.receive_hello(b.now);
  const ardrone_navdata n = b.navdata();
  TEST_ASSERT_EQUAL_UINT32(1, n.sequence);
  TEST_ASSERT_TRUE(n.state & ARDRONE_STATE_BOOTSTRAP);
  TEST_ASSERT_TRUE(b.drone.truth().mode == FlightMode::kLanded);
}

}  // namespace

extern "C" void setUp() {}
extern "C" void tearDown() {}

int main() {
  UNITY_BEGIN();
  RUN_TEST(test_a_fresh_drone_is_silent_then_in_bootstrap);
  RUN_TEST(test_a_configuration_is_acknowledged_until_the_host_says_so);
  RUN_TEST(test_demo_mode_is_15_hz_and_full_mode_200);
  RUN_TEST(test_only_rising_numbers_are_obeyed_and_one_begins_anew);
  RUN_TEST(test_lines_that_are_none_are_refused);
  RUN_TEST(test_it_flies_on_ref_alone_and_lands_when_the_controller_dies);
  RUN_TEST(test_the_watchdog_bit_rises_in_silence_and_falls_on_comwdg);
  RUN_TEST(test_emergency_acts_on_its_edge);
  RUN_TEST(test_720p_needs_ids_of_ones_own);
  RUN_TEST(test_the_control_channel_gives_texts_that_end_in_zero);
  RUN_TEST(test_navdata_tells_the_truth_in_its_units);
  RUN_TEST(test_a_reboot_counts_from_one_again);
  return UNITY_END();
}
