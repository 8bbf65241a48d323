// `voxeld doctor`: what this machine can run voxeld on, and why the rest does not work.
#pragma once

#include <string>

#include "server/config.h"

namespace voxeld {

// Probes every device in a child process (`self_executable` probe-device …) and prints a table to
// stdout, or one object of JSON. With `calibrate`, measures the devices that work, or those that
// are named, as well, and stores that in the data directory. Exit status: 0; 1 when a device that
// was to be measured could not be; 64 for a device's name that is none.
int doctor_main(const std::string& self_executable, const DoctorCommand& command);

// `voxeld doctor --store`: whether the data directory holds what its database names, byte for byte.
// Also while a daemon runs on it. Exit status: 0; 1 when something is damaged or missing.
int doctor_store_main(const DoctorCommand& command);

// `voxeld doctor --rebuild`: makes what the data directory holds known to its database. No daemon
// may run on it. Exit status: 0; 1 when that failed.
int doctor_rebuild_main(const DoctorCommand& command);

}  // namespace voxeld
