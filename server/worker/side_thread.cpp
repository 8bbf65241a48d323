#include "server/worker/side_thread.h"

#include <exception>
#include <utility>

namespace voxeld {

SideThread::SideThread(size_t bytes_max) : bytes_max_(bytes_max), thread_([this] { run(); }) {}

SideThread::~SideThread() {
  {
    MutexLock lock(mutex_);
    ending_ = true;
    changed_.notify_all();
  }
  thread_.join();
}

Status SideThread::outcome() {
  if (thrown_) std::rethrow_exception(thrown_);
  return error_ ? Status(*error_) : Status();
}

Status SideThread::push(size_t bytes, std::function<Status()> work) {
  MutexLock lock(mutex_);
  while (bytes_ > bytes_max_ && !error_ && !thrown_) changed_.wait(lock);
  VOXELD_TRY(outcome());
  items_.push_back({bytes, std::move(work)});
  bytes_ += bytes;
  changed_.notify_all();
  return {};
}

Status SideThread::wait() {
  MutexLock lock(mutex_);
  while (!items_.empty() && !error_ && !thrown_) changed_.wait(lock);
  return outcome();
}

void SideThread::run() {
  while (true) {
    std::function<Status()> work;
    {
      MutexLock lock(mutex_);
      while (!ending_ && items_.empty()) changed_.wait(lock);
      if (ending_) return;
      work = std::move(items_.front().work);
    }
    Status done;
    std::exception_ptr thrown;
    try {
      done = work();
    } catch (...) {
      thrown = std::current_exception();
    }
    work = nullptr;  // frees the captures before waiting threads are notified
    MutexLock lock(mutex_);
    bytes_ -= items_.front().bytes;
    items_.pop_front();
    if (!done) error_ = done.error();
    thrown_ = thrown;
    changed_.notify_all();
    if (error_ || thrown_) return;
  }
}

}  // namespace voxeld
