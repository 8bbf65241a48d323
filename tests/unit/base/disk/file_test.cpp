#include "server/base/disk/file.h"

#include <gtest/gtest.h>

#include <cerrno>
#include <string>
#include <vector>

#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

TEST(File, written_bytes_are_read_back) {
  testing::TemporaryDir dir;
  const std::vector<uint8_t> bytes = {1, 2, 3, 0, 255};
  ASSERT_TRUE(write_file(dir.path() / "a", bytes));
  auto read = read_file(dir.path() / "a");
  ASSERT_TRUE(read);
  EXPECT_EQ(*read, bytes);
}

TEST(File, an_empty_file_maps_to_an_empty_span) {
  testing::TemporaryDir dir;
  ASSERT_TRUE(write_file(dir.path() / "empty", {}));
  auto mapped = MappedFile::open(dir.path() / "empty");
  ASSERT_TRUE(mapped);
  EXPECT_TRUE(mapped->bytes().empty());
}

TEST(File, a_missing_file_is_named_in_the_error) {
  testing::TemporaryDir dir;
  auto read = read_file(dir.path() / "missing.ply");
  ASSERT_FALSE(read);
  EXPECT_EQ(read.error().detail, "open missing.ply: No such file or directory");
}

TEST(File, a_full_disk_is_storage_full) {
  const std::vector<uint8_t> bytes(4096, 7);
  const Status written = write_file("/dev/full", bytes);
  ASSERT_FALSE(written);
  EXPECT_EQ(written.error().code, ErrorCode::kStorageFull);
  EXPECT_EQ(written.error().detail, "write file: No space left on device");
}

TEST(File, errors_other_than_a_full_disk_are_internal) {
  errno = EIO;
  EXPECT_EQ(errno_error("read", "/some/where/x").code, ErrorCode::kInternal);
  errno = EDQUOT;
  EXPECT_EQ(errno_error("write", "/some/where/x").code, ErrorCode::kStorageFull);
}

}  // namespace
}  // namespace voxeld
