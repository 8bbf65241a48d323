#include "client/cli/interrupt.h"

#include <pthread.h>

#include <csignal>
#include <ctime>

#include "client/cli/exit_status.h"

namespace voxeld::cli {

Interrupt::Interrupt() {
  sigset_t signals;
  sigemptyset(&signals);
  sigaddset(&signals, SIGINT);
  sigaddset(&signals, SIGTERM);
  pthread_sigmask(SIG_BLOCK, &signals, nullptr);
  thread_ = std::jthread([this, signals](const std::stop_token& ends) {
    while (!ends.stop_requested()) {
      const timespec pause = {0, 50'000'000};
      if (sigtimedwait(&signals, nullptr, &pause) < 0) continue;
      if (source_.stop_requested()) std::_Exit(kInterrupted);
      source_.request_stop();
    }
  });
}

}  // namespace voxeld::cli
