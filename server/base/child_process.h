// Child processes that never outlive their parent.
#pragma once

#include <sys/types.h>

#include <chrono>
#include <optional>
#include <string>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

// How a process ended: by exit(status), or by a signal.
struct ExitReason {
  pid_t pid = 0;
  int status = 0;  // exit status when signal is 0
  int signal = 0;
  // "signal 9 (Killed)", "exit status 3"
  std::string text() const;
};

// One child. Thread-safe: one thread waits for it while others send it signals; a signal never goes
// to a later process that got the same number, because the child is reaped under the lock.
class ChildProcess {
 public:
  // Runs `executable` with `arguments` (without argv[0]). The child gets SIGKILL when the *thread*
  // that called spawn ends (PR_SET_PDEATHSIG): call it from a thread that waits for the child. It
  // starts in a process group of its own, so that a terminal's Ctrl-C reaches the daemon alone,
  // with no signal blocked and no descriptor open but 0, 1, 2. Errors: internal (fork; a program
  // that cannot be executed exits with status 127).
  Status spawn(const std::string& executable, const std::vector<std::string>& arguments);
  // Blocks until the child ends and reaps it.
  ExitReason wait();
  // False when no child runs.
  bool send_signal(int signal);
  // 0 when no child runs.
  pid_t pid() const;

 private:
  mutable Mutex mutex_;
  pid_t pid_ GUARDED_BY(mutex_) = 0;
};

}  // namespace voxeld
