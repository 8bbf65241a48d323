#include "server/base/child_answer.h"

#include <fcntl.h>
#include <poll.h>
#include <signal.h>
#include <spawn.h>
#include <sys/wait.h>
#include <unistd.h>

#include <cerrno>
#include <cstring>

#include "server/base/clock.h"
#include "server/base/file.h"

extern char** environ;

namespace voxeld {
namespace {

// A limit, because drivers that write to stdout must not fill the memory.
constexpr size_t kAnswerBytesMax = size_t{1} << 20;

// Starts `program arguments...` with stdout on a pipe and stderr discarded, because drivers
// complain there. Returns the pid, or -1 with errno.
pid_t start_child(const std::vector<std::string>& command, int stdout_fd) {
  std::vector<char*> arguments;
  arguments.reserve(command.size() + 1);
  for (const std::string& one : command) arguments.push_back(const_cast<char*>(one.c_str()));
  arguments.push_back(nullptr);
  posix_spawn_file_actions_t actions;
  ::posix_spawn_file_actions_init(&actions);
  ::posix_spawn_file_actions_adddup2(&actions, stdout_fd, STDOUT_FILENO);
  ::posix_spawn_file_actions_addopen(&actions, STDERR_FILENO, "/dev/null", O_WRONLY, 0);
  pid_t pid = -1;
  const int failed =
      ::posix_spawn(&pid, arguments[0], &actions, nullptr, arguments.data(), environ);
  ::posix_spawn_file_actions_destroy(&actions);
  if (failed == 0) return pid;
  errno = failed;
  return -1;
}

// Reads until the end of the pipe. Returns false on timeout.
bool read_answer(int fd, std::chrono::milliseconds timeout, std::string& text) {
  const Stopwatch clock;
  char buffer[4096];
  while (text.size() < kAnswerBytesMax) {
    const double left_ms = static_cast<double>(timeout.count()) - clock.ms();
    if (left_ms <= 0) return false;
    pollfd waiting{fd, POLLIN, 0};
    if (::poll(&waiting, 1, static_cast<int>(left_ms) + 1) <= 0) continue;
    const ssize_t bytes = ::read(fd, buffer, sizeof buffer);
    if (bytes == 0) return true;
    if (bytes > 0) text.append(buffer, static_cast<size_t>(bytes));
    if (bytes < 0 && errno != EINTR) return true;
  }
  return true;
}

}  // namespace

ChildAnswer run_child(const std::vector<std::string>& command, std::chrono::milliseconds timeout) {
  ChildAnswer answer;
  int ends[2];
  if (::pipe2(ends, O_CLOEXEC) != 0) {
    answer.failure = std::string("pipe: ") + std::strerror(errno);
    return answer;
  }
  const UniqueFd read_end(ends[0]);
  UniqueFd write_end(ends[1]);
  const pid_t pid = start_child(command, write_end.get());
  write_end.reset();
  if (pid < 0) {
    answer.failure = "cannot run " + command[0] + ": " + std::strerror(errno);
    return answer;
  }
  const bool in_time = read_answer(read_end.get(), timeout, answer.text);
  if (!in_time) ::kill(pid, SIGKILL);
  int status = 0;
  while (::waitpid(pid, &status, 0) < 0 && errno == EINTR) {
  }
  if (!in_time) {
    answer.failure = "the driver did not answer within " + std::to_string(timeout.count()) + " ms";
  } else if (WIFSIGNALED(status)) {
    answer.failure = std::string("the driver crashed: ") + ::strsignal(WTERMSIG(status));
  } else if (WEXITSTATUS(status) != 0) {
    answer.failure = "the probe ended with status " + std::to_string(WEXITSTATUS(status));
  }
  return answer;
}

std::string_view last_json_line(std::string_view text) {
  const size_t start = text.rfind("\n{");
  return start == std::string_view::npos ? text : text.substr(start + 1);
}

}  // namespace voxeld
