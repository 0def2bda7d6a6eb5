#include "drone/options.h"

#include <CLI/App.hpp>
#include <cstdio>

namespace cli {

void add_address(CLI::App& verb, DroneAddress& address, const std::string& host) {
  address.host = host;
  verb.add_option("--host", address.host, "the drone's address")
      ->type_name("ADDRESS")
      ->capture_default_str();
  add_ports(verb, address);
}

void add_ports(CLI::App& verb, DroneAddress& address) {
  const auto port = [&](const char* name, int& value, const char* help) {
    verb.add_option(name, value, help)
        ->check(CLI::Range(0, 65535))
        ->type_name("PORT")
        ->capture_default_str();
  };
  port("--at-port", address.at_port, "commands, UDP");
  port("--navdata-port", address.navdata_port, "navdata, UDP");
  port("--video-port", address.video_port, "video, TCP");
  port("--control-port", address.control_port, "configuration, TCP");
}

CLI::Validator number_in(double low, double high) {
  return CLI::Validator(
      [low, high](std::string& text) {
        double value = 0;
        const bool is_number = CLI::detail::lexical_cast(text, value);
        if (is_number && value >= low && value <= high) return std::string();
        char words[120];
        std::snprintf(words, sizeof words, " is not a number from %g to %g", low, high);
        return text + words;
      },
      "");
}

void add_duration(CLI::App& verb, double& seconds) {
  verb.add_option("--duration", seconds, "end after so many seconds; 0: with Ctrl-C")
      ->check(number_in(0.0, 1e7))
      ->type_name("S")
      ->capture_default_str();
}

}  // namespace cli
