#include "server/jobs/database/sqlite_database.h"

#include <gtest/gtest.h>
#include <unistd.h>

#include <atomic>
#include <chrono>
#include <fstream>
#include <new>
#include <stdexcept>
#include <string>
#include <thread>
#include <vector>

#include "server/jobs/database/tables.h"
#include "server/jobs/records/job_rows.h"
#include "tests/unit/base/temporary_dir.h"

namespace voxeld {
namespace {

class SqliteDatabaseTest : public ::testing::Test {
 protected:
  std::unique_ptr<Database> open() {
    auto database = SqliteDatabase::open(path());
    EXPECT_TRUE(database) << database.error().message();
    return *std::move(database);
  }
  std::filesystem::path path() const { return dir_.path() / "jobs.sqlite"; }
  static Status add_key(SqlConnection& connection, const std::string& key) {
    return connection.run(
        "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, job_id, created_ms)"
        " VALUES ('', $1, 'h', 'j', $2)",
        key, int64_t{1});
  }
  static int64_t count_keys(Database& database) {
    auto reader = database.read();
    EXPECT_TRUE(reader);
    auto rows = (*reader)->query("SELECT COUNT(*) FROM idempotency_keys");
    EXPECT_TRUE(rows && rows->step());
    return rows->int64(0);
  }
  testing::TemporaryDir dir_;
};

TEST_F(SqliteDatabaseTest, a_committed_write_is_seen_by_readers_and_after_reopening) {
  {
    auto database = open();
    ASSERT_TRUE(database->write([](SqlConnection& c) { return add_key(c, "a"); }));
    EXPECT_EQ(count_keys(*database), 1);
  }
  EXPECT_EQ(count_keys(*open()), 1);
}

TEST_F(SqliteDatabaseTest, the_file_becomes_short_again_once_rows_are_removed) {
  auto database = open();
  const auto file_bytes = [&] { return std::filesystem::file_size(path()); };
  ASSERT_TRUE(database->write([](SqlConnection& c) -> Status {
    for (int i = 0; i < 4000; ++i) {
      VOXELD_TRY(add_key(c, std::string(3000, 'k') + std::to_string(i)));
    }
    return {};
  }));
  ASSERT_TRUE(database->write([](SqlConnection& c) { return add_key(c, "kept"); }));
  ASSERT_TRUE(database->write([](SqlConnection& c) {
    return c.run("DELETE FROM idempotency_keys WHERE idempotency_key <> 'kept'");
  }));
  EXPECT_GT(file_bytes(), 20'000'000U);
  int64_t freed = 0;
  int calls = 0;
  while (true) {
    const auto bytes = database->reclaim();
    ASSERT_TRUE(bytes) << bytes.error().message();
    if (*bytes == 0) break;
    freed += *bytes;
    ++calls;
  }
  EXPECT_GT(freed, 20'000'000);
  EXPECT_GT(calls, 3) << "others can write in between";
  EXPECT_LT(file_bytes(), 3'000'000U);
  EXPECT_LE(std::filesystem::file_size(path().string() + "-wal"), 9U << 20);
  EXPECT_EQ(count_keys(*database), 1);
}

TEST_F(SqliteDatabaseTest, parameters_bind_by_their_number_not_by_their_place) {
  auto database = open();
  auto reader = database->read();
  ASSERT_TRUE(reader);
  auto row = (*reader)->query("SELECT $2, $1, $2", std::string("one"), int64_t{2});
  ASSERT_TRUE(row && row->step());
  EXPECT_EQ(row->int64(0), 2);
  EXPECT_EQ(row->text(1), "one");
  EXPECT_EQ(row->int64(2), 2);
}

TEST_F(SqliteDatabaseTest, an_operation_that_fails_undoes_its_own_changes_alone) {
  auto database = open();
  std::vector<std::thread> threads;
  std::atomic<int> refused{0};
  for (int i = 0; i < 40; ++i) {
    threads.emplace_back([&, i] {
      const Status status = database->write([&](SqlConnection& c) -> Status {
        VOXELD_TRY(add_key(c, "key " + std::to_string(i)));
        if (i % 4 == 0) return Error{ErrorCode::kConflict, "no", "", ""};
        return {};
      });
      EXPECT_EQ(status.ok(), i % 4 != 0);
      if (!status) {
        EXPECT_EQ(status.error().code, ErrorCode::kConflict);
        ++refused;
      }
    });
  }
  for (auto& thread : threads) thread.join();
  EXPECT_EQ(refused, 10);
  EXPECT_EQ(count_keys(*database), 30);
}

TEST_F(SqliteDatabaseTest, an_exception_in_an_operation_is_an_error) {
  auto database = open();
  const Status status =
      database->write([](SqlConnection&) -> Status { throw std::runtime_error("thrown"); });
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().detail, "job database: thrown");
  EXPECT_TRUE(database->write([](SqlConnection& c) { return add_key(c, "after"); }));
}

TEST_F(SqliteDatabaseTest, an_exception_after_the_commit_does_not_report_the_write_as_undone) {
  auto database = open();
  ASSERT_TRUE(database->write([](SqlConnection& c) {
    return c.run("INSERT INTO store (only_one, id, generation) VALUES (1, 'a', 1)");
  }));
  int told = 0;
  database->tell_generation([&](int64_t) {
    ++told;
    throw std::bad_alloc();
  });
  EXPECT_TRUE(database->write([](SqlConnection& c) { return add_key(c, "kept"); }));
  EXPECT_EQ(told, 1);
  EXPECT_EQ(count_keys(*database), 1);
}

TEST_F(SqliteDatabaseTest, readers_cannot_write) {
  auto database = open();
  auto reader = database->read();
  ASSERT_TRUE(reader);
  EXPECT_FALSE(add_key(**reader, "x"));
}

// The number of descriptors of this process on the file with that name.
int descriptors_on(const std::filesystem::path& file) {
  int count = 0;
  for (const auto& entry : std::filesystem::directory_iterator("/proc/self/fd")) {
    std::error_code gone;
    count += std::filesystem::read_symlink(entry.path(), gone) == file ? 1 : 0;
  }
  return count;
}

TEST_F(SqliteDatabaseTest, extra_reader_connections_are_closed_when_unused) {
  constexpr int kCrowd = 40;
  const std::filesystem::path log = path().string() + "-wal";
  const auto use_many = [](Database& database) {
    std::vector<Database::Lease> leases;
    for (int i = 0; i < kCrowd; ++i) {
      auto reader = database.read();
      ASSERT_TRUE(reader) << reader.error().message();
      auto rows = (*reader)->query("SELECT COUNT(*) FROM idempotency_keys");
      ASSERT_TRUE(rows && rows->step());
      leases.push_back(*std::move(reader));
    }
  };
  {
    const auto database = SqliteDatabase::open(path(), std::chrono::hours(1)).value();
    ASSERT_TRUE(database->write([](SqlConnection& c) { return add_key(c, "a"); }));
    use_many(*database);
    EXPECT_EQ(descriptors_on(log), kCrowd + 1) << "they stay open for the next crowd";
  }
  const auto database = SqliteDatabase::open(path(), std::chrono::milliseconds(0)).value();
  use_many(*database);
  const int on_file = descriptors_on(path());
  EXPECT_EQ(descriptors_on(log), 1 + 1) << "the writer's and that of the last use";
  use_many(*database);
  EXPECT_EQ(descriptors_on(path()), on_file) << "SQLite reuses its open descriptors";
}

TEST_F(SqliteDatabaseTest, a_full_disk_is_storage_full_and_the_database_goes_on) {
  auto database = open();
  ASSERT_TRUE(
      database->write([](SqlConnection& c) { return c.run("PRAGMA max_page_count = 40"); }));
  Status status;
  for (int i = 0; status.ok() && i < 1000; ++i) {
    status = database->write(
        [&](SqlConnection& c) { return add_key(c, std::to_string(i) + std::string(4000, 'x')); });
  }
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kStorageFull);
  EXPECT_EQ(status.error().detail,
            "job database cannot grow, the disk is full: run: database or disk is full");
  ASSERT_TRUE(
      database->write([](SqlConnection& c) { return c.run("PRAGMA max_page_count = 1000000"); }));
  EXPECT_TRUE(database->write([](SqlConnection& c) { return add_key(c, "space again"); }));
}

