#include "simulator/firmware.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "encode.h"
#include "room/random.h"
#include "twoview_drivers/ardrone/config.h"

namespace simulator {
namespace {

constexpr int64_t kSecond = 1000000000;
constexpr int64_t kWatchdogNs = 50000000;
constexpr int64_t kDemoPeriodNs = kSecond / 15, kFullPeriodNs = kSecond / 200;
constexpr double kDegrees = 180 / 3.14159265358979323846;
const char kDefaultId[] = "00000000", kVersionKey[] = "general:num_version_soft";

// Approximately the configuration of a new drone, reduced to the keys that a driver requests.
std::map<std::string, std::string> factory_configuration() {
  return {{"general:num_version_config", "1"},
          {"general:num_version_mb", "33"},
          {kVersionKey, "2.4.8"},
          {"general:drone_serial", "XXXXXXXXXX"},
          {"general:soft_build_date", "2013-07-05 16:18"},
          {"general:ardrone_name", "twoview simulator"},
          {"general:navdata_demo", "TRUE"},
          {"general:navdata_options", "65537"},
          {"general:com_watchdog", "2"},
          {"general:video_enable", "TRUE"},
          {"general:vision_enable", "TRUE"},
          {"general:vbat_min", "9000"},
          {"control:altitude_max", "3000"},
          {"control:altitude_min", "50"},
          {"control:euler_angle_max", "0.2094395"},
          {"control:control_vz_max", "700"},
          {"control:control_yaw", "1.7453293"},
          {"control:outdoor", "FALSE"},
          {"control:flight_without_shell", "FALSE"},
          {"control:flying_mode", "0"},
          {"control:flight_anim", "0,0"},
          {"video:codec_fps", "30"},
          {"video:video_codec", "129"},
          {"video:video_channel", "0"},
          {"video:bitrate", "1000"},
          {"video:max_bitrate", "1000"},
          {"video:bitrate_ctrl_mode", "0"},
          {"video:video_on_usb", "TRUE"},
          {"leds:leds_anim", "0,0,0"},
          {"detect:detect_type", "3"},
          {"userbox:userbox_cmd", "0"},
          {"gps:latitude", "500.0"},
          {"gps:longitude", "500.0"},
          {"gps:altitude", "0.0"},
          {"network:ssid_single_player", "ardrone2_simulated"},
          {"network:wifi_mode", "0"},
          {"network:owner_mac", "00:00:00:00:00:00"},
          {"custom:session_id", kDefaultId},
          {"custom:application_id", kDefaultId},
          {"custom:profile_id", kDefaultId},
          {"custom:session_desc", "default"},
          {"custom:application_desc", "default"},
          {"custom:profile_desc", "default"}};
}

// The arguments of a command. They are split at the commas outside quotes, and the quotes are
// removed.
std::vector<std::string> split_arguments(std::string_view text) {
  std::vector<std::string> arguments(1);
  bool quoted = false;
  for (const char c : text) {
    if (c == '"') {
      quoted = !quoted;
    } else if (c == ',' && !quoted) {
      arguments.emplace_back();
    } else {
      arguments.back() += c;
    }
  }
  return arguments;
}

std::optional<int32_t> to_int(const std::string& text) {
  char* end = nullptr;
  const long long value = std::strtoll(text.c_str(), &end, 10);
  if (end == text.c_str() || *end != '\0' || value < INT32_MIN || value > INT32_MAX) return {};
  return static_cast<int32_t>(value);
}

// The stick value of an argument, which is the integer with the same bits as a float. It is empty
// unless the float is in [-1, 1].
std::optional<double> to_stick(const std::string& text) {
  const std::optional<int32_t> bits = to_int(text);
  if (!bits) return {};
  float value;
  std::memcpy(&value, &*bits, sizeof value);
  if (!(value >= -1 && value <= 1)) return {};
  return value;
}

// Adds options with tags that no known firmware uses. They are placed before the checksum, which is
// always the last option.
void add_unknown_options(std::vector<uint8_t>& packet) {
  const std::vector<uint8_t> options = {40, 0, 12, 0, 1, 2, 3, 4, 5, 6, 7, 8, 0x32, 0x88, 4, 0};
  packet.insert(packet.end() - 8, options.begin(), options.end());
  uint32_t sum = 0;
  for (size_t k = 0; k + 8 < packet.size(); ++k) sum += packet[k];
  for (size_t k = 0; k < 4; ++k) packet[packet.size() - 4 + k] = static_cast<uint8_t>(sum >> 8 * k);
}

bool is_id(const std::string& text) {
  return text.size() == 8 && text.find_first_not_of("0123456789abcdefABCDEF") == std::string::npos;
}

// Writing a custom id makes it the current one. Writing "-<id>" deletes one id, and "-all" deletes
// every id except the default.
void choose_id(const std::string& value, std::map<std::string, std::string>& known,
               std::string& current) {
  if (value == "-all") {
    known.clear();
    current = kDefaultId;
  } else if (!value.empty() && value[0] == '-') {
    known.erase(value.substr(1));
    if (current == value.substr(1)) current = kDefaultId;
  } else if (is_id(value)) {
    if (value != kDefaultId) known.emplace(value, "");
    current = value;
  }
}

}  // namespace

Firmware::Firmware(const room::Room& room, const Vec3& start, double yaw_rad,
                   const Sensors& sensors, int64_t now_ns)
    : flight_(room, start, yaw_rad),
      sensors_(sensors),
      configuration_(factory_configuration()),
      boot_ns_(now_ns),
      advanced_ns_(now_ns),
      command_ns_(now_ns),
      noise_state_(sensors.seed) {
  apply_limits();
}

void Firmware::set_version(const std::string& version) {
  version_ = version;
  configuration_[kVersionKey] = version;
}

void Firmware::reboot(int64_t now_ns) {
  flight_.cut_motors();
  flight_.advance(3);  // 3 s are enough to land from any height in the room
  flight_.rearm();
  configuration_ = factory_configuration();
  if (!version_.empty()) configuration_[kVersionKey] = version_;
  ids_ = addressed_ = Ids();
  control_texts_.clear();
  bootstrap_ = true;
  acknowledge_ = hello_ = watchdog_ = lost_ = emergency_level_ = false;
  boot_ns_ = advanced_ns_ = command_ns_ = now_ns;
  sequence_ = 1;
  last_command_ = 0;
  apply_limits();
}

void Firmware::receive_hello(int64_t now_ns) {
  if (!hello_) next_navdata_ns_ = now_ns;
  hello_ = true;
}

void Firmware::receive_commands(std::string_view datagram, int64_t now_ns) {
  while (!datagram.empty()) {
    const size_t end = datagram.find('\r');
    if (end == std::string_view::npos) {
      ++num_refused_;  // a command without a final '\r' is refused
      return;
    }
    obey(datagram.substr(0, end), now_ns);
    datagram.remove_prefix(end + 1);
  }
}

void Firmware::obey(std::string_view line, int64_t now_ns) {
  const size_t equals = line.find('=');
  if (line.size() > 1023 || line.substr(0, 3) != "AT*" || equals == std::string_view::npos) {
    ++num_refused_;
    return;
  }
  const std::string name(line.substr(3, equals - 3));
  std::vector<std::string> arguments = split_arguments(line.substr(equals + 1));
  const std::optional<int32_t> sequence = to_int(arguments[0]);
  if (!sequence || (*sequence <= last_command_ && *sequence != 1)) {
    ++num_refused_;
    return;
  }
  last_command_ = *sequence;
  command_ns_ = now_ns;
  lost_ = false;
  ++num_obeyed_;
  arguments.erase(arguments.begin());
  if (name == "REF") obey_ref(arguments);
  if (name == "PCMD" || name == "PCMD_MAG") obey_move(arguments);
  if (name == "CONFIG") obey_config(arguments);
  if (name == "CONFIG_IDS" && arguments.size() == 3) {
    addressed_ = {arguments[0], arguments[1], arguments[2]};
  } else {
    addressed_ = {};  // CONFIG_IDS applies only to the command after it
  }
  if (name == "CTRL") obey_control(arguments);
  if (name == "COMWDG") watchdog_ = false;
}

void Firmware::begin_tour() {
  if (!tour_) tour_.emplace(flight_.state().position);
}

void Firmware::obey_ref(const std::vector<std::string>& arguments) {
  if (tour_) return;
  const std::optional<int32_t> bits = arguments.empty() ? std::nullopt : to_int(arguments[0]);
  if (!bits) return;
  const bool emergency = (*bits & 256) != 0, fly = (*bits & 512) != 0;
  if (emergency && !emergency_level_) {
    flight_.state().mode == FlightMode::kMotorsCut ? flight_.rearm() : flight_.cut_motors();
  }
  emergency_level_ = emergency;
  const bool on_ground = flight_.state().mode == FlightMode::kLanded;
  if (fly && on_ground && !bootstrap_) {
    flight_.take_off();
    ++num_take_offs_;
  }
  if (!fly) flight_.land();
}

void Firmware::obey_move(const std::vector<std::string>& arguments) {
  if (tour_) return;
  if (arguments.size() < 5) return;
  const std::optional<int32_t> flags = to_int(arguments[0]);
  if (!flags || (*flags & 1) == 0) {
    flight_.hover();
    return;
  }
  const std::optional<double> roll = to_stick(arguments[1]), pitch = to_stick(arguments[2]);
  const std::optional<double> climb = to_stick(arguments[3]), turn = to_stick(arguments[4]);
  if (roll && pitch && climb && turn) flight_.steer({*roll, *pitch, *climb, *turn});
}

bool Firmware::is_writable(const std::string& key) const {
  return !ardrone_config_needs_ids(key.c_str()) ||
         (addressed_ == ids_ && ids_.session != kDefaultId);
}

void Firmware::obey_config(const std::vector<std::string>& arguments) {
  if (arguments.size() != 2 || acknowledge_) return;  // the last CONFIG is not yet acknowledged
  const std::string &key = arguments[0], &value = arguments[1];
  acknowledge_ = true;
  bootstrap_ = false;
  if (key == "custom:session_id") choose_id(value, sessions_, ids_.session);
  if (key == "custom:profile_id") choose_id(value, users_, ids_.user);
  if (key == "custom:application_id") choose_id(value, applications_, ids_.application);
  if (key == "custom:session_desc" && sessions_.count(ids_.session))
    sessions_[ids_.session] = value;
  if (key == "custom:profile_desc" && users_.count(ids_.user)) users_[ids_.user] = value;
  if (key == "custom:application_desc" && applications_.count(ids_.application)) {
    applications_[ids_.application] = value;
  }
  configuration_["custom:session_id"] = ids_.session;
  configuration_["custom:profile_id"] = ids_.user;
  configuration_["custom:application_id"] = ids_.application;
  const bool is_id_key = key.size() > 10 && key.compare(0, 7, "custom:") == 0 &&
                         key.compare(key.size() - 3, 3, "_id") == 0;
  if (!is_id_key && is_writable(key)) configuration_[key] = value;
  apply_limits();
}

void Firmware::obey_control(const std::vector<std::string>& arguments) {
  const std::optional<int32_t> mode = arguments.empty() ? std::nullopt : to_int(arguments[0]);
  if (!mode) return;
  if (*mode == ARDRONE_CTRL_ACKNOWLEDGE) acknowledge_ = false;
  if (*mode == ARDRONE_CTRL_SEND_CONFIG || *mode == ARDRONE_CTRL_SEND_IDS) {
    acknowledge_ = true;
    // A second request before the text was fetched does not add a second copy of the text.
    control_texts_.assign(1, *mode == ARDRONE_CTRL_SEND_CONFIG ? configuration_text() : ids_text());
  }
}

double Firmware::number(const std::string& key) const {
  return std::strtod(configuration_.at(key).c_str(), nullptr);
}

void Firmware::apply_limits() {
  FlightLimits limits;
  limits.tilt_rad = std::clamp(number("control:euler_angle_max"), 0.0, 0.52);
  limits.climb_m_s = std::clamp(number("control:control_vz_max") / 1000, 0.2, 2.0);
  limits.turn_rad_s = std::clamp(number("control:control_yaw"), 0.7, 6.11);
  limits.altitude_m = std::clamp(number("control:altitude_max") / 1000, 0.5, 100.0);
  flight_.set_limits(limits);
}

bool Firmware::wants_720p() const { return configuration_.at("video:video_codec") == "131"; }

void Firmware::advance(int64_t now_ns) {
  if (tour_) tour_->steer(flight_, static_cast<double>(now_ns - advanced_ns_) * 1e-9);
  flight_.advance(static_cast<double>(now_ns - advanced_ns_) * 1e-9);
  advanced_ns_ = now_ns;
  watch_link(now_ns);
}

void Firmware::watch_link(int64_t now_ns) {
  const int64_t silent_ns = now_ns - command_ns_;
  if (silent_ns > kWatchdogNs) watchdog_ = true;
  if (silent_ns > static_cast<int64_t>(number("general:com_watchdog") * 1e9) && !lost_) {
    lost_ = true;
    last_command_ = 0;  // the next controller starts with sequence number 1
    emergency_level_ = false;
    flight_.land();
  }
}

uint32_t Firmware::state_word() const {
  const FlightMode mode = flight_.state().mode;
  uint32_t state = ARDRONE_STATE_VIDEO | ARDRONE_STATE_VISION | ARDRONE_STATE_ALTITUDE_CONTROL |
                   ARDRONE_STATE_CAMERA_READY | ARDRONE_STATE_PIC_VERSION_OK |
                   ARDRONE_STATE_AT_THREAD | ARDRONE_STATE_NAVDATA_THREAD |
                   ARDRONE_STATE_VIDEO_THREAD | ARDRONE_STATE_ACQUISITION_THREAD;
  if (mode != FlightMode::kLanded && mode != FlightMode::kMotorsCut) state |= ARDRONE_STATE_FLYING;
  if (mode == FlightMode::kMotorsCut)
    state |= ARDRONE_STATE_EMERGENCY | ARDRONE_STATE_USER_EMERGENCY;
  if (configuration_.at("general:navdata_demo") == "TRUE") state |= ARDRONE_STATE_DEMO;
  if (acknowledge_) state |= ARDRONE_STATE_ACKNOWLEDGE;
  if (bootstrap_) state |= ARDRONE_STATE_BOOTSTRAP;
  if (watchdog_) state |= ARDRONE_STATE_COM_WATCHDOG;
  if (lost_) state |= ARDRONE_STATE_COM_LOST;
  return state;
}

uint32_t Firmware::option_mask() const {
  if (bootstrap_) return 0;
  const uint32_t all = (1u << ARDRONE_TAG_GPS) - 1;
  if (configuration_.at("general:navdata_demo") != "TRUE") return all;
  const uint32_t asked = static_cast<uint32_t>(number("general:navdata_options"));
  return (asked | 1u << ARDRONE_TAG_DEMO) & all;
}

void Firmware::fill(int64_t now_ns, ardrone_navdata* navdata) {
  const FlightState& state = flight_.state();
  room::Random random(noise_state_);
  noise_state_ = random.next();
  const auto noisy = [&](double value, double sigma) { return value + sigma * random.normal(); };
  const Vec3 v = body_velocity(state), force = specific_force(state);
  const double height =
      std::max(0.0, noisy(flight_.height() * sensors_.altitude_factor, sensors_.altitude_noise_m));
  const bool in_air = (state_word() & ARDRONE_STATE_FLYING) != 0;
  navdata->state = state_word();
  navdata->sequence = sequence_;
  navdata->vision_defined = 1;
  navdata->present = option_mask();

  ardrone_demo& demo = navdata->demo;
  constexpr uint32_t kMajor[] = {ARDRONE_CONTROL_LANDED,   ARDRONE_CONTROL_TAKING_OFF,
                                 ARDRONE_CONTROL_HOVERING, ARDRONE_CONTROL_FLYING,
                                 ARDRONE_CONTROL_LANDING,  ARDRONE_CONTROL_DEFAULT};
  demo.ctrl_state = kMajor[static_cast<int>(state.mode)] << 16;
  demo.battery_percent =
      static_cast<uint32_t>(std::max<int64_t>(5, 100 - uptime_ns(now_ns) / (10 * kSecond)));
  const double pitch = noisy(state.pitch, sensors_.attitude_noise_rad);
  const double roll = noisy(state.roll, sensors_.attitude_noise_rad);
  const double yaw = noisy(state.yaw, sensors_.attitude_noise_rad);
  demo.theta_mdeg = static_cast<float>(pitch * kDegrees * 1000);
  demo.phi_mdeg = static_cast<float>(roll * kDegrees * 1000);
  demo.psi_mdeg = static_cast<float>(yaw * kDegrees * 1000);
  demo.altitude_mm = in_air ? static_cast<int32_t>(std::lround(height * 1000)) : 0;
  for (size_t k = 0; k < 2; ++k) {  // sets x and y; a real drone reports z = 0
    demo.velocity_mm_s[k] = in_air
                                ? static_cast<float>(1000 * noisy(v[k] * sensors_.velocity_factor,
                                                                  sensors_.velocity_noise_m_s))
                                : 0.0f;
  }
  navdata->time = ardrone_encode_time(uptime_ns(now_ns));
  for (size_t k = 0; k < 3; ++k) {
    navdata->phys_measures.acceleration_mg[k] = static_cast<float>(noisy(force[k] / 9.81e-3, 3));
  }
  navdata->phys_measures.rate_deg_s[0] = static_cast<float>(noisy(state.roll_rate * kDegrees, 0.1));
  navdata->phys_measures.rate_deg_s[1] =
      static_cast<float>(noisy(state.pitch_rate * kDegrees, 0.1));
  navdata->phys_measures.rate_deg_s[2] = static_cast<float>(noisy(state.yaw_rate * kDegrees, 0.1));
  navdata->euler_angles.theta_mdeg = demo.theta_mdeg;
  navdata->euler_angles.phi_mdeg = demo.phi_mdeg;
  navdata->altitude.vision_mm = static_cast<int32_t>(std::lround(height * 1000));
  // The raw sonar value has a measured offset of 240 mm.
  navdata->altitude.raw_mm = navdata->altitude.vision_mm + 240;
  navdata->altitude.vz_mm_s = static_cast<float>(
      1000 * noisy(-state.velocity[2] * sensors_.altitude_factor, sensors_.velocity_noise_m_s));
  navdata->vision.theta_rad = static_cast<float>(pitch);
  navdata->vision.phi_rad = static_cast<float>(roll);
  navdata->vision.psi_rad = static_cast<float>(yaw);
  navdata->vision.altitude_mm = demo.altitude_mm;
  navdata->vision.capture_ms = static_cast<uint32_t>(uptime_ns(now_ns) / 1000000 % 2048000);
  navdata->pressure.temperature_dc = 435;
  navdata->pressure.pressure_pa = static_cast<int32_t>(101325 + 12.0 * state.position[2]);
  navdata->magneto.heading_fusion_deg = static_cast<float>(yaw * kDegrees);
  navdata->raw_measures.battery_mv = 11686;
  navdata->raw_measures.altitude_mm = navdata->altitude.raw_mm;
  navdata->wifi.link_quality = 100;
}

std::optional<std::vector<uint8_t>> Firmware::next_navdata(int64_t now_ns) {
  if (!hello_ || now_ns < next_navdata_ns_) return {};
  const bool is_demo = bootstrap_ || configuration_.at("general:navdata_demo") == "TRUE";
  const int64_t period_ns = is_demo ? kDemoPeriodNs : kFullPeriodNs;
  next_navdata_ns_ = std::max(next_navdata_ns_ + period_ns, now_ns - period_ns);
  ardrone_navdata navdata;
  std::memset(&navdata, 0, sizeof navdata);
  fill(now_ns, &navdata);
  std::vector<uint8_t> bytes(ARDRONE_NAVDATA_MAX_BYTES);
  size_t size = 0;
  if (ardrone_encode_navdata(&navdata, bytes.data(), bytes.size(), &size) != TVS_OK) return {};
  bytes.resize(size);
  if (!version_.empty()) add_unknown_options(bytes);
  ++sequence_;
  return bytes;
}

std::string Firmware::configuration_text() const {
  std::string text;
  for (const auto& [key, value] : configuration_) text += key + " = " + value + "\n";
  text += '\0';
  return text;
}

std::string Firmware::ids_text() const {
  std::string text;
  const auto section = [&](const char* name, const std::map<std::string, std::string>& ids) {
    text += std::string("[") + name + "]\r" + kDefaultId + ",default\r";
    for (const auto& [id, description] : ids) text += id + "," + description + "\r";
  };
  section("applis", applications_);
  section("profiles", users_);
  section("sessions", sessions_);
  text += '\0';
  return text;
}

std::optional<std::string> Firmware::take_control_text() {
  if (control_texts_.empty()) return {};
  std::string text = std::move(control_texts_.front());
  control_texts_.clear();
  return text;
}

}  // namespace simulator
