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
  const uint64_t passed = outer.points_passed();
  EXPECT_NO_THROW(cancel_point());
  EXPECT_GT(outer.points_passed(), passed);
  outer_flag = true;
  EXPECT_THROW(cancel_point(), Cancelled);
}

TEST(CancelPoint, ends_a_loop_that_threads_share) {
  std::atomic<bool> flag{false};
  const CancelScope scope(flag);
  const uint64_t passed = scope.points_passed();
  const ThreadTeam team(4);
  team.run(4, [&](int) { cancel_point(); });
  EXPECT_GT(scope.points_passed(), passed);
  // Every part goes on until the flag is set by the last of them.
  std::atomic<int> begun{0};
  const auto part = [&](int) {
    if (++begun == 2) flag = true;
    while (true) cancel_point();
  };
  EXPECT_THROW(ThreadTeam(2).run(2, part), Cancelled);
  std::thread([] { EXPECT_NO_THROW(cancel_point()); }).join();
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
