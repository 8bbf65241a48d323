#include "client/cli/terminal/interrupt.h"

#include <pthread.h>

#include <csignal>
#include <cstdlib>

#include "client/cli/exit_status.h"

namespace voxeld::cli {

Interrupt::Interrupt() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  thread_ = std::jthread([this, signals](const std::stop_token& ends) {
    for (int signal = 0; sigwait(&signals, &signal) == 0 && !ends.stop_requested();) {
      if (source_.stop_requested()) std::_Exit(kInterrupted);
      source_.request_stop();
    }
  });
}

Interrupt::~Interrupt() {
  thread_.request_stop();
  // Wakes the thread, which waits for a signal; otherwise its join would never return.
  pthread_kill(thread_.native_handle(), SIGINT);
}

}  // namespace voxeld::cli
