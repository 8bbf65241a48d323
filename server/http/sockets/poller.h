// Waits, on any number of threads, for events of sockets and for work that has no socket.
#pragma once

#include <cstdint>

#include "server/base/disk/file.h"

namespace voxeld::http {

// An eventfd: readable once signal() was called.
class EventFd {
 public:
  // `flags`: those of eventfd(2) beside EFD_CLOEXEC and EFD_NONBLOCK.
  explicit EventFd(int flags = 0);
  int fd() const { return fd_.get(); }
  void signal() const;
  // Takes the signals so far (one of them with EFD_SEMAPHORE). False: there was none.
  bool take() const;

 private:
  UniqueFd fd_;
};

// Thread-safe. Each socket reports one event (EPOLLONESHOT) and then nothing until it is armed
// again, so that one thread at a time has it.
class Poller {
 public:
  static constexpr int kEnded = -1, kReady = -2;

  Poller();
  void add(int socket, uint32_t events) const;
  void arm(int socket, uint32_t events) const;
  // Makes one wait() return kReady.
  void signal_ready() const { ready_.signal(); }
  // From now on wait() returns kEnded at once.
  void end() const { end_.signal(); }
  // Blocks until there is an event: its socket, kReady or kEnded.
  int wait() const;

 private:
  void control(int operation, int fd, uint32_t events) const;

  const UniqueFd epoll_;
  const EventFd ready_, end_;
};

}  // namespace voxeld::http
