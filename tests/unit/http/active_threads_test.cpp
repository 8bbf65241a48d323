#include "server/http/active_threads.h"

#include <gtest/gtest.h>

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>
#include <utility>
#include <vector>

#include "tests/unit/base/comes_true.h"

namespace voxeld::http {
namespace {

// A counter that threads wait for: std::counting_semaphore of libstdc++ 12 loses wake-ups.
class Events {
 public:
  bool has_any() {
    const std::scoped_lock lock(mutex_);
    return count_ > 0;
  }
  void add(int count) {
    const std::scoped_lock lock(mutex_);
    count_ += count;
    added_.notify_all();
  }
  void take() {
    std::unique_lock lock(mutex_);
    added_.wait(lock, [&] { return count_ > 0; });
    --count_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable added_;
  int count_ = 0;
};

// A pool whose threads wait for events, which stand for those of a poller.
class Pool {
 public:
  Pool(int threads, int active_min, std::function<void()> run)
      : run_(std::move(run)), active_(threads, active_min) {
    for (int i = 0; i < threads; ++i) threads_.emplace_back([this, i] { loop(i); });
  }
  ~Pool() {
    is_ended_ = true;
    active_.end();
    events_.add(static_cast<int>(threads_.size()));
    for (std::thread& thread : threads_) thread.join();
  }
  void add_events(int count) { events_.add(count); }
  int waiting() const { return waiting_; }
  bool has_events() { return events_.has_any(); }

 private:
  void loop(int thread) {
    while (true) {
      active_.wait(thread, [this] {
        ++waiting_;
        events_.take();
        --waiting_;
        return true;
      });
      if (is_ended_) return;
      run_();
    }
  }

  const std::function<void()> run_;
  Events events_;
  std::atomic<int> waiting_ = 0;
  std::atomic<bool> is_ended_ = false;
  ActiveThreads active_;
  std::vector<std::thread> threads_;
};

TEST(ActiveThreads, so_many_wait_for_events_and_the_rest_are_parked) {
  Pool pool(8, 2, [] {});
  ASSERT_TRUE(testing::comes_true([&] { return pool.waiting() == 2; }));
  for (int i = 0; i < 50; ++i) {
    EXPECT_LE(pool.waiting(), 2);
    std::this_thread::sleep_for(std::chrono::milliseconds(1));
  }
}

TEST(ActiveThreads, quick_events_are_all_taken) {
  std::atomic<int> taken = 0;
  Pool pool(8, 2, [&] { ++taken; });
  for (int i = 0; i < 1000; ++i) pool.add_events(3);
  EXPECT_TRUE(testing::comes_true([&] { return taken == 3000; }));
}

TEST(ActiveThreads, parked_threads_replace_those_that_block) {
  std::atomic<int> running = 0;
  std::atomic<bool> blocks = true;
  Events ends;
  Pool pool(8, 2, [&] {
    ++running;
    if (blocks) ends.take();
    --running;
  });
  pool.add_events(8);
  EXPECT_TRUE(testing::comes_true([&] { return running == 8; })) << "more than are active at first";
  ends.add(8);
  ASSERT_TRUE(testing::comes_true([&] { return running == 0; }));
  // With quick events the others are parked again.
  blocks = false;
  ASSERT_TRUE(testing::comes_true([&] {
    pool.add_events(1);
    EXPECT_TRUE(testing::comes_true([&] { return !pool.has_events() && running == 0; }));
    return pool.waiting() <= 2;
  }));
  // The same once more, after the watching thread has gone to sleep.
  std::this_thread::sleep_for(ActiveThreads::kStep * 150);
  blocks = true;
  pool.add_events(8);
  EXPECT_TRUE(testing::comes_true([&] { return running == 8; }));
  ends.add(8);
  EXPECT_TRUE(testing::comes_true([&] { return running == 0; }));
}

TEST(ActiveThreads, the_end_releases_parked_threads) {
  for (int i = 0; i < 20; ++i) const Pool pool(16, 1, [] {});
}

}  // namespace
}  // namespace voxeld::http
