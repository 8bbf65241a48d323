#include "proto/thread_pool.h"

#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <algorithm>
#include <chrono>
#include <future>
#include <stdexcept>

namespace voxeld {
namespace {

TEST(ThreadPool, every_index_is_worked_on_once) {
  ThreadPool pool(4);
  for (const size_t count : {0u, 1u, 2u, 1000u}) {
    std::vector<std::atomic<int>> calls(count);
    pool.for_each(count, [&](size_t i) { ++calls[i]; });
    for (const auto& call : calls) EXPECT_EQ(call, 1);
  }
}

TEST(ThreadPool, an_exception_comes_out_once_no_thread_works_on_the_loop) {
  ThreadPool pool(4);
  std::atomic<int> running = 0, calls = 0;
  EXPECT_THROW(pool.for_each(100000,
                             [&](size_t i) {
                               ++running;
                               ++calls;
                               --running;
                               if (i % 10 == 3) throw std::runtime_error("no");
                             }),
               std::runtime_error);
  EXPECT_EQ(running, 0);
  EXPECT_LT(calls, 100000);
  std::atomic<int> after = 0;
  pool.for_each(10, [&](size_t) { ++after; });
  EXPECT_EQ(after, 10);
}

// Each call waits until as many run at once as may.
TEST(ThreadPool, a_loop_uses_all_threads_and_no_more_than_it_may) {
  ThreadPool pool(4);
  for (const size_t threads_max : {size_t{1}, size_t{3}, size_t{9}}) {
    const int wanted = static_cast<int>(std::min<size_t>(threads_max, 4));
    std::atomic<int> running = 0, most = 0;
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
    pool.for_each(
        8,
        [&](size_t) {
          const int now = ++running;
          for (int seen = most; seen < now && !most.compare_exchange_weak(seen, now);) continue;
          while (most < wanted && std::chrono::steady_clock::now() < deadline) {
            std::this_thread::yield();
          }
          --running;
        },
        threads_max);
    EXPECT_EQ(most, wanted);
  }
}

TEST(ThreadPool, loops_may_be_nested_and_run_beside_each_other) {
  ThreadPool pool(3);
  std::atomic<int> calls = 0;
  std::vector<std::thread> callers;
  for (int caller = 0; caller < 4; ++caller) {
    callers.emplace_back(
        [&] { pool.for_each(20, [&](size_t) { pool.for_each(30, [&](size_t) { ++calls; }); }); });
  }
  for (std::thread& caller : callers) caller.join();
  EXPECT_EQ(calls, 4 * 20 * 30);
}

TEST(ThreadPool, posted_work_is_done_beside_a_loop_on_all_threads) {
  ThreadPool pool(2);
  std::promise<void> done;
  std::future<void> posted = done.get_future();
  std::atomic<bool> was_done = false;
  std::atomic<int> running = 0;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(60);
  pool.for_each(2, [&](size_t) {
    if (++running == 2) {
      EXPECT_TRUE(pool.post([&] { done.set_value(); }));
    }
    while (!was_done && std::chrono::steady_clock::now() < deadline) {
      if (posted.wait_for(std::chrono::milliseconds(1)) == std::future_status::ready) {
        was_done = true;
      }
    }
  });
  EXPECT_TRUE(was_done);
}

TEST(ThreadPool, the_end_of_a_pool_finishes_posted_work) {
  std::atomic<int> done = 0;
  {
    ThreadPool pool(2);
    for (int i = 0; i < 100; ++i) EXPECT_TRUE(pool.post([&] { ++done; }));
  }
  EXPECT_EQ(done, 100);
}

// As a Python program does that uses multiprocessing.
TEST(ThreadPool, loops_work_in_a_child_process_that_has_no_threads) {
  ThreadPool& pool = ThreadPool::shared();
  std::atomic<int> calls = 0;
  pool.for_each(100, [&](size_t) { ++calls; });
  const pid_t child = ::fork();
  if (child == 0) {
    ::alarm(60);
    std::atomic<int> own = 0;
    pool.for_each(100, [&](size_t) { ++own; });
    ::_exit(own == 100 && !pool.post([] {}) ? 7 : 8);
  }
  ASSERT_GT(child, 0);
  int status = 0;
  ASSERT_EQ(::waitpid(child, &status, 0), child);
  EXPECT_TRUE(WIFEXITED(status) && WEXITSTATUS(status) == 7) << status;
  pool.for_each(100, [&](size_t) { ++calls; });
  EXPECT_EQ(calls, 200);
}

}  // namespace
}  // namespace voxeld
