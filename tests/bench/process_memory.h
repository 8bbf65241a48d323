// Peak memory of this process, from Linux's /proc.
#pragma once

#include <fstream>
#include <string>

namespace voxeld::bench {

// Forgets the peak so far. Does nothing where the kernel does not allow it.
inline void reset_peak_memory() {
  std::ofstream("/proc/self/clear_refs") << "5";
}

// Resident megabytes at the peak since the process began or the last reset; 0 if unknown.
inline double peak_memory_mb() {
  std::ifstream status("/proc/self/status");
  for (std::string line; std::getline(status, line);) {
    if (line.starts_with("VmHWM:")) return std::stod(line.substr(6)) / 1024.0;
  }
  return 0;
}

}  // namespace voxeld::bench
