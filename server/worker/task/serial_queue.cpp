#include "server/worker/task/serial_queue.h"

#include <deque>
#include <exception>
#include <optional>
#include <utility>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/base/guard.h"
#include "server/base/thread_annotations.h"

namespace voxeld {

struct SerialQueue::State : std::enable_shared_from_this<State> {
  struct Item {
    size_t bytes;
    std::function<Status()> work;
  };

  explicit State(size_t bytes_limit) : bytes_max(bytes_limit) {}

  Status push(size_t more_bytes, std::function<Status()> work) EXCLUDES(mutex) {
    VOXELD_TRY(run_until(Goal::kRoom));
    const MutexLock lock(mutex);
    items.push_back({more_bytes, std::move(work)});
    bytes += more_bytes;
    post();
    return {};
  }

  enum class Goal {
    kRoom,  // no more bytes than may wait
    kDone,  // no item is left
  };

  bool has_reached(Goal goal) const REQUIRES(mutex) {
    return goal == Goal::kRoom ? bytes <= bytes_max : items.empty() && !is_running;
  }

  // Runs items, or waits for the one that runs, until the goal or an error.
  Status run_until(Goal goal) EXCLUDES(mutex) {
    while (true) {
      {
        MutexLock lock(mutex);
        if (thrown) std::rethrow_exception(thrown);
        if (error) return *error;
        if (has_reached(goal)) return {};
        if (is_running) {
          changed.wait(lock);
          continue;
        }
      }
      run_first();
    }
  }

  // Runs the first item unless one runs.
  void run_first() EXCLUDES(mutex) {
    Item item;
    {
      const MutexLock lock(mutex);
      if (is_running || items.empty()) return;
      item = std::move(items.front());
      items.pop_front();
      is_running = true;
    }
    Status done;
    std::exception_ptr failure;
    try {
      const BorrowedCancelScope borrowed(scope);
      done = item.work();
    } catch (...) {
      failure = std::current_exception();
    }
    item.work = nullptr;  // frees the captures before waiting threads are notified
    const MutexLock lock(mutex);
    is_running = false;
    bytes -= item.bytes;
    if (!done) error = done.error();
    thrown = failure;
    if (error || thrown) items.clear();
    if (!items.empty()) post();
    changed.notify_all();
  }

  // Leaves the first item to the pool. If the pool takes none, run_until() runs all.
  void post() REQUIRES(mutex) {
    if (is_posted || is_running) return;
    try {
      is_posted = ThreadPool::shared().post([state = shared_from_this()] { state->serve(); });
    } catch (const std::exception& failure) {
      log_exception("a thread of the pool", failure.what());
    }
  }

  void serve() EXCLUDES(mutex) {
    {
      const MutexLock lock(mutex);
      is_posted = false;
    }
    run_first();
  }

  void end() EXCLUDES(mutex) {
    MutexLock lock(mutex);
    items.clear();
    while (is_running) changed.wait(lock);
  }

  const size_t bytes_max;
  const CancelScope* const scope = internal::cancel_scope;  // of the thread that pushes
  Mutex mutex;
  CondVar changed;
  std::deque<Item> items GUARDED_BY(mutex);  // those that wait
  size_t bytes GUARDED_BY(mutex) = 0;        // of those and the one that runs
  bool is_running GUARDED_BY(mutex) = false;
  bool is_posted GUARDED_BY(mutex) = false;  // the pool will call serve()
  std::optional<Error> error GUARDED_BY(mutex);
  std::exception_ptr thrown GUARDED_BY(mutex);
};

SerialQueue::SerialQueue(size_t bytes_max) : state_(std::make_shared<State>(bytes_max)) {}

SerialQueue::~SerialQueue() {
  state_->end();
}

Status SerialQueue::push(size_t bytes, std::function<Status()> work) {
  return state_->push(bytes, std::move(work));
}

Status SerialQueue::wait() {
  return state_->run_until(State::Goal::kDone);
}

}  // namespace voxeld