TEST_F(SqliteDatabaseTest, a_file_that_is_no_database_is_refused) {
  std::ofstream(path()) << "this is not a database, whatever its name says, and long enough";
  const auto database = SqliteDatabase::open(path());
  ASSERT_FALSE(database);
  EXPECT_EQ(database.error().code, ErrorCode::kInternal);
  EXPECT_EQ(database.error().detail,
            "job database is corrupt; put back a copy and start once with --adopt, or move "
            "jobs.sqlite and jobs.sqlite-wal away and run voxeld doctor --rebuild: run: file is "
            "not a database");
}

TEST_F(SqliteDatabaseTest, a_file_that_cannot_be_written_is_refused_with_its_name) {
  open().reset();
  namespace fs = std::filesystem;
  fs::permissions(path(), fs::perms{0444});
  fs::permissions(dir_.path(), fs::perms{0755});
  constexpr uid_t kNobody = 65534;
  const bool is_root = ::geteuid() == 0;  // who may write all
  ASSERT_TRUE(!is_root || ::seteuid(kNobody) == 0);
  const auto refused = SqliteDatabase::open(path());
  ASSERT_TRUE(!is_root || ::seteuid(0) == 0);
  ASSERT_FALSE(refused);
  EXPECT_EQ(refused.error().detail, "job database: cannot write to " + path().string());
}

