#include "client/cli/terminal/terminal.h"

#include <poll.h>
#include <sys/ioctl.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>

namespace voxeld::cli {
namespace {

using namespace std::chrono_literals;

// The longest delay until a stop, or a new window size, is noticed.
constexpr auto kSlice = 50ms;

void write_out(const std::string& text) {
  std::fwrite(text.data(), 1, text.size(), stdout);
  std::fflush(stdout);
}

}  // namespace

Terminal::Terminal() {
  has_keys_ = ::tcgetattr(STDIN_FILENO, &before_) == 0;
  if (has_keys_) {
    termios keys = before_;
    keys.c_lflag &= ~static_cast<tcflag_t>(ICANON | ECHO);
    keys.c_cc[VMIN] = 1;
    keys.c_cc[VTIME] = 0;
    ::tcsetattr(STDIN_FILENO, TCSANOW, &keys);
  }
  write_out("\x1b[?1049h\x1b[?25l");  // alternate screen, no cursor
}

Terminal::~Terminal() {
  write_out("\x1b[?25h\x1b[?1049l");
  if (has_keys_) ::tcsetattr(STDIN_FILENO, TCSANOW, &before_);
}

ScreenSize Terminal::size() {
  winsize window{};
  if (::ioctl(STDOUT_FILENO, TIOCGWINSZ, &window) != 0 || window.ws_col == 0 ||
      window.ws_row == 0) {
    return {};
  }
  return {window.ws_col, window.ws_row};
}

void Terminal::show(const std::vector<std::string>& lines) const {
  std::string text = "\x1b[H";
  for (size_t i = 0; i < lines.size(); ++i) {
    text += (i == 0 ? "" : "\n") + lines[i] + "\x1b[K";
  }
  write_out(text + "\x1b[J");
}

char Terminal::wait(std::chrono::steady_clock::time_point deadline, const std::stop_token& stop) {
  const ScreenSize before = size();
  while (!stop.stop_requested() && std::chrono::steady_clock::now() < deadline) {
    pollfd keys{STDIN_FILENO, POLLIN, 0};
    const int ready = ::poll(&keys, 1, static_cast<int>(std::chrono::milliseconds(kSlice).count()));
    if (ready > 0) {
      char key = 0;
      if (::read(STDIN_FILENO, &key, 1) != 1) return 'q';  // the terminal is gone
      return key;
    }
    const ScreenSize now = size();
    if (now.columns != before.columns || now.rows != before.rows) return 0;
  }
  return 0;
}

}  // namespace voxeld::cli
