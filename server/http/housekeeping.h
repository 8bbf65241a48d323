// The thread that accepts connections and runs what happens at a time.
#pragma once

#include <chrono>
#include <functional>
#include <thread>

#include "server/base/disk/file.h"
#include "server/http/sockets/listener.h"
#include "server/http/sockets/poller.h"

namespace voxeld::http {

// How often Calls::tick runs.
inline constexpr auto kHousekeepingStep = std::chrono::milliseconds(200);

// Thread-safe.
class Housekeeping {
 public:
  // All are called on the one thread.
  struct Calls {
    // Whether another connection has a place; may close an older one for it.
    std::function<bool()> has_place;
    // Closes an older connection. False: none can be closed.
    std::function<bool()> make_room;
    std::function<void(Accepted)> admit;
    // Runs timers that are due; the time until the next one, at most kHousekeepingStep.
    std::function<std::chrono::milliseconds()> run_timers;
    std::function<void()> tick;
  };
  Housekeeping(UniqueFd listener, Calls calls);
  ~Housekeeping() { end(); }
  Housekeeping(const Housekeeping&) = delete;
  Housekeeping& operator=(const Housekeeping&) = delete;

  // The next timer is an earlier one now.
  void timer_set() const { timer_set_.signal(); }
  // Ends the thread, waits for it and closes the listener.
  void end();

 private:
  void loop();
  void accept_some();

  UniqueFd listener_;
  const Calls calls_;
  const EventFd timer_set_, end_;
  std::thread thread_;
};

}  // namespace voxeld::http