TEST_F(SqliteDatabaseTest, a_damaged_database_is_refused_at_start) {
  {
    auto database = open();
    ASSERT_TRUE(database->write([](SqlConnection& c) -> Status {
      for (int i = 0; i < 500; ++i) {
        VOXELD_TRY(add_key(c, std::to_string(i) + std::string(200, 'k')));
      }
      return {};
    }));
  }
  {
    std::fstream file(path(), std::ios::in | std::ios::out | std::ios::binary);
    const auto size = static_cast<std::streamoff>(std::filesystem::file_size(path()));
    const std::string garbage(4096, '\x5a');
    for (std::streamoff at = 4096 * 8; at + 4096 < size; at += 4096 * 3) {
      file.seekp(at);
      file.write(garbage.data(), static_cast<std::streamsize>(garbage.size()));
    }
  }
  const auto database = SqliteDatabase::open(path());
  ASSERT_FALSE(database);
  EXPECT_NE(database.error().detail.find("job database is corrupt"), std::string::npos)
      << database.error().message();
}

TEST_F(SqliteDatabaseTest, a_tenants_list_of_one_state_reads_no_job_of_another_state) {
  const auto database = open();
  auto reader = database->read();
  ASSERT_TRUE(reader);
  for (const std::string order : {"< $1 ORDER BY j.seq DESC", "> $1 ORDER BY j.seq"}) {
    auto plan = (*reader)->query(
        "EXPLAIN QUERY PLAN SELECT j.id, r.blob FROM jobs j LEFT JOIN results r ON r.seq ="
        " j.result_seq WHERE j.tenant = $2 AND j.state = $3 AND j.seq " +
            order,
        int64_t{7}, "lab", "queued");
    ASSERT_TRUE(plan && plan->step());
    EXPECT_NE(plan->text(3).find("jobs_by_tenant_and_state (tenant=? AND state=? AND seq"),
              std::string::npos)
        << plan->text(3);
  }
}

TEST_F(SqliteDatabaseTest, a_database_with_another_schema_is_refused) {
  {
    auto database = open();
    ASSERT_TRUE(
        database->write([](SqlConnection& c) { return c.run("PRAGMA user_version = 999"); }));
  }
  const auto database = SqliteDatabase::open(path());
  ASSERT_FALSE(database);
  EXPECT_EQ(database.error().message(),
            "job database was written by another voxeld: schema version: expected " +
                std::to_string(schema_version()) + ", got 999");
}

}  // namespace
}  // namespace voxeld
