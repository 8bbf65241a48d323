// `voxeld doctor`: what this machine can run voxeld on, and why the rest does not work.
#pragma once

#include <string>

namespace voxeld {

// Probes every device in a child process (`self_executable` probe-device …) and prints a table to
// stdout, or with `json` one object. Exit status: 0.
int doctor_main(const std::string& self_executable, bool json);

}  // namespace voxeld
