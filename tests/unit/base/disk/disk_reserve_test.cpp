#include "server/base/disk/disk_reserve.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <unistd.h>

#include <array>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"
#include "server/base/disk/replace_file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

constexpr int64_t kReserve = 20'000'000;
int64_t free_now = 0;

// Free bytes as the test says, less what the file has allocated.
int64_t scripted(int fd) {
  struct stat info {};
  if (::fstat(fd, &info) != 0 || !S_ISREG(info.st_mode)) return -1;
  return free_now - static_cast<int64_t>(info.st_blocks) * 512;
}

class DiskReserveTest : public ::testing::Test {
 protected:
  void SetUp() override { keep_disk_reserve(kReserve, scripted); }
  void TearDown() override { keep_disk_reserve(0); }
  Status write(int64_t bytes) {
    return write_all(file_.get(), std::vector<uint8_t>(static_cast<size_t>(bytes), 7));
  }
  int64_t allocated() const {
    struct stat info {};
    EXPECT_EQ(::fstat(file_.get(), &info), 0);
    return static_cast<int64_t>(info.st_blocks) * 512;
  }

  testing::TemporaryDir dir_;
  UniqueFd file_{::open((dir_.path() / "file").c_str(), O_RDWR | O_CREAT | O_CLOEXEC, 0600)};
};

TEST_F(DiskReserveTest, what_fits_beside_the_reserve_is_written_and_no_more) {
  free_now = kReserve + 3'000'000;
  EXPECT_TRUE(write(100'000));
  EXPECT_TRUE(write(2'000'000)) << "allocated first";
  const int64_t before = allocated();
  const Status refused = write(2'000'000);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kStorageFull);
  EXPECT_EQ(refused.error().detail,
            "the disk is nearly full; outputs are refused, delete something");
  EXPECT_EQ(refused.error().expected, "at least 20000000 bytes free beside 2000000");
  EXPECT_EQ(allocated(), before) << "nothing of it was written";
  EXPECT_TRUE(write(100'000)) << "what is shorter still fits";
}

TEST_F(DiskReserveTest, below_the_reserve_nothing_is_written) {
  free_now = kReserve - 1;
  EXPECT_FALSE(write(1));
  EXPECT_FALSE(write(2'000'000));
  EXPECT_FALSE(write_file(dir_.path() / "other", std::vector<uint8_t>(10)));
  EXPECT_EQ(allocated(), 0);
}

TEST_F(DiskReserveTest, a_file_that_could_not_be_replaced_stays_and_nothing_is_left_beside_it) {
  const std::filesystem::path path = dir_.path() / "folder" / "a.json";
  free_now = 2 * kReserve;
  ASSERT_TRUE(replace_file(path, "old"));
  free_now = kReserve - 1;
  const Status refused = replace_file(path, "new");
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().code, ErrorCode::kStorageFull);
  EXPECT_EQ(*directory_names(path.parent_path()), std::vector<std::string>{"a.json"});
  EXPECT_EQ(*read_file(path), (std::vector<uint8_t>{'o', 'l', 'd'}));
}

// Another process allocates between the two checks.
TEST_F(DiskReserveTest, room_that_another_process_got_first_is_given_back) {
  static int looks = 0;
  looks = 0;
  keep_disk_reserve(kReserve, [](int) { return ++looks == 1 ? 2 * kReserve : kReserve - 1; });
  EXPECT_FALSE(write(2'000'000));
  EXPECT_EQ(looks, 2);
  EXPECT_EQ(allocated(), 0);
}

TEST_F(DiskReserveTest, room_of_an_output_is_reserved_before_its_bytes_come) {
  free_now = kReserve + 10'000'000;
  ASSERT_TRUE(reserve_room(file_.get(), 0, 8'000'000));
  EXPECT_GE(allocated(), 8'000'000);
  struct stat info {};
  ASSERT_EQ(::fstat(file_.get(), &info), 0);
  EXPECT_EQ(info.st_size, 0) << "the file is as long as what is written";
  EXPECT_FALSE(reserve_room(file_.get(), 8'000'000, 8'000'000));
}

TEST_F(DiskReserveTest, a_pipe_has_no_reserve) {
  std::array<int, 2> ends{};
  ASSERT_EQ(::pipe(ends.data()), 0);
  const UniqueFd from(ends[0]), to(ends[1]);
  free_now = 0;
  EXPECT_TRUE(write_all(to.get(), std::vector<uint8_t>(10)));
  EXPECT_LT(free_bytes_at(to.get()), 0);
  EXPECT_GT(free_bytes_at(file_.get()), 0);
}

}  // namespace
}  // namespace voxeld
