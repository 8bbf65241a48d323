// The screen of `voxel top`, as lines of text.
#pragma once

#include <chrono>
#include <cstdint>
#include <map>
#include <string>
#include <vector>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {

struct ScreenSize {
  int columns = 80, rows = 24;
};

// Remembers each job's last progress, to compute its rate.
class TopView {
 public:
  using Clock = std::chrono::steady_clock;

  explicit TopView(std::string url) : url_(std::move(url)) {}
  // Returns at most `size.rows` lines of at most `size.columns` characters; omitted rows are
  // counted. `now_ms`: Unix time; `at`: when the response arrived.
  std::vector<std::string> lines(const client::Queue& queue, ScreenSize size, int64_t now_ms,
                                 Clock::time_point at);

 private:
  struct Seen {
    std::string stage;
    int64_t done = 0;
    Clock::time_point at;
    double per_second = -1;  // negative: not known yet
  };
  void follow(const client::Queue& queue, Clock::time_point at);
  std::string progress_of(const client::JobInfo& job) const;
  void add_devices(const client::Queue& queue, int64_t now_ms,
                   std::vector<std::string>& lines) const;

  const std::string url_;
  std::map<std::string, Seen> seen_;  // by job
};

}  // namespace voxeld::cli
