// Ctrl-C, SIGTERM and the end of the terminal as a stop token.
#pragma once

#include <atomic>
#include <stop_token>
#include <thread>

namespace voxeld::cli {

// Requests a stop at the first SIGINT, SIGTERM or SIGHUP after construction; a second one ends the
// process at once. A signal that is ignored at construction has no effect: SIGHUP below nohup, or
// SIGINT of a script's background command. A reader of stdout that ends is an error of the write,
// not a SIGPIPE, which would leave temporary files. Construct it before any other thread starts,
// because threads inherit its signal mask.
class Interrupt {
 public:
  Interrupt();
  ~Interrupt();
  Interrupt(const Interrupt&) = delete;
  Interrupt& operator=(const Interrupt&) = delete;
  std::stop_token token() const { return source_.get_token(); }
  // From now on the first signal ends the process, too: there is nothing to cancel or to remove.
  void end_at_once();

 private:
  std::stop_source source_;
  std::atomic<bool> ends_at_once_ = false;
  std::jthread thread_;
};

}  // namespace voxeld::cli
