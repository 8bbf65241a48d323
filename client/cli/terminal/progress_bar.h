// A progress line on stderr; nothing if stderr is not a terminal.
#pragma once

#include <chrono>
#include <string>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {

class ProgressBar {
 public:
  explicit ProgressBar(bool quiet);
  ~ProgressBar();  // clears the line
  ProgressBar(const ProgressBar&) = delete;
  ProgressBar& operator=(const ProgressBar&) = delete;

  // Draws at most 20 times a second.
  void show(const client::Progress& progress);
  void clear();

 private:
  bool is_on_;
  bool is_drawn_ = false;
  std::string stage_;
  std::chrono::steady_clock::time_point last_;
};

}  // namespace voxeld::cli
