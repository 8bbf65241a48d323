// A database that is not the one of the blobs, in each way that it can come to that.
#include "server/jobs/retention/store_identity.h"

#include <gtest/gtest.h>

#include <filesystem>
#include <fstream>
#include <string>

#include "server/jobs/database/sqlite_connection.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

class StoreIdentityTest : public ::testing::Test {
 protected:
  void put_blob(const std::string& text) {
    auto writer = blobs_.begin(1 << 20);
    ASSERT_TRUE(writer);
    ASSERT_TRUE(writer->append({reinterpret_cast<const uint8_t*>(text.data()), text.size()}));
    ASSERT_TRUE(writer->finish());
  }
  static void commit(const StoreDatabase& store, const std::string& asset) {
    ASSERT_TRUE(store.database->write([&](SqlConnection& connection) {
      return connection.run(
          "INSERT INTO assets (tenant, id, filename, content_type, bytes,"
          " created_ms) VALUES ('', $1, '', '', 1, 1)",
          asset);
    }));
  }
  Result<StoreDatabase> open(StoreMatch match = StoreMatch::kRequired) {
    return open_store_database(blobs_, match);
  }
  // A store with a blob, whose database went through `commits`.
  void make(int commits = 1) {
    const auto store = open().value();
    for (int i = 0; i < commits; ++i) commit(store, std::to_string(i));
    put_blob("mesh");
  }
  void remove_database() {
    for (const char* name : {"jobs.sqlite", "jobs.sqlite-wal", "jobs.sqlite-shm"}) {
      fs::remove(dir_.path() / name);
    }
  }
  std::string remedy() const {
    const std::string dir = dir_.path().string();
    return ". Put back the database of these files (jobs.sqlite and, where there is one,"
           " jobs.sqlite-wal); or run voxeld doctor --rebuild --data " +
           dir +
           "; or start once with --adopt, which moves files that the database does not know"
           " to " +
           dir + "/quarantine: ";
  }
  void expect_refused(const std::string& what, const std::string& numbers) {
    const auto refused = open();
    ASSERT_FALSE(refused);
    EXPECT_EQ(refused.error().code, ErrorCode::kConflict);
    EXPECT_EQ(refused.error().message(), what + remedy() + numbers);
  }
  std::string mark_id() const { return StoreMarkFile::open(mark_path()).value()->mark().id; }
  fs::path mark_path() const { return StoreMarkFile::path_in(dir_.path()); }
  fs::path database() const { return dir_.path() / "jobs.sqlite"; }
  void expect_matches_after_adopting() {
    ASSERT_TRUE(open(StoreMatch::kAdopt));
    EXPECT_TRUE(open());
  }
  std::string missing_text() const {
    return database().string() + " is missing or new, but " + (dir_.path() / "blobs").string() +
           " holds 1 files";
  }
  testing::TemporaryDir dir_;
  BlobStore blobs_ = BlobStore::open(dir_.path()).value();
};

TEST_F(StoreIdentityTest, the_mark_follows_every_commit_that_changes_rows) {
  const auto store = open().value();
  const int64_t before = store.mark->mark().generation;
  commit(store, "a");
  commit(store, "b");
  EXPECT_EQ(store.mark->mark().generation, before + 2);
  ASSERT_TRUE(store.database->write([](SqlConnection&) { return Status(); }));
  EXPECT_EQ(store.mark->mark().generation, before + 2) << "nothing was changed";
}

TEST_F(StoreIdentityTest, the_right_database_is_opened_again_and_again) {
  make(3);
  EXPECT_TRUE(open());
  EXPECT_TRUE(open());
}

TEST_F(StoreIdentityTest, a_removed_database_is_refused_and_no_new_one_is_made) {
  make();
  remove_database();
  expect_refused(missing_text(),
                 "expected the database of store " + mark_id() + ", got none that names any file");
  EXPECT_FALSE(fs::exists(database()));
  expect_matches_after_adopting();
}

TEST_F(StoreIdentityTest, an_empty_file_in_the_place_of_the_database_is_refused) {
  make();
  remove_database();
  std::ofstream(database()).close();
  expect_refused(missing_text(),
                 "expected the database of store " + mark_id() + ", got none that names any file");
  expect_matches_after_adopting();
}

TEST_F(StoreIdentityTest, a_database_without_any_table_is_refused) {
  make();
  remove_database();
  ASSERT_TRUE(SqliteConnection::open(database(), SqliteConnection::Role::kWriter)
                  .value()
                  .run_script("PRAGMA user_version=0; CREATE TABLE other (x); DROP TABLE other;"));
  expect_refused(missing_text(),
                 "expected the database of store " + mark_id() + ", got none that names any file");
  expect_matches_after_adopting();
}

TEST_F(StoreIdentityTest, an_older_copy_is_refused) {
  make(2);
  fs::copy_file(database(), dir_.path() / "copy");
  int64_t later = 0;
  {
    const auto store = open().value();
    commit(store, "later");
    later = store.mark->mark().generation;
  }
  remove_database();
  fs::rename(dir_.path() / "copy", database());
  expect_refused(
      database().string() + " is older than the files: a copy, or its jobs.sqlite-wal was removed",
      "expected generation " + std::to_string(later) + " or higher, got " +
          std::to_string(later - 1));
  expect_matches_after_adopting();
}

TEST_F(StoreIdentityTest, a_database_whose_wal_was_removed_is_refused) {
  make(2);
  const fs::path killed = dir_.path() / "killed";
  {
    const auto store = open().value();  // copied while it is open: as a killed process leaves it
    commit(store, "in the log alone");
    fs::copy_file(database(), killed);
  }
  remove_database();
  fs::rename(killed, database());
  const auto refused = open();
  ASSERT_FALSE(refused);
  EXPECT_NE(refused.error().detail.find("its jobs.sqlite-wal was removed"), std::string::npos)
      << refused.error().message();
}

TEST_F(StoreIdentityTest, the_database_of_another_store_is_refused) {
  make();
  testing::TemporaryDir other;
  std::string other_id;
  {
    const auto store =
        open_store_database(BlobStore::open(other.path()).value(), StoreMatch::kRequired).value();
    for (int i = 0; i < 5; ++i) commit(store, std::to_string(i));
    other_id = store.mark->mark().id;
  }
  remove_database();
  fs::rename(other.path() / "jobs.sqlite", database());
  expect_refused(database().string() + " is the database of other files",
                 "expected store " + mark_id() + ", got store " + other_id);
  expect_matches_after_adopting();
}

TEST_F(StoreIdentityTest, blobs_without_their_mark_are_refused) {
  make();
  const std::string id = mark_id();
  fs::remove(mark_path());
  expect_refused(mark_path().string(), "expected the mark of store " + id + ", got no file");
  std::ofstream(mark_path()) << "broken";
  expect_refused(mark_path().string(),
                 "expected \"voxeld store 1\", an id of 32 hex digits, and generation, kept_ms"
                 " and wall_ms of 19 digits, got 6 bytes");
  expect_matches_after_adopting();
}

TEST_F(StoreIdentityTest, without_blobs_any_database_will_do) {
  ASSERT_TRUE(open());
  remove_database();
  EXPECT_TRUE(open());
  fs::remove(mark_path());
  EXPECT_TRUE(open());
  put_blob("mesh");
  EXPECT_TRUE(open());
}

}  // namespace
}  // namespace voxeld
