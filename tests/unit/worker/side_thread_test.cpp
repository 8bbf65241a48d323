#include "server/worker/side_thread.h"

#include <gtest/gtest.h>

#include <atomic>
#include <future>
#include <stdexcept>
#include <string>
#include <vector>

namespace voxeld {
namespace {

TEST(SideThread, work_is_done_in_order_and_waited_for) {
  std::vector<int> done;
  SideThread side(0);
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

TEST(SideThread, after_an_error_nothing_more_is_done) {
  std::atomic<int> done = 0;
  SideThread side(1000);
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

TEST(SideThread, exceptions_come_back_to_who_gave_the_work) {
  SideThread side(0);
  (void)side.push(0, []() -> Status { throw std::bad_alloc(); });
  EXPECT_THROW((void)side.wait(), std::bad_alloc);
}

TEST(SideThread, who_gives_more_than_may_wait_is_held_back) {
  std::promise<void> gate;
  std::shared_future<void> opened = gate.get_future().share();
  std::atomic<bool> third_is_in = false;
  SideThread side(10);
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

TEST(SideThread, what_still_waits_at_the_end_is_not_done) {
  std::promise<void> started, gate;
  std::atomic<int> done = 0;
  {
    SideThread side(1000);
    (void)side.push(0, [&]() -> Status {
      started.set_value();
      gate.get_future().wait();
      ++done;
      return {};
    });
    (void)side.push(0, [&]() -> Status {
      ++done;
      return {};
    });
    started.get_future().wait();
    // Ends while the first is being done.
    std::thread opener([&] {
      std::this_thread::sleep_for(std::chrono::milliseconds(30));
      gate.set_value();
    });
    opener.detach();
  }
  EXPECT_EQ(done, 1);
}

}  // namespace
}  // namespace voxeld
