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
  // starts with no signal blocked and only descriptors 0, 1 and 2 open. Errors: internal (fork). A
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

}  // namespace voxeld
