#include "server/process/child_process.h"

#include <fcntl.h>
#include <linux/close_range.h>
#include <poll.h>
#include <signal.h>
#include <string.h>
#include <sys/prctl.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "server/base/check.h"
#include "server/base/clock.h"
#include "server/base/disk/file.h"

namespace voxeld {

namespace {

constexpr int kCannotExecute = 127;  // the status that shells use

// Runs in a process that shares the memory of one with threads, so only async-signal-safe calls are
// allowed. stdout_fd: its stdout, and its stderr is discarded, because drivers complain there; -1:
// it has those of the parent. failure: the parent's, set if the program cannot be executed.
[[noreturn]] void run_child(pid_t parent, char* const* argv, int stdout_fd, volatile int& failure) {
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
  if (stdout_fd >= 0) {
    ::dup2(stdout_fd, STDOUT_FILENO);
    ::fcntl(STDOUT_FILENO, F_SETFD, 0);  // stays open also if it is the same one
    ::dup2(::open("/dev/null", O_WRONLY), STDERR_FILENO);
  }
  ::close_range(3, ~0U, CLOSE_RANGE_CLOEXEC);
  ::execv(argv[0], argv);
  failure = errno;
  ::_exit(kCannotExecute);
}

// vfork, since fork copies the page tables, and makes the parent copy each page that it writes
// afterwards: a busy gateway starts 20 workers a second. The caller goes on when the child has
// called exec. Signals wait so long: a handler would run in the child, too.
pid_t start(char* const* argv, int stdout_fd, volatile int& failure) {
  const pid_t parent = ::getpid();
  sigset_t all, before;
  ::sigfillset(&all);
  ::pthread_sigmask(SIG_SETMASK, &all, &before);
  // The checker warns of calls other than exec: run_child makes async-signal-safe ones alone.
  const pid_t child = ::vfork();  // NOLINT(clang-analyzer-security.insecureAPI.vfork)
  if (child == 0) run_child(parent, argv, stdout_fd, failure);  // NOLINT(clang-analyzer-unix.Vfork)
  const int error = errno;
  ::pthread_sigmask(SIG_SETMASK, &before, nullptr);
  errno = error;
  return child;
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

  MutexLock lock(mutex_);
  VOXELD_CHECK(pid_ == 0, "one child at a time");
  volatile int cannot_execute = 0;  // the child's status tells it, too
  const pid_t child = start(argv.data(), -1, cannot_execute);
  if (child < 0) return errno_error("start", executable);
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

namespace {

// A limit, because drivers that write to stdout must not fill the memory.
constexpr size_t kReplyBytesMax = size_t{1} << 20;

int reap(pid_t pid) {
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  return status;
}

// Reads until the end of the pipe. Returns why it gave up before; empty: it did not.
std::string read_reply(int fd, std::chrono::milliseconds timeout, std::string& text) {
  const Stopwatch clock;
  char buffer[4096];
  while (text.size() < kReplyBytesMax) {
    const double left_ms = static_cast<double>(timeout.count()) - clock.ms();
    if (left_ms <= 0) {
      return "the driver did not reply within " + std::to_string(timeout.count()) + " ms";
    }
    pollfd waiting{fd, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(left_ms) + 1) <= 0) continue;
    const ssize_t bytes = ::read(fd, buffer, sizeof buffer);
    if (bytes == 0) return {};
    if (bytes > 0) text.append(buffer, static_cast<size_t>(bytes));
    if (bytes < 0 && errno != EINTR) return {};
  }
  return "the driver wrote more than " + std::to_string(kReplyBytesMax) + " bytes";
}

}  // namespace

ChildReply run_child(const std::vector<std::string>& command, std::chrono::milliseconds timeout) {
  ChildReply reply;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    reply.failure = std::string("pipe: ") + std::strerror(errno);
    return reply;
  }
  const UniqueFd read_end(ends[0]);
  UniqueFd write_end(ends[1]);
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& one : command) arguments.push_back(const_cast<char*>(one.c_str()));
  arguments.push_back(nullptr);
  volatile int cannot_execute = 0;
  const pid_t pid = start(arguments.data(), write_end.get(), cannot_execute);
  const int failure = pid < 0 ? errno : cannot_execute;
  write_end.reset();
  if (failure != 0) {
    if (pid > 0) reap(pid);
    reply.failure = "cannot run " + command[0] + ": " + std::strerror(failure);
    return reply;
  }
  reply.failure = read_reply(read_end.get(), timeout, reply.text);
  // One that goes on writing would block for ever, since nobody reads any more.
  if (!reply.failure.empty()) ::kill(pid, SIGKILL);
  const int status = reap(pid);
  if (!reply.failure.empty()) return reply;
  if (WIFSIGNALED(status)) {
    reply.failure = std::string("the driver crashed: ") + ::strsignal(WTERMSIG(status));
  } else if (WEXITSTATUS(status) != 0) {
    reply.failure = "the probe ended with status " + std::to_string(WEXITSTATUS(status));
  }
  return reply;
}

std::string_view last_json_line(std::string_view text) {
  const size_t start = text.rfind("\n{");
  return start == std::string_view::npos ? text : text.substr(start + 1);
}

}  // namespace voxeld
