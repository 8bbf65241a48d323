#include "server/base/cancel_point.h"

#include <gtest/gtest.h>

#include <thread>

#include "server/base/parallel.h"

namespace voxeld {
namespace {

TEST(CancelPoint, throws_once_the_scope_s_flag_is_set_and_not_without_a_scope) {
  std::atomic<bool> flag{false};
  {
    const CancelScope scope(flag);
    EXPECT_NO_THROW(cancel_point());
    flag = true;
    EXPECT_THROW(cancel_point(), Cancelled);
    std::thread([] { EXPECT_NO_THROW(cancel_point()); }).join();  // it has no scope
  }
  EXPECT_NO_THROW(cancel_point());
}

TEST(CancelPoint, an_inner_scope_is_cancelled_where_the_outer_one_is) {
  std::atomic<bool> outer_flag{false}, inner_flag{false};
  const CancelScope outer(outer_flag);
  const CancelScope inner(inner_flag);
  EXPECT_FALSE(outer.has_passed_points());
  EXPECT_NO_THROW(cancel_point());
  EXPECT_TRUE(outer.has_passed_points());
  outer_flag = true;
  EXPECT_THROW(cancel_point(), Cancelled);
}

TEST(CancelPoint, ends_a_loop_that_threads_share) {
  std::atomic<bool> flag{false};
  const CancelScope scope(flag);
  EXPECT_FALSE(scope.has_passed_points());
  const ThreadTeam team(4);
  team.run(4, [&](int) { cancel_point(); });
  EXPECT_TRUE(scope.has_passed_points());
  EXPECT_FALSE(scope.has_passed_points());
  // Every part goes on until the flag is set by the last of them.
  std::atomic<int> begun{0};
  const auto part = [&](int) {
    if (++begun == 2) flag = true;
    while (true) cancel_point();
  };
  EXPECT_THROW(ThreadTeam(2).run(2, part), Cancelled);
  std::thread([] { EXPECT_NO_THROW(cancel_point()); }).join();
}

TEST(CancelPoint, pauses_while_it_is_due_on_each_thread_of_a_loop) {
  const std::atomic<bool> flag{false};
  std::atomic<int> taken{0};
  Pause pause;
  pause.take = [&] {
    pause.is_due = ++taken < 3;
    return true;
  };
  const CancelScope scope(flag, &pause);
  cancel_point();
  EXPECT_EQ(taken, 0);
  pause.is_due = true;
  ThreadTeam(2).run(2, [&](int) {
    while (taken < 3) cancel_point();
  });
  EXPECT_FALSE(pause.is_due);
  pause.is_due = true;
  pause.take = [] { return false; };
  EXPECT_THROW(cancel_point(), Cancelled);
}

TEST(CancelPoint, passes_through_handlers_of_library_exceptions) {
  const std::atomic<bool> flag{true};
  const CancelScope scope(flag);
  const auto decode = [] {
    try {
      cancel_point();
    } catch (const std::exception&) {
      FAIL() << "taken for a failure of the library";
    }
  };
  EXPECT_THROW(decode(), Cancelled);
}

}  // namespace
}  // namespace voxeld
