#include "client/cli/terminal/interrupt.h"

#include <pthread.h>

#include <csignal>
#include <cstdlib>

#include "client/cli/exit_status.h"

namespace voxeld::cli {

namespace {

bool is_ignored(int signal) {
  struct sigaction action {};
  return ::sigaction(signal, nullptr, &action) == 0 && action.sa_handler == SIG_IGN;
}

}  // namespace

Interrupt::Interrupt() {
  sigset_t signals, ignored;
  sigemptyset(&signals);
  sigemptyset(&ignored);
  for (const int signal : {SIGINT, SIGTERM, SIGHUP}) {
    sigaddset(&signals, signal);
    if (is_ignored(signal)) sigaddset(&ignored, signal);
  }
  sigset_t blocked = signals;
  sigaddset(&blocked, SIGPIPE);
  pthread_sigmask(SIG_BLOCK, &blocked, nullptr);
  thread_ = std::jthread([this, signals, ignored](const std::stop_token& ends) {
    for (int signal = 0; sigwait(&signals, &signal) == 0 && !ends.stop_requested();) {
      if (sigismember(&ignored, signal) == 1) continue;  // Linux keeps a blocked one nevertheless
      const bool is_second = source_.stop_requested();
      source_.request_stop();
      if (is_second || ends_at_once_) std::_Exit(kInterrupted);
    }
  });
}

void Interrupt::end_at_once() {
  ends_at_once_ = true;
  if (source_.stop_requested()) std::_Exit(kInterrupted);
}

Interrupt::~Interrupt() {
  thread_.request_stop();
  // Wakes the thread, which waits for a signal; otherwise its join would never return.
  pthread_kill(thread_.native_handle(), SIGINT);
}

}  // namespace voxeld::cli
