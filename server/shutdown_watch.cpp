#include "server/shutdown_watch.h"

#include <poll.h>
#include <pthread.h>
#include <signal.h>
#include <sys/eventfd.h>
#include <sys/signalfd.h>
#include <sys/time.h>
#include <unistd.h>

#include <algorithm>
#include <array>

#include "server/base/log.h"

namespace voxeld {
namespace {

using Clock = std::chrono::steady_clock;

sigset_t ending_signals() {
  sigset_t set;
  ::sigemptyset(&set);
  ::sigaddset(&set, SIGTERM);
  ::sigaddset(&set, SIGINT);
  return set;
}

UniqueFd open_signals() {
  const sigset_t set = ending_signals();
  ::pthread_sigmask(SIG_BLOCK, &set, nullptr);
  return UniqueFd(::signalfd(-1, &set, SFD_CLOEXEC));
}

// As the signal ends any process. The first one of a container is not ended by its own signals: by
// the status that shells give for that.
void end_at_once(int signal) {
  ::raise(signal);
  ::_exit(128 + signal);
}

// For the calling thread, which gets it. Workers end with the process.
void let_next_signal_kill() {
  struct sigaction action {};
  action.sa_handler = end_at_once;
  action.sa_flags = static_cast<int>(SA_RESETHAND | SA_NODEFER);
  ::sigaction(SIGTERM, &action, nullptr);
  ::sigaction(SIGINT, &action, nullptr);
  const sigset_t set = ending_signals();
  ::pthread_sigmask(SIG_UNBLOCK, &set, nullptr);
}

Clock::time_point from_now(double seconds) {
  return Clock::now() +
         std::chrono::duration_cast<Clock::duration>(std::chrono::duration<double>(seconds));
}

}  // namespace

ShutdownWatch::ShutdownWatch(double drain_seconds)
    : drain_seconds_(drain_seconds),
      signals_(open_signals()),
      end_(::eventfd(0, EFD_CLOEXEC | EFD_NONBLOCK)) {
  thread_ = std::thread([this] { run(); });
}

ShutdownWatch::~ShutdownWatch() {
  const uint64_t one = 1;
  [[maybe_unused]] const ssize_t written = ::write(end_.get(), &one, sizeof one);
  thread_.join();
}

int ShutdownWatch::wait(double seconds) {
  const auto deadline = from_now(seconds);
  MutexLock lock(mutex_);
  while (signal_ == 0) {
    if (changed_.wait_until(lock, deadline) == std::cv_status::timeout) break;
  }
  return signal_;
}

void ShutdownWatch::enter(const char* stage) {
  const MutexLock lock(mutex_);
  stage_ = stage;
}

void ShutdownWatch::run() {
  std::array<pollfd, 2> entries{{{signals_.get(), POLLIN, 0}, {end_.get(), POLLIN, 0}}};
  while (entries[0].revents == 0) {
    if (::poll(entries.data(), entries.size(), -1) > 0 && entries[1].revents != 0) return;
  }
  signalfd_siginfo info{};
  if (::read(signals_.get(), &info, sizeof info) != sizeof info) return;
  let_next_signal_kill();
  {
    const MutexLock lock(mutex_);
    signal_ = static_cast<int>(info.ssi_signo);
    changed_.notify_all();
  }
  if (!is_over_within(drain_seconds_ + kCloseSecondsMax)) end_process();
}

bool ShutdownWatch::is_over_within(double seconds) {
  const auto deadline = from_now(seconds);
  while (true) {
    const auto left = std::chrono::ceil<std::chrono::milliseconds>(deadline - Clock::now()).count();
    if (left <= 0) return false;
    pollfd entry{end_.get(), POLLIN, 0};
    const int wait_ms = static_cast<int>(std::min<int64_t>(left, 60'000));
    if (::poll(&entry, 1, wait_ms) > 0) return true;
  }
}

void ShutdownWatch::end_process() {
  itimerval timer{};
  timer.it_value.tv_usec = static_cast<suseconds_t>(kLastWordsSecondsMax * 1e6);
  ::setitimer(ITIMER_REAL, &timer, nullptr);  // SIGALRM ends the process
  const char* stage = nullptr;
  {
    const MutexLock lock(mutex_);
    stage = stage_;
  }
  log::error("the end takes too long: the process exits now; what was acknowledged is stored",
             {{"stage", stage}, {"seconds", drain_seconds_ + kCloseSecondsMax}});
  ::_exit(0);
}

}  // namespace voxeld
