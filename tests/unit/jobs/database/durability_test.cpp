// Which changes sync the disk before they return. The functions of the C library are replaced for
// the whole program, so that also SQLite's calls are counted.
#include <gtest/gtest.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <atomic>
#include <cstdint>
#include <functional>
#include <string>
#include <string_view>

#include "server/base/disk/file.h"
#include "server/jobs/database/sqlite_database.h"
#include "server/store/blob_store.h"
#include "tests/unit/base/temporary_dir.h"

namespace {
std::atomic<int> syncs{0};
}

extern "C" int fsync(int fd) {
  ++syncs;
  return static_cast<int>(::syscall(SYS_fsync, fd));
}
extern "C" int fdatasync(int fd) {
  ++syncs;
  return static_cast<int>(::syscall(SYS_fdatasync, fd));
}

namespace voxeld {
namespace {

int syncs_of(const std::function<Status()>& change) {
  const int before = syncs;
  const Status status = change();
  EXPECT_TRUE(status) << status.error().message();
  return syncs - before;
}

TEST(Durability, a_commit_that_is_durable_soon_waits_for_no_disk) {
  const testing::TemporaryDir dir;
  const auto database = SqliteDatabase::open(dir.path() / "jobs.sqlite").value();
  ASSERT_TRUE(database->write([](SqlConnection& c) {
    return c.run("INSERT INTO store (only_one, id, generation) VALUES (1, 'a', 1)");
  }));
  int64_t told = 0;
  database->tell_generation([&](int64_t generation) { told = generation; });
  const auto change = [&](Durability durability) {
    return syncs_of([&] {
      return database->write([](SqlConnection& c) { return c.run("UPDATE store SET id = 'b'"); },
                             durability);
    });
  };
  EXPECT_GT(change(Durability::kNow), 0);
  const int64_t durable = told;
  EXPECT_EQ(change(Durability::kSoon), 0);
  EXPECT_EQ(change(Durability::kSoon), 0);
  EXPECT_EQ(told, durable) << "the mark beside the blobs would be ahead after a loss of power";
  EXPECT_GT(syncs_of([&] { return database->sync(); }), 0);
  EXPECT_GT(told, durable);
  EXPECT_EQ(syncs_of([&] { return database->sync(); }), 0) << "all is durable";
  EXPECT_EQ(change(Durability::kSoon), 0);
  // Nothing of its own to sync, but the one before.
  EXPECT_GT(syncs_of([&] { return database->write([](SqlConnection&) { return Status(); }); }), 0);
}

class BlobDurability : public ::testing::Test {
 protected:
  BlobInfo put(std::string_view text, Durability durability) {
    auto writer = store_.begin(100, durability).value();
    EXPECT_TRUE(writer.append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return writer.finish().value();
  }
  BlobInfo adopt(std::string_view text, Durability durability) {
    const auto file = dir_.path() / "output";
    EXPECT_TRUE(write_file(file, {reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    return store_.adopt(file, durability).value();
  }
  int syncs_of_sync() {
    return syncs_of([&] { return store_.sync(); });
  }
  const testing::TemporaryDir dir_;
  BlobStore store_ = BlobStore::open(dir_.path() / "data").value();
};

TEST_F(BlobDurability, blobs_are_synced_at_once_or_by_sync) {
  int before = syncs;
  put("a", Durability::kNow);
  adopt("b", Durability::kNow);
  EXPECT_EQ(syncs - before, 4) << "two files and their folders";
  before = syncs;
  const BlobInfo c = put("c", Durability::kSoon), d = adopt("d", Durability::kSoon);
  EXPECT_EQ(syncs, before);
  EXPECT_TRUE(store_.verified(c.id) && store_.verified(d.id));
  EXPECT_EQ(syncs_of_sync(), 4);
  EXPECT_EQ(syncs_of_sync(), 0);
}

// Power loss would take the new file, and with it what an upload was acknowledged with.
TEST_F(BlobDurability, a_durable_file_is_not_replaced_by_one_that_is_not) {
  const BlobInfo kept = put("kept", Durability::kNow);
  const auto inode = [&] {
    struct stat info {};
    EXPECT_EQ(::stat(store_.path_of(kept.id).c_str(), &info), 0);
    return info.st_ino;
  };
  const auto durable = inode();
  put("kept", Durability::kSoon);
  adopt("kept", Durability::kSoon);
  EXPECT_EQ(inode(), durable);
  put("kept", Durability::kNow);
  EXPECT_NE(inode(), durable);
  const std::string_view torn = "kep";
  ASSERT_TRUE(write_file(store_.path_of(kept.id),
                         {reinterpret_cast<const uint8_t*>(torn.data()), torn.size()}));
  put("kept", Durability::kSoon);
  EXPECT_EQ(store_.verified(kept.id).value().bytes, 4);
}

TEST_F(BlobDurability, what_is_gone_needs_no_sync) {
  std::string id;
  {
    const BlobInfo blob = put("short-lived", Durability::kSoon);
    id = blob.id;
  }
  ASSERT_TRUE(store_.remove(id));
  EXPECT_EQ(syncs_of_sync(), 0);
}

}  // namespace
}  // namespace voxeld
