// Keeps as many threads of a pool active as there are cores, and more while some of them block.
#pragma once

#include <atomic>
#include <chrono>
#include <cstdint>
#include <thread>
#include <vector>

#include "server/base/thread_annotations.h"

namespace voxeld::http {

// Thread-safe. All threads of a pool may wait for events of one epoll descriptor, but each event
// wakes one of them while the thread that has just finished is about to wait itself: two switches
// of threads for each request. With as many active threads as cores an event usually finds a thread
// that is awake.
//
// A thread that spends more than kStep with one event counts as blocked (a write of the database, a
// file that is hashed), and a parked thread takes its place. This is noticed within two steps, and
// only when no active thread waits for events.
class ActiveThreads {
 public:
  static constexpr auto kStep = std::chrono::milliseconds(1);

  // `threads`: of the pool. As many are active as there are cores, or two.
  explicit ActiveThreads(int threads);
  ActiveThreads(int threads, int active_min);
  ~ActiveThreads() { end(); }
  ActiveThreads(const ActiveThreads&) = delete;
  ActiveThreads& operator=(const ActiveThreads&) = delete;

  // Called by thread 0, 1, … of the pool: wait(), which blocks until there is an event, once not
  // enough others are active. After end() it is called at once.
  template <typename Wait>
  auto wait(int thread, const Wait& wait) EXCLUDES(mutex_) {
    Seat& seat = seats_[static_cast<size_t>(thread)];
    before_wait(seat);
    const auto event = wait();
    after_wait(seat);
    return event;
  }
  // Nobody is parked from here on.
  void end() EXCLUDES(mutex_);

 private:
  // One thread of the pool.
  struct Seat {
    // How often the thread has taken an event; kAway while it waits for one or is parked.
    static constexpr uint64_t kAway = UINT64_MAX;
    std::atomic<uint64_t> event = kAway;
    std::atomic<bool> is_blocked = false;
    // Used by the thread alone.
    uint64_t taken = 0;
    bool is_active = false;
    // Used by the watching thread alone.
    uint64_t last = kAway;
  };

  // Blocks while enough others are active.
  void before_wait(Seat& seat) EXCLUDES(mutex_);
  void after_wait(Seat& seat) EXCLUDES(mutex_);
  void watch() EXCLUDES(mutex_);
  // Finds the threads that have had the same event since the last call.
  void find_blocked() REQUIRES(mutex_);

  const int active_min_;
  std::vector<Seat> seats_;
  std::atomic<int> waiting_ = 0;               // threads that wait for events
  std::atomic<int> active_ = 0, blocked_ = 0;  // changed under mutex_
  std::atomic<bool> is_watching_ = false;      // each step
  Mutex mutex_;
  CondVar parked_, unwatched_;
  bool ended_ GUARDED_BY(mutex_) = false;
  std::thread watcher_;
};

}  // namespace voxeld::http
