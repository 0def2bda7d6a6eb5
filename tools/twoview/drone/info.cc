// twoview drone info: prints the drone's state and configuration.

#include <CLI/App.hpp>
#include <memory>
#include <nlohmann/json.hpp>
#include <optional>

#include "base/error.h"
#include "base/output.h"
#include "drone/drone.h"
#include "drone/link.h"
#include "drone/vehicle.h"

namespace cli {
namespace {

constexpr double kPatienceS = 10;  // seconds without an answer after which the verb gives up

struct Arguments {
  DroneAddress address;
  double duration = kPatienceS;
  bool json = false;
  VehicleAddress vehicle;
};

const char* state_word(uint32_t ctrl_state) {
  constexpr const char* kWords[] = {"default", "starting",   "landed", "flying",  "hovering",
                                    "testing", "taking off", "flying", "landing", "looping"};
  const uint32_t major = ctrl_state >> 16;
  return major < sizeof kWords / sizeof kWords[0] ? kWords[major] : "unknown";
}

// The configuration by name, in the order in which the drone sent it.
nlohmann::ordered_json configuration_json(const ardrone_session* session) {
  nlohmann::ordered_json json = nlohmann::ordered_json::object();
  const char* text = nullptr;
  size_t size = 0, offset = 0;
  if (ardrone_session_text(session, &text, &size) != TVS_OK) return json;
  ardrone_span key, value;
  while (ardrone_config_next(text, size, &offset, &key, &value) == TVS_OK) {
    json[std::string(key.text, key.size)] = std::string(value.text, value.size);
  }
  return json;
}

std::string printable(const nlohmann::ordered_json& configuration, const char* key) {
  if (!configuration.contains(key)) return "unknown";
  std::string text = configuration[key].get<std::string>();
  for (char& c : text) {
    if (c < ' ' || c > '~') c = '?';
  }
  return text;
}

int info(const Arguments& a) {
  if (a.vehicle.given()) return info_vehicle(a.vehicle, a.duration, a.json);
  ardrone_session_options options;
  ardrone_session_options_init(&options);
  options.video = 0;
  options.full_navdata = 0;
  bool has_config = false, has_failed = false;
  LinkListener listener;
  listener.on_event = [&](ardrone_event event, const std::string&) {
    if (event == ARDRONE_EVENT_CONFIG) has_config = true;
    if (event == ARDRONE_EVENT_READ_FAILED) has_failed = true;
  };
  Link link(a.address, options, listener);
  bool has_asked = false;
  std::optional<ardrone_navdata> navdata;
  link.run(
      [&] {
        if (const ardrone_navdata* latest = ardrone_session_navdata(link.session()))
          if (ARDRONE_HAS(latest, ARDRONE_TAG_DEMO)) navdata = *latest;
        if (!has_asked && ardrone_session_is_up(link.session()))
          has_asked = ardrone_session_read_config(link.session()) == TVS_OK;
        return (has_config || has_failed) && navdata;
      },
      stop_flag_for_signals(), a.duration);
  if (!navdata) {
    throw BadInput("no AR.Drone answers at " + a.address.host + " (UDP " +
                   std::to_string(a.address.navdata_port) + ") within " +
                   std::to_string(static_cast<int>(a.duration)) + " s");
  }
  const nlohmann::ordered_json configuration =
      has_config ? configuration_json(link.session()) : nlohmann::ordered_json::object();
  if (a.json) {
    nlohmann::ordered_json json;
    json["state"] = state_word(navdata->demo.ctrl_state);
    json["battery_percent"] = navdata->demo.battery_percent;
    json["emergency"] = (navdata->state & ARDRONE_STATE_EMERGENCY) != 0;
    json["firmware"] = printable(configuration, "general:num_version_soft");
    json["configuration"] = configuration;
    print(json.dump(2, ' ', false, nlohmann::json::error_handler_t::replace) + "\n");
    return 0;
  }
  const bool is_emergency = (navdata->state & ARDRONE_STATE_EMERGENCY) != 0;
  print("drone        " + printable(configuration, "general:ardrone_name") + " at " +
        a.address.host + "\nfirmware     " + printable(configuration, "general:num_version_soft") +
        "\nstate        " + state_word(navdata->demo.ctrl_state) +
        (is_emergency ? ", EMERGENCY" : "") + "\nbattery      " +
        std::to_string(navdata->demo.battery_percent) + " %\n");
  if (!has_config) print("configuration not read: the drone did not send it\n");
  for (const auto& [key, value] : configuration.items())
    print("  " + key + " = " + printable(configuration, key.c_str()) + "\n");
  return 0;
}

}  // namespace

void add_drone_info(CLI::App& drone, Run& run) {
  auto a = std::make_shared<Arguments>();
  CLI::App* verb = drone.add_subcommand("info", "state, battery, firmware and configuration");
  add_address(*verb, a->address, ARDRONE_DEFAULT_HOST);
  add_vehicle(*verb, a->vehicle, false);
  verb->add_option("--duration", a->duration, "wait so long for an answer")
      ->check(number_in(0.1, 3600.0))
      ->type_name("S")
      ->capture_default_str();
  verb->add_flag("--json", a->json, "print the result alone, as JSON");
  verb->final_callback([a, &run] { run = [a] { return info(*a); }; });
}

}  // namespace cli
