#include "server/store/held_files.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <unistd.h>

#include <cstdint>
#include <filesystem>
#include <string>
#include <utility>
#include <vector>

#include "server/base/disk/file.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

constexpr int64_t kMegabyte = int64_t{1} << 20;

class HeldFilesTest : public ::testing::Test {
 protected:
  std::filesystem::path path(const std::string& name) const { return dir_.path() / name; }
  void make(const std::string& name) const {
    ASSERT_TRUE(write_file(path(name), std::vector<uint8_t>(kMegabyte, 7)));
  }
  UniqueFd open(const std::string& name) const {
    return UniqueFd(::open(path(name).c_str(), O_RDONLY | O_CLOEXEC));
  }
  const testing::TemporaryDir dir_;
  HeldFiles files_;
};

TEST_F(HeldFilesTest, a_deleted_file_counts_for_who_reads_it_until_that_ends) {
  make("a");
  const UniqueFd first = open("a"), second = open("a");
  {
    const auto one = files_.add("lab", first.get()), same = files_.add("lab", second.get());
    const auto other = files_.add("studio", second.get());
    EXPECT_EQ(files_.bytes("lab"), 0) << "it is there";
    EXPECT_FALSE(is_deleted(first.get()));
    ASSERT_EQ(::unlink(path("a").c_str()), 0);
    EXPECT_TRUE(is_deleted(first.get()));
    EXPECT_GE(files_.bytes("lab"), kMegabyte);
    EXPECT_LT(files_.bytes("lab"), 2 * kMegabyte) << "once";
    EXPECT_EQ(files_.bytes("studio"), files_.bytes("lab"));
    EXPECT_EQ(files_.bytes("nobody"), 0);
  }
  EXPECT_EQ(files_.bytes("lab"), 0);
}

TEST_F(HeldFilesTest, files_add_up_and_a_moved_hold_ends_once) {
  std::vector<UniqueFd> open_files;
  std::vector<HeldFiles::Hold> holds;
  for (const char* name : {"a", "b", "c"}) {
    make(name);
    open_files.push_back(open(name));
    holds.push_back(files_.add("lab", open_files.back().get()));
    ASSERT_EQ(::unlink(path(name).c_str()), 0);
  }
  EXPECT_GE(files_.bytes("lab"), 3 * kMegabyte);
  HeldFiles::Hold moved = std::move(holds.back());
  holds.pop_back();
  EXPECT_GE(files_.bytes("lab"), 3 * kMegabyte);
  moved = {};
  EXPECT_LT(files_.bytes("lab"), 3 * kMegabyte);
  holds.clear();
  EXPECT_EQ(files_.bytes("lab"), 0);
}

}  // namespace
}  // namespace voxeld
