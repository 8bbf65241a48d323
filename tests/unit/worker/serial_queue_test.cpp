#include "server/worker/task/serial_queue.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <memory>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <utility>
#include <vector>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "tests/unit/base/comes_true.h"

namespace voxeld {
namespace {

TEST(SerialQueue, work_is_done_in_order_and_waited_for) {
  std::vector<int> done;
  SerialQueue side(0);
  for (int i = 0; i < 100; ++i) {
    ASSERT_TRUE(side.push(1,
                          [&done, i]() -> Status {
                            done.push_back(i);
                            return {};
                          })
                    .ok());
  }
  ASSERT_TRUE(side.wait().ok());
  ASSERT_EQ(done.size(), 100u);
  for (int i = 0; i < 100; ++i) EXPECT_EQ(done[static_cast<size_t>(i)], i);
}

TEST(SerialQueue, after_an_error_nothing_more_is_done) {
  std::atomic<int> done = 0;
  SerialQueue side(1000);
  (void)side.push(0, [] { return Status(Error{ErrorCode::kCancelled, "enough", "", ""}); });
  const Status waited = side.wait();
  ASSERT_FALSE(waited.ok());
  EXPECT_EQ(waited.error().detail, "enough");
  const Status pushed = side.push(0, [&]() -> Status {
    ++done;
    return {};
  });
  EXPECT_FALSE(pushed.ok());
  EXPECT_EQ(done, 0);
}

// As many queues as keep all threads of the pool busy, and one more.
TEST(SerialQueue, a_queue_comes_to_its_end_though_the_pool_is_busy) {
  std::promise<void> gate;
  const std::shared_future<void> opened = gate.get_future().share();
  std::vector<std::unique_ptr<SerialQueue>> busy;
  for (size_t i = 0; i < ThreadPool::shared().threads() + 1; ++i) {
    busy.push_back(std::make_unique<SerialQueue>(0));
    ASSERT_TRUE(busy.back()
                    ->push(0,
                           [opened]() -> Status {
                             opened.wait();
                             return {};
                           })
                    .ok());
  }
  int done = 0;
  SerialQueue queue(0);
  for (int i = 0; i < 3; ++i) {
    ASSERT_TRUE(queue
                    .push(1,
                          [&done]() -> Status {
                            ++done;
                            return {};
                          })
                    .ok());
  }
  EXPECT_TRUE(queue.wait().ok());
  EXPECT_EQ(done, 3);
  gate.set_value();
  for (const auto& one : busy) EXPECT_TRUE(one->wait().ok());
}

TEST(SerialQueue, exceptions_come_back_to_the_pushing_thread) {
  SerialQueue side(0);
  (void)side.push(0, []() -> Status { throw std::bad_alloc(); });
  EXPECT_THROW((void)side.wait(), std::bad_alloc);
}

TEST(SerialQueue, work_ends_at_cancellation_points_of_the_thread_that_made_the_queue) {
  std::atomic<bool> flag{false};
  const CancelScope scope(flag);
  SerialQueue side(0);
  (void)side.push(0, [&]() -> Status {
    flag = true;
    while (true) cancel_point();
  });
  EXPECT_THROW((void)side.wait(), Cancelled);
}

TEST(SerialQueue, a_push_over_the_limit_waits) {
  std::promise<void> gate;
  std::shared_future<void> opened = gate.get_future().share();
  std::atomic<bool> third_is_in = false;
  SerialQueue side(10);
  const auto slow = [opened]() -> Status {
    opened.wait();
    return {};
  };
  ASSERT_TRUE(side.push(8, slow).ok());
  ASSERT_TRUE(side.push(8, slow).ok());  // 16 bytes wait from now on
  std::thread giver([&] {
    EXPECT_TRUE(side.push(1, slow).ok());
    third_is_in = true;
  });
  std::this_thread::sleep_for(std::chrono::milliseconds(50));
  EXPECT_FALSE(third_is_in);
  gate.set_value();
  giver.join();
  EXPECT_TRUE(third_is_in);
  EXPECT_TRUE(side.wait().ok());
}

TEST(SerialQueue, items_that_wait_at_the_end_are_dropped) {
  std::promise<void> started, dropped, gate;
  std::atomic<int> done = 0;
  // The second item holds it, so its end shows that the queue has begun to end.
  std::shared_ptr<void> held(nullptr, [&dropped](void*) { dropped.set_value(); });
  // The queue ends while the first item is being done.
  std::thread opener([&] {
    EXPECT_EQ(dropped.get_future().wait_for(testing::kPatience), std::future_status::ready);
    gate.set_value();
  });
  {
    SerialQueue side(1000);
    (void)side.push(0, [&]() -> Status {
      started.set_value();
      gate.get_future().wait();
      ++done;
      return {};
    });
    (void)side.push(0, [&done, with = std::move(held)]() -> Status {
      ++done;
      return {};
    });
    started.get_future().wait();
  }
  opener.join();
  EXPECT_EQ(done, 1);
}

}  // namespace
}  // namespace voxeld
