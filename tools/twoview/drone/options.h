// The options that the verbs of a drone share.
#pragma once

#include <string>

#include "base/cli_fwd.h"

namespace cli {

// The address of a drone: the options --host and a port for each channel.
struct DroneAddress {
  std::string host;
  int at_port = 5556, navdata_port = 5554, video_port = 5555, control_port = 5559;
};
void add_address(CLI::App& verb, DroneAddress& address, const std::string& host);
// Adds the ports alone, for a verb that has another option for the host.
void add_ports(CLI::App& verb, DroneAddress& address);

// A range check like CLI::Range that also refuses "nan".
CLI::Validator number_in(double low, double high);

// Adds --duration: the verb ends by itself after this number of seconds; 0 means no limit.
void add_duration(CLI::App& verb, double& seconds);

}  // namespace cli
