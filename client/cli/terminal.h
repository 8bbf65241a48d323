// A terminal that shows one screen until it is given back.
#pragma once

#include <termios.h>

#include <chrono>
#include <stop_token>
#include <string>
#include <vector>

#include "client/cli/top_view.h"

namespace voxeld::cli {

// From construction to destruction stdin gives keys at once and unseen, and stdout shows the
// alternate screen; then all is as it was before.
class Terminal {
 public:
  Terminal();
  ~Terminal();
  Terminal(const Terminal&) = delete;
  Terminal& operator=(const Terminal&) = delete;

  static ScreenSize size();
  void show(const std::vector<std::string>& lines) const;
  // Until `deadline`, a key, a new size of the window, or a stop. Returns the key, or 0.
  static char wait(std::chrono::steady_clock::time_point deadline, const std::stop_token& stop);

 private:
  termios before_{};
  bool has_keys_ = false;  // stdin is a terminal
};

}  // namespace voxeld::cli
