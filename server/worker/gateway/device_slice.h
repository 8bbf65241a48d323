// The worker's side of time slices on its device (proto/messages/task_api.h).
#pragma once

#include <chrono>
#include <memory>
#include <string>

#include "proto/messages/task_api.h"
#include "server/process/frame_socket.h"

namespace voxeld {

// The connection to the gateway for time slices. Used by the thread that runs tasks.
class SliceClient {
 public:
  // `gateway` is "unix:/path". Errors: those of connect_gateway().
  static Result<std::unique_ptr<SliceClient>> connect(const std::string& gateway);
  Status hello(const SlicesHello& hello);
  // Blocks until it is granted. Errors: gone.
  Result<SliceReply> ask(const SliceRequest& request);
  // Does not wait for a reply.
  Status give(const SliceRequest& request);
  // For a signal handler: shutdown(2) on it ends every call.
  int fd() const { return socket_.fd(); }

 private:
  explicit SliceClient(UniqueFd fd) : socket_(std::move(fd), kTaskFrameBytesMax) {}
  FrameSocket socket_;
};

// A task's time slice. Without a client the worker has the device to itself, and the slice is
// always the task's. Used by the thread that runs the task.
class DeviceSlice {
 public:
  // The shortest time that a slice is held before the next boundary gives others theirs. Asking
  // takes about 0.1 ms, so this keeps the cost below 1%.
  static constexpr std::chrono::milliseconds kQuantum{50};

  DeviceSlice(SliceClient* client, const Task& task);
  ~DeviceSlice() { end(); }
  DeviceSlice(const DeviceSlice&) = delete;
  DeviceSlice& operator=(const DeviceSlice&) = delete;

  // Sets the memory that the task needs in all, including what the process has already. Call it
  // before the first time slice.
  void expect(int64_t host_bytes, int64_t device_bytes);
  // Waits for a time slice; the scopes of one task do not nest. Errors: cancelled, also if another
  // worker owns the task by now; grid-too-large if memory never suffices; internal if the gateway
  // is gone.
  Status begin();
  void end();
  // Called between two tiles. If the slice was held long enough, other tasks go first. False: stop,
  // the result is not wanted.
  bool boundary();

  // Holds the slice from a successful begin() to the end of a scope.
  class Scope {
   public:
    explicit Scope(DeviceSlice& slice) : slice_(slice) {}
    ~Scope() { slice_.end(); }
    Scope(const Scope&) = delete;
    Scope& operator=(const Scope&) = delete;

   private:
    DeviceSlice& slice_;
  };

 private:
  using Clock = std::chrono::steady_clock;
  Status ask(SliceAction action);

  SliceClient* const client_;
  SliceRequest request_;
  bool is_held_ = false;
  Clock::time_point since_{};
};

}  // namespace voxeld
