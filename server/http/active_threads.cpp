#include "server/http/active_threads.h"

#include <algorithm>

namespace voxeld::http {
namespace {

// Steps with a waiting thread before the watcher sleeps until the next time that none waits.
constexpr int kQuietStepsMax = 100;

}  // namespace

ActiveThreads::ActiveThreads(int threads)
    : ActiveThreads(threads, std::clamp(static_cast<int>(std::thread::hardware_concurrency()),
                                        std::min(threads, 2), threads)) {}

ActiveThreads::ActiveThreads(int threads, int active_min)
    : active_min_(active_min),
      seats_(static_cast<size_t>(threads)),
      watcher_([this] { watch(); }) {}

void ActiveThreads::before_wait(Seat& seat) {
  seat.event.store(Seat::kAway, std::memory_order_relaxed);
  // Read without the lock: a thread too many or too few parks at the next event.
  const bool is_needed = seat.is_active && !seat.is_blocked && active_ - blocked_ <= active_min_;
  if (!is_needed) {
    MutexLock lock(mutex_);
    if (seat.is_active) --active_;
    if (seat.is_blocked.exchange(false)) --blocked_;
    while (!ended_ && active_ - blocked_ >= active_min_) parked_.wait(lock);
    ++active_;
    seat.is_active = true;
  }
  ++waiting_;
}

void ActiveThreads::after_wait(Seat& seat) {
  seat.event.store(++seat.taken, std::memory_order_relaxed);
  if (--waiting_ > 0 || is_watching_) return;
  const MutexLock lock(mutex_);
  is_watching_ = true;
  unwatched_.notify_one();
}

void ActiveThreads::find_blocked() {
  int blocked = 0;
  for (Seat& seat : seats_) {
    const uint64_t event = seat.event.load(std::memory_order_relaxed);
    const bool is_blocked = event != Seat::kAway && event == seat.last;
    seat.is_blocked = is_blocked;
    seat.last = event;
    if (is_blocked) ++blocked;
  }
  blocked_ = blocked;
}

void ActiveThreads::watch() {
  int quiet_steps = 0;
  MutexLock lock(mutex_);
  while (!ended_) {
    unwatched_.wait_for(lock, kStep);
    find_blocked();
    for (int free = active_ - blocked_; free < active_min_; ++free) parked_.notify_one();
    quiet_steps = waiting_ > 0 ? quiet_steps + 1 : 0;
    if (quiet_steps <= kQuietStepsMax) continue;
    quiet_steps = 0;
    is_watching_ = false;
    // A thread that takes waiting_ to 0 from here on sees is_watching_.
    while (!ended_ && !is_watching_ && waiting_ > 0) unwatched_.wait(lock);
    is_watching_ = true;
  }
}

void ActiveThreads::end() {
  {
    const MutexLock lock(mutex_);
    ended_ = true;
  }
  parked_.notify_all();
  unwatched_.notify_all();
  if (watcher_.joinable()) watcher_.join();
}

}  // namespace voxeld::http
