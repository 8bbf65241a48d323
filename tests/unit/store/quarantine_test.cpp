#include "server/store/quarantine.h"

#include <fcntl.h>
#include <gtest/gtest.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <cerrno>
#include <filesystem>
#include <string>

#include "server/base/sha256.h"
#include "server/store/blob_store.h"
#include "tests/unit/base/temporary_dir.h"

namespace {

bool has_links = true;

}  // namespace

// In the place of libc's for the whole test program.
extern "C" int link(const char* from, const char* to) noexcept {
  if (has_links) return static_cast<int>(::syscall(SYS_linkat, AT_FDCWD, from, AT_FDCWD, to, 0));
  errno = EPERM;
  return -1;
}

namespace voxeld {
namespace {

namespace fs = std::filesystem;

class QuarantineTest : public ::testing::Test {
 protected:
  std::string put(std::string_view text) {
    auto writer = store_.begin(1 << 20);
    EXPECT_TRUE(writer);
    EXPECT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return writer->finish().value().id;
  }
  testing::TemporaryDir dir_;
  BlobStore store_ = BlobStore::open(dir_.path()).value();
  Quarantine quarantine_{dir_.path()};
};

TEST_F(QuarantineTest, a_blob_lies_in_the_folder_of_its_day_and_comes_back) {
  const std::string id = put("text");
  ASSERT_TRUE(store_.quarantine(id, "2026-11-22"));
  EXPECT_FALSE(store_.stat(id));
  EXPECT_EQ(store_.bytes(), 0);
  EXPECT_TRUE(fs::exists(dir_.path() / "quarantine/2026-11-22" / id));
  EXPECT_EQ(store_.quarantine(id, "2026-11-22").error().code, ErrorCode::kNotFound);
  const auto listed = quarantine_.list().value();
  ASSERT_EQ(listed.size(), 1u);
  EXPECT_EQ(listed[0].id, id);
  ASSERT_TRUE(store_.restore(listed[0]));
  EXPECT_EQ(store_.stat(id).value().bytes, 4);
  EXPECT_EQ(store_.bytes(), 4);
  EXPECT_TRUE(quarantine_.list().value().empty());
}

TEST_F(QuarantineTest, where_the_bytes_were_uploaded_again_the_copy_goes) {
  const std::string id = put("text");
  ASSERT_TRUE(store_.quarantine(id, "2026-11-22"));
  put("text");
  ASSERT_TRUE(store_.restore(quarantine_.list().value().at(0)));
  EXPECT_EQ(store_.bytes(), 4);
  EXPECT_TRUE(store_.stat(id));
  EXPECT_TRUE(quarantine_.list().value().empty());
}

TEST_F(QuarantineTest, blobs_come_back_on_a_file_system_without_links_too) {
  const std::string lost = put("lost"), again = put("again");
  for (const std::string& id : {lost, again}) ASSERT_TRUE(store_.quarantine(id, "2026-11-22"));
  put("again");
  has_links = false;
  const auto listed = quarantine_.list().value();
  for (const QuarantinedBlob& blob : listed) {
    const Status restored = store_.restore(blob);
    EXPECT_TRUE(restored) << restored.error().message();
  }
  has_links = true;
  EXPECT_EQ(store_.bytes(), 4 + 5);
  EXPECT_TRUE(store_.stat(lost));
  EXPECT_TRUE(store_.stat(again));
  EXPECT_TRUE(quarantine_.list().value().empty());
}

TEST_F(QuarantineTest, what_is_pinned_is_not_taken) {
  auto writer = store_.begin(10);
  ASSERT_TRUE(writer);
  const BlobInfo pinned = writer->finish().value();
  EXPECT_EQ(store_.quarantine(pinned.id, "2026-11-22").error().code, ErrorCode::kConflict);
}

TEST_F(QuarantineTest, days_before_the_last_one_go_and_other_folders_stay) {
  for (const char* day : {"2026-11-14", "2026-11-15", "2026-12-01"}) {
    ASSERT_TRUE(store_.quarantine(put(day), day));
  }
  fs::create_directories(dir_.path() / "quarantine/kept-by-hand/folder");
  EXPECT_EQ(quarantine_.remove_before("2026-11-15").value(), 1);
  EXPECT_FALSE(fs::exists(dir_.path() / "quarantine/2026-11-14"));
  EXPECT_TRUE(fs::exists(dir_.path() / "quarantine/2026-11-15"));
  EXPECT_TRUE(fs::exists(dir_.path() / "quarantine/kept-by-hand/folder"));
  EXPECT_EQ(quarantine_.list().value().size(), 2u);
}

TEST(QuarantineDays, are_those_of_utc) {
  EXPECT_EQ(day_text(0), "1970-01-01");
  EXPECT_EQ(day_text(1'795'996'799'999), "2026-11-29");
}

}  // namespace
}  // namespace voxeld
