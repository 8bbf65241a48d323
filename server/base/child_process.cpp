#include "server/base/child_process.h"

#include <fcntl.h>
#include <linux/close_range.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>

#include "server/base/check.h"
#include "server/base/file.h"

namespace voxeld {
namespace {

constexpr int kCannotExecute = 127;  // the status that shells use

// Runs between fork and exec in a process with threads, so only async-signal-safe calls are
// allowed.
[[noreturn]] void run_child(pid_t parent, const char* executable, char* const* arguments) {
  ::prctl(PR_SET_PDEATHSIG, SIGKILL);
  if (::getppid() != parent) ::_exit(kCannotExecute);  // the parent died before prctl
  ::setpgid(0, 0);
  struct sigaction by_default {};
  by_default.sa_handler = SIG_DFL;
  for (const int signal : {SIGTERM, SIGINT, SIGPIPE, SIGHUP, SIGCHLD}) {
    ::sigaction(signal, &by_default, nullptr);
  }
  sigset_t none;
  ::sigemptyset(&none);
  ::sigprocmask(SIG_SETMASK, &none, nullptr);
  ::close_range(3, ~0U, CLOSE_RANGE_CLOEXEC);
  ::execv(executable, arguments);
  ::_exit(kCannotExecute);
}

}  // namespace

std::string ExitReason::text() const {
  if (signal == 0) return "exit status " + std::to_string(status);
  const char* name = ::sigdescr_np(signal);
  return "signal " + std::to_string(signal) +
         (name == nullptr ? std::string() : " (" + std::string(name) + ")");
}

Status ChildProcess::spawn(const std::string& executable,
                           const std::vector<std::string>& arguments) {
  std::vector<char*> argv;
  argv.push_back(const_cast<char*>(executable.c_str()));
  for (const std::string& argument : arguments) argv.push_back(const_cast<char*>(argument.c_str()));
  argv.push_back(nullptr);
  const pid_t parent = ::getpid();

  MutexLock lock(mutex_);
  VOXELD_CHECK(pid_ == 0, "one child at a time");
  const pid_t child = ::fork();
  if (child < 0) return errno_error("start", executable);
  if (child == 0) run_child(parent, executable.c_str(), argv.data());
  pid_ = child;
  return {};
}

ExitReason ChildProcess::wait() {
  const pid_t child = pid();
  VOXELD_CHECK(child != 0, "wait without a child");
  siginfo_t info{};
  // WNOWAIT leaves the pid taken until the lock is held, so send_signal cannot hit a later process.
  while (::waitid(P_PID, static_cast<id_t>(child), &info, WEXITED | WNOWAIT) != 0 &&
         errno == EINTR) {
  }
  MutexLock lock(mutex_);
  int status = 0;
  while (::waitpid(child, &status, 0) < 0 && errno == EINTR) {
  }
  pid_ = 0;
  ExitReason reason;
  reason.pid = child;
  if (WIFSIGNALED(status)) {
    reason.signal = WTERMSIG(status);
  } else {
    reason.status = WEXITSTATUS(status);
  }
  return reason;
}

bool ChildProcess::send_signal(int signal) {
  MutexLock lock(mutex_);
  return pid_ != 0 && ::kill(pid_, signal) == 0;
}

pid_t ChildProcess::pid() const {
  MutexLock lock(mutex_);
  return pid_;
}

}  // namespace voxeld
