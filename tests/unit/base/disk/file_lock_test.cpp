#include "server/base/disk/directory.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <array>
#include <string>
#include <thread>

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

// A holder that is killed between fork and exec of a child.
TEST(FileLock, waits_for_the_child_of_a_holder_that_has_ended) {
  testing::TemporaryDir dir;
  std::array<int, 2> gate{};
  ASSERT_EQ(::pipe2(gate.data(), O_CLOEXEC), 0);
  const pid_t holder = ::fork();
  if (holder == 0) {
    const auto lock = lock_directory(dir.path());
    if (lock && ::fork() == 0) {
      ::close(gate[1]);
      char byte;
      (void)!::read(gate[0], &byte, 1);  // until the test closes its end
    }
    ::_exit(lock ? 0 : 1);
  }
  int status = 0;
  ASSERT_EQ(::waitpid(holder, &status, 0), holder);
  ASSERT_EQ(status, 0);
  ASSERT_TRUE(is_directory_locked(dir.path()));
  std::thread end_of_child([&gate] { ::close(gate[1]); });
  const auto lock = lock_directory(dir.path());
  end_of_child.join();
  ::close(gate[0]);
  EXPECT_TRUE(lock) << lock.error().detail;
}

}  // namespace
}  // namespace voxeld
