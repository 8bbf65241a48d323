#include "proto/thread_pool.h"

#include <pthread.h>

#include <algorithm>

namespace voxeld {
namespace {

// The pool that the handlers of fork(2) know.
ThreadPool* forked = nullptr;

}  // namespace

ThreadPool& ThreadPool::shared() {
  // Not destroyed: threads may still use it while the process ends.
  static ThreadPool* const pool = [] {
    auto* made = new ThreadPool(std::max<size_t>(std::thread::hardware_concurrency(), 1));
    made->handle_fork();
    return made;
  }();
  return *pool;
}

// One thread more than a loop needs, so that posted work goes on beside loops.
ThreadPool::ThreadPool(size_t threads) : threads_(std::max<size_t>(threads, 1)) {
  try {
    for (size_t i = 0; i < threads_; ++i) helpers_.emplace_back([this] { serve(); });
  } catch (const std::exception&) {
    // No more threads, or no memory for them: the others do the work.
  }
  const std::lock_guard lock(mutex_);
  has_helpers_ = !helpers_.empty();
}

ThreadPool::~ThreadPool() {
  {
    const std::lock_guard lock(mutex_);
    is_stopping_ = true;
  }
  work_.notify_all();
  for (std::thread& helper : helpers_) helper.join();
}

// A child process has the mutex and none of the threads. That its condition variables still count
// waiting threads does not matter: nobody notifies where `idle_` is 0.
void ThreadPool::handle_fork() {
  forked = this;
  ::pthread_atfork([] { forked->mutex_.lock(); }, [] { forked->mutex_.unlock(); },
                   [] {
                     forked->idle_ = 0;
                     forked->has_helpers_ = false;
                     forked->first_ = nullptr;
                     forked->mutex_.unlock();
                   });
}

bool ThreadPool::post(std::function<void()> work) {
  const std::lock_guard lock(mutex_);
  if (!has_helpers_) return false;
  posted_.push_back(std::move(work));
  if (idle_ > 0) work_.notify_one();
  return true;
}

void ThreadPool::run(Loop& loop) {
  if (loop.helpers_max == 0) {
    for (size_t i = 0; i < loop.count; ++i) loop.call(loop.work, i);
    return;
  }
  {
    const std::lock_guard lock(mutex_);
    add(loop);
    for (size_t i = std::min(idle_, loop.helpers_max); i > 0; --i) work_.notify_one();
  }
  work_on(loop);
  {
    std::unique_lock lock(mutex_);
    remove(loop);
    done_.wait(lock, [&] { return loop.helpers == 0; });
  }
  if (loop.failure) std::rethrow_exception(loop.failure);
}

void ThreadPool::work_on(Loop& loop) noexcept {
  for (size_t i = loop.next++; i < loop.count; i = loop.next++) {
    try {
      loop.call(loop.work, i);
    } catch (...) {
      if (!loop.has_failed.exchange(true)) loop.failure = std::current_exception();
      loop.next = loop.count;
    }
  }
}

void ThreadPool::add(Loop& loop) {
  Loop** end = &first_;
  while (*end != nullptr) end = &(*end)->after;
  *end = &loop;
}

void ThreadPool::remove(Loop& loop) {
  Loop** at = &first_;
  while (*at != nullptr && *at != &loop) at = &(*at)->after;
  if (*at != nullptr) *at = loop.after;  // a child process has no loops at first
}

// The oldest loop that more threads may work on.
ThreadPool::Loop* ThreadPool::open_loop() const {
  Loop* loop = first_;
  while (loop != nullptr && (loop->helpers == loop->helpers_max || loop->next >= loop->count)) {
    loop = loop->after;
  }
  return loop;
}

void ThreadPool::serve() {
  std::unique_lock lock(mutex_);
  while (true) {
    if (Loop* loop = open_loop()) {
      ++loop->helpers;
      lock.unlock();
      work_on(*loop);
      lock.lock();
      if (--loop->helpers == 0) done_.notify_all();
    } else if (!posted_.empty()) {
      std::function<void()> work = std::move(posted_.front());
      posted_.pop_front();
      lock.unlock();
      work();
      work = nullptr;  // what it captured goes before the lock is taken
      lock.lock();
    } else if (is_stopping_) {
      return;
    } else {
      ++idle_;
      work_.wait(lock);
      --idle_;
    }
  }
}

}  // namespace voxeld
