#include "client/cli/commands/top.h"

#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <cstdio>

#include "client/cli/commands/top_view.h"
#include "client/cli/terminal/human.h"
#include "client/cli/terminal/terminal.h"

namespace voxeld::cli {
namespace {

using Clock = TopView::Clock;

constexpr auto kRefresh = std::chrono::seconds(1);
constexpr int kJobsShown = 200;
constexpr ScreenSize kPaper{200, 1000};  // screen size for --once

}  // namespace

void watch_queue(const Arguments& arguments, client::Client& daemon, const std::stop_token& stop) {
  TopView view(arguments.url);
  client::Queue queue = daemon.queue(kJobsShown, stop);
  auto received = Clock::now();
  if (arguments.json) {
    std::printf("%s\n", queue.json.c_str());
    return;
  }
  if (arguments.once || ::isatty(STDOUT_FILENO) == 0) {
    for (const std::string& line : view.lines(queue, kPaper, unix_now_ms(), received)) {
      std::printf("%s\n", line.c_str());
    }
    return;
  }
  const Terminal terminal;
  std::string trouble;
  auto next = Clock::now() + kRefresh;
  while (!stop.stop_requested()) {
    auto lines = view.lines(queue, Terminal::size(), unix_now_ms(), received);
    if (!trouble.empty()) lines.front() = "voxel top  " + trouble;
    lines.front().resize(
        std::min(lines.front().size(), static_cast<size_t>(Terminal::size().columns)));
    terminal.show(lines);
    if (const char key = Terminal::wait(next, stop); key == 'q' || key == 'Q') return;
    if (Clock::now() < next) continue;  // woken by another key or a new size
    next = Clock::now() + kRefresh;
    try {
      queue = daemon.queue(kJobsShown, stop);
      received = Clock::now();
      trouble.clear();
    } catch (const client::Error& error) {
      trouble = printable(error.what());
    }
  }
}

}  // namespace voxeld::cli
