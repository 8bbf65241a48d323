// The worker's side of time slices on its device (proto/messages/task_api.h).
#pragma once

#include <atomic>
#include <chrono>
#include <memory>
#include <string>

#include "proto/messages/task_api.h"
#include "server/base/cancel_point.h"
#include "server/base/thread_annotations.h"
#include "server/process/frame_socket.h"

namespace voxeld {

// The connection to the gateway for time slices. Used by one thread at a time.
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
// always the task's. Used by the thread that runs the task, but for what says otherwise.
class DeviceSlice {
 public:
  // The time that a slice is held before others get theirs. Asking takes about 0.1 ms, so this
  // keeps the cost below 1%.
  static constexpr std::chrono::milliseconds kQuantum{50};

  DeviceSlice(SliceClient* client, const Task& task);
  ~DeviceSlice() { end(); }
  DeviceSlice(const DeviceSlice&) = delete;
  DeviceSlice& operator=(const DeviceSlice&) = delete;

  // Sets the memory that the task needs in all, including what the process has already. Call it
  // before the first time slice.
  void expect(int64_t host_bytes, int64_t device_bytes) EXCLUDES(mutex_);
  // Waits for a time slice; the scopes of one task do not nest. Errors: cancelled, also if another
  // worker owns the task by now; grid-too-large if memory never suffices; internal if the gateway
  // is gone.
  Status begin() EXCLUDES(mutex_);
  void end() EXCLUDES(mutex_);

  // For the task's CancelScope: all its threads wait at their cancellation points while other tasks
  // have theirs. Due once the slice has been held for kQuantum and tick() has seen it.
  const Pause& pause() const { return pause_; }
  // Any thread calls it every few milliseconds. It does not wait.
  void tick();

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
  Status ask(SliceAction action) REQUIRES(mutex_);
  bool renew() EXCLUDES(mutex_);
  bool is_old() const;

  SliceClient* const client_;
  Mutex mutex_;
  SliceRequest request_ GUARDED_BY(mutex_);
  bool is_refused_ GUARDED_BY(mutex_) = false;
  // Since when the slice is held; kNotHeld: it is not. Written with the mutex.
  static constexpr Clock::time_point kNotHeld = Clock::time_point::max();
  std::atomic<Clock::time_point> since_{kNotHeld};
  Pause pause_;
};

}  // namespace voxeld
