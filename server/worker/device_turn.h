// The worker's side of turns on its device (proto/task_api.h).
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "proto/task_api.h"
#include "server/base/frame_socket.h"

namespace voxeld {

// The connection to the gateway for turns. Used by the thread that runs tasks.
class TurnClient {
 public:
  // `gateway` is "unix:/path". Errors: those of connect_gateway().
  static Result<std::unique_ptr<TurnClient>> connect(const std::string& gateway);
  Status hello(const TurnsHello& hello);
  // Blocks while it is not granted. Errors: gone.
  Result<TurnReply> ask(const TurnRequest& request);
  // Does not wait.
  Status give(const TurnRequest& request);
  // For a signal handler: shutdown(2) on it makes every call end.
  int fd() const { return socket_.fd(); }

 private:
  explicit TurnClient(UniqueFd fd) : socket_(std::move(fd), kTaskFrameBytesMax) {}
  FrameSocket socket_;
};

// A task's turn. Without a client, for those who have the device to themselves, it is always the
// task's. Used by the thread that runs the task.
class DeviceTurn {
 public:
  // A turn is held so long before the next boundary gives others theirs: asking takes about 0.1 ms.
  static constexpr std::chrono::milliseconds kQuantum{50};

  DeviceTurn(TurnClient* client, const Task& task);
  ~DeviceTurn() { end(); }
  DeviceTurn(const DeviceTurn&) = delete;
  DeviceTurn& operator=(const DeviceTurn&) = delete;

  // What the task needs in all, with what the process has already; before its first turn.
  void expect(int64_t host_bytes, int64_t device_bytes);
  // Waits for the turn; the scopes of one task do not nest. Errors: cancelled, also where another
  // worker owns the task by now; grid-too-large where memory never suffices; internal where the
  // gateway is gone.
  Status begin();
  void end();
  // Between two tiles: where the turn is held long enough, others have theirs first. False: stop,
  // the result is not wanted.
  bool boundary();

  // From a begin() that went well to the end of a scope.
  class Scope {
   public:
    explicit Scope(DeviceTurn& turn) : turn_(turn) {}
    ~Scope() { turn_.end(); }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    DeviceTurn& turn_;
  };

 private:
  using Clock = std::chrono::steady_clock;
  Status ask(TurnAction action);

  TurnClient* const client_;
  TurnRequest request_;
  bool is_held_ = false;
  Clock::time_point since_{};
};

}  // namespace voxeld
