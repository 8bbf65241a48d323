// Child processes that never outlive their parent; one kind runs a program and reads its output,
// for work in which a driver may crash or hang.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// The end of a process: exit(status) or a signal.
struct ExitReason {
  pid_t pid = 0;
  int status = 0;  // valid if signal is 0
  int signal = 0;
  // A text such as "signal 9 (Killed)" or "exit status 3".
  std::string text() const;
};

// One child process. Thread-safe: one thread waits for it while others send signals. The child is
// reaped under the lock, so a signal never reaches a later process with the same pid.
class ChildProcess {
 public:
  // Runs `executable` with `arguments` (without argv[0]). The child gets SIGKILL when the *thread*
  // that called spawn ends (PR_SET_PDEATHSIG): call it from a thread that waits for the child.
  //
  // The child has a process group of its own, so a terminal's Ctrl-C reaches only the daemon. It
  // starts with no signal blocked and only descriptors 0, 1 and 2 open. Errors: internal. A
  // program that cannot be executed exits with status 127.
  Status spawn(const std::string& executable, const std::vector<std::string>& arguments);
  // Blocks until the child ends and reaps it.
  ExitReason wait();
  // Returns false if no child runs.
  bool send_signal(int signal);
  // Returns 0 if no child runs.
  pid_t pid() const;

 private:
  mutable Mutex mutex_;
  pid_t pid_ GUARDED_BY(mutex_) = 0;
};

// The stdout of a child, and how it ended.
struct ChildReply {
  std::string text;
  std::string failure;  // empty: it exited with status 0
};

// Runs `command`, a path and its arguments, as ChildProcess does. The child's stderr is discarded,
// because drivers complain there. A child that exceeds `timeout`, or writes more than 1 MiB, is
// killed.
ChildReply run_child(const std::vector<std::string>& command, std::chrono::milliseconds timeout);

// The text from the last line on that starts with a brace. Drivers may have printed other lines
// before it.
std::string_view last_json_line(std::string_view text);

}  // namespace voxeld
