// The firmware of the simulated drone: it executes AT commands, stores a configuration and reports
// its state as navdata. It uses bytes and a clock, but no sockets.
#pragma once

#include <cstdint>
#include <map>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "simulator/flight.h"
#include "simulator/tour.h"

struct ardrone_navdata;

namespace simulator {

// The errors of the sensors: a factor on each true value, and the standard deviation of the noise.
struct Sensors {
  double altitude_factor = 1.0;
  double velocity_factor = 1.0;
  double attitude_noise_rad = 0.002;
  double velocity_noise_m_s = 0.01;
  double altitude_noise_m = 0.003;
  uint64_t seed = 1;
};

class Firmware {
 public:
  Firmware(const room::Room& room, const Vec3& start, double yaw_rad, const Sensors& sensors,
           int64_t now_ns);

  // Handles a datagram that arrived on the AT port, or on the navdata port (which starts the
  // navdata stream).
  void receive_commands(std::string_view datagram, int64_t now_ns);
  void receive_hello(int64_t now_ns);

  // Advances the flight and checks the link's timeout. Call it often.
  void advance(int64_t now_ns);

  // The next navdata packet if it is due, otherwise nothing. Packets are due 15 times a second in
  // bootstrap and in demo mode, and 200 times a second in full mode.
  std::optional<std::vector<uint8_t>> next_navdata(int64_t now_ns);

  // Returns, only once, the text that the control channel must send (the configuration or the list
  // of ids, with a terminating zero byte).
  std::optional<std::string> take_control_text();

  // Restarts the drone as after a change of its battery: it is in bootstrap mode with the factory
  // configuration, its sequence numbers start at 1, and it stands on the ground at its present
  // place.
  void reboot(int64_t now_ns);
  // Sets the reported firmware version. From then on navdata also has options with tags that no
  // known firmware uses.
  void set_version(const std::string& version);
  // From now on the drone flies the tour, and obeys no command that flies it.
  void begin_tour();
  // Sets the sequence number of the next packet, to test the wrap to 0.
  void set_sequence(uint32_t sequence) { sequence_ = sequence; }

  // The time since boot, which the time stamps of navdata and video count.
  int64_t uptime_ns(int64_t now_ns) const { return now_ns - boot_ns_; }
  const FlightState& truth() const { return flight_.state(); }
  bool wants_720p() const;
  bool navdata_runs() const { return hello_; }
  int num_refused() const { return num_refused_; }
  int num_obeyed() const { return num_obeyed_; }
  // The sequence number of the last executed command; 0 after a lost link or a reboot. The number
  // of take-offs so far.
  int32_t last_command() const { return last_command_; }
  int num_take_offs() const { return num_take_offs_; }

 private:
  struct Ids {
    std::string session = "00000000", user = "00000000", application = "00000000";
    bool operator==(const Ids& other) const {
      return session == other.session && user == other.user && application == other.application;
    }
  };
  void obey(std::string_view line, int64_t now_ns);
  void obey_ref(const std::vector<std::string>& arguments);
  void obey_move(const std::vector<std::string>& arguments);
  void obey_config(const std::vector<std::string>& arguments);
  void obey_control(const std::vector<std::string>& arguments);
  bool is_writable(const std::string& key) const;
  void apply_limits();
  double number(const std::string& key) const;
  uint32_t state_word() const;
  uint32_t option_mask() const;
  void fill(int64_t now_ns, ardrone_navdata* navdata);
  std::string configuration_text() const;
  std::string ids_text() const;
  void watch_link(int64_t now_ns);

  Flight flight_;
  std::optional<Tour> tour_;
  Sensors sensors_;
  std::string version_;  // empty: use the factory configuration's version
  std::map<std::string, std::string> configuration_;
  // For each kind of id, {id: its description}.
  std::map<std::string, std::string> sessions_, users_, applications_;
  Ids ids_, addressed_;
  std::vector<std::string> control_texts_;
  bool bootstrap_ = true, acknowledge_ = false, hello_ = false, watchdog_ = false, lost_ = false;
  bool emergency_level_ = false;
  int64_t boot_ns_, advanced_ns_, next_navdata_ns_ = 0, command_ns_;
  uint32_t sequence_ = 1;
  int32_t last_command_ = 0;
  int num_refused_ = 0, num_obeyed_ = 0, num_take_offs_ = 0;
  uint64_t noise_state_;
};

}  // namespace simulator
