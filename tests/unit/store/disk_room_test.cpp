#include "server/store/disk_room.h"

#include <gtest/gtest.h>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

TEST(DiskRoom, room_that_is_taken_is_not_taken_twice) {
  const testing::TemporaryDir dir;
  DiskRoom disk(dir.path(), 1);
  const int64_t most = disk.free_bytes().value() / 3 * 2;
  {
    const auto room = disk.take(most);
    ASSERT_TRUE(room) << room.error().message();
    const auto other = disk.take(most);
    ASSERT_FALSE(other);
    EXPECT_EQ(other.error().code, ErrorCode::kStorageFull);
    EXPECT_EQ(other.error().detail,
              "the disk is nearly full; uploads and results are refused, delete something");
  }
  EXPECT_TRUE(disk.take(most)) << "it was given back";
}

TEST(DiskRoom, without_a_reserve_any_room_is_given) {
  const testing::TemporaryDir dir;
  DiskRoom disk(dir.path(), 0);
  EXPECT_TRUE(disk.take(int64_t{1} << 60));
  EXPECT_TRUE(disk.for_jobs());
  EXPECT_EQ(disk.worker_reserve_bytes().value(), 0);
}

TEST(DiskRoom, workers_leave_more_than_the_reserve_and_jobs_need_more_than_that) {
  const testing::TemporaryDir dir;
  const DiskRoom disk(dir.path(), 1000);
  EXPECT_EQ(disk.worker_reserve_bytes().value(), 1000 + DiskRoom::kRowRoomBytes);
  EXPECT_GT(DiskRoom::kJobRoomBytes, DiskRoom::kRowRoomBytes);
}

}  // namespace
}  // namespace voxeld
