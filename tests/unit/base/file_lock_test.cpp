#include "server/base/directory.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <string>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

TEST(FileLock, a_second_lock_is_refused_with_the_holders_number) {
  testing::TemporaryDir dir;
  auto first = lock_file(dir.path() / "lock");
  ASSERT_TRUE(first) << first.error().detail;
  auto second = lock_file(dir.path() / "lock");
  ASSERT_FALSE(second);
  EXPECT_EQ(second.error().code, ErrorCode::kConflict);
  EXPECT_EQ(second.error().detail,
            dir.path().string() + " is in use by process " + std::to_string(::getpid()));
  EXPECT_EQ(second.error().expected, "one daemon for each data directory");
}

TEST(FileLock, a_lock_that_was_let_go_can_be_taken_again) {
  testing::TemporaryDir dir;
  { ASSERT_TRUE(lock_file(dir.path() / "lock")); }
  EXPECT_TRUE(lock_file(dir.path() / "lock"));
}

}  // namespace
}  // namespace voxeld
