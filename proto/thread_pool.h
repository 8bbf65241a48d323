// The threads of a process that compute: loops are split among them, and single pieces of work are
// left to them.
#pragma once

#include <algorithm>
#include <atomic>
#include <condition_variable>
#include <cstddef>
#include <deque>
#include <exception>
#include <functional>
#include <limits>
#include <mutex>
#include <thread>
#include <type_traits>
#include <utility>
#include <vector>

namespace voxeld {

// Thread-safe. A thread that runs a loop always takes part in it and never waits for a thread of
// the pool to be free. So loops may be nested, run beside each other, and work without any thread
// of the pool: where none can be started, and in a child process after fork(2).
class ThreadPool {
 public:
  // The pool of the process, which all loops use, with as many threads as the machine has. It is
  // started by its first use and never ends.
  static ThreadPool& shared();

  // threads: that work on one loop at most, with the one that runs it; at least 1.
  explicit ThreadPool(size_t threads);
  // Finishes the posted work. No loop may be running.
  ~ThreadPool();
  ThreadPool(const ThreadPool&) = delete;
  ThreadPool& operator=(const ThreadPool&) = delete;

  size_t threads() const { return threads_; }

  // Calls work(i) once for each i < count, in any order and on at most threads_max threads, and
  // returns when all calls are done. An exception of `work` is rethrown here; calls that have not
  // begun by then are skipped. Allocates nothing.
  template <typename Work>
  void for_each(size_t count, Work&& work, size_t threads_max = kAnyThreads) {
    using Callee = std::remove_reference_t<Work>;
    Loop loop;
    loop.count = count;
    loop.helpers_max = std::max<size_t>(std::min({threads_max, threads_, count}), 1) - 1;
    loop.work = const_cast<void*>(static_cast<const void*>(&work));
    loop.call = [](void* callee, size_t i) { (*static_cast<Callee*>(callee))(i); };
    run(loop);
  }

  // Runs `work` later on a thread of the pool, when no loop needs that thread. It must not throw.
  // False: the pool has no threads.
  bool post(std::function<void()> work);

 private:
  static constexpr size_t kAnyThreads = std::numeric_limits<size_t>::max();

  struct Loop {
    void* work = nullptr;
    void (*call)(void* work, size_t i) = nullptr;
    size_t count = 0;
    size_t helpers_max = 0;
    std::atomic<size_t> next{0};
    std::atomic<bool> has_failed{false};
    std::exception_ptr failure;  // written by the one that sets has_failed
    // Guarded by the pool's mutex.
    size_t helpers = 0;  // threads of the pool that work on it now
    Loop* after = nullptr;
  };

  void run(Loop& loop);
  static void work_on(Loop& loop) noexcept;
  void add(Loop& loop);
  void remove(Loop& loop);
  Loop* open_loop() const;
  void serve();
  void handle_fork();

  const size_t threads_;
  std::mutex mutex_;
  std::condition_variable work_;  // for the threads of the pool
  std::condition_variable done_;  // for those that run loops
  // Guarded by mutex_.
  Loop* first_ = nullptr;
  std::deque<std::function<void()>> posted_;
  size_t idle_ = 0;  // threads of the pool that wait
  bool is_stopping_ = false;
  bool has_helpers_ = false;
  std::vector<std::thread> helpers_;  // last: they use all of the above
};

}  // namespace voxeld
