// Shows full-screen text in a terminal, and restores the terminal afterwards.
#pragma once

#include <termios.h>

#include <chrono>
#include <stop_token>
#include <string>
#include <vector>

#include "client/cli/commands/top_view.h"

namespace voxeld::cli {

// During its lifetime, stdin delivers keys at once and without echo, and stdout shows the alternate
// screen. The destructor restores both.
class Terminal {
 public:
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  static ScreenSize size();
  void show(const std::vector<std::string>& lines) const;
  // Waits until `deadline`, a key, a new window size, or a stop. Returns the key, or 0.
  static char wait(std::chrono::steady_clock::time_point deadline, const std::stop_token& stop);

 private:
  termios before_{};
  bool has_keys_ = false;  // stdin is a terminal
};

}  // namespace voxeld::cli
