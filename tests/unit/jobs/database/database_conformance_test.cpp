// The contract of every implementation of Database, tested through the interface only. A new
// implementation adds a row to kKinds.
#include <gtest/gtest.h>

#include <algorithm>
#include <atomic>
#include <functional>
#include <limits>
#include <memory>
#include <optional>
#include <random>
#include <stdexcept>
#include <string>
#include <string_view>
#include <thread>
#include <vector>

#include "server/jobs/database/database.h"
#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/database/tables.h"
#include "tests/unit/base/temporary_dir.h"
#include "tests/unit/jobs/database/plain_database.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

struct Kind {
  const char* name;
  // Opens the database of the directory, or makes it.
  Result<std::unique_ptr<Database>> (*open)(const fs::path& dir);
  // Leaves no room for more than some rows; false: there is room again.
  Status (*set_full)(Database& database, bool is_full);
};

Status set_pages(Database& database, bool is_full) {
  return database.write([&](SqlConnection& connection) {
    return connection.run(is_full ? "PRAGMA max_page_count = 1" : "PRAGMA max_page_count = 100000");
  });
}

Result<std::unique_ptr<Database>> open_sqlite(const fs::path& dir) {
  VOXELD_ASSIGN(auto opened, SqliteDatabase::open(sqlite_path(dir)));
  return std::unique_ptr<Database>(std::move(opened));
}

Result<std::unique_ptr<Database>> open_plain(const fs::path& dir) {
  return testing::PlainDatabase::open(dir / "plain.sqlite");
}

constexpr Kind kKinds[] = {{"sqlite", open_sqlite, set_pages}, {"plain", open_plain, set_pages}};

const Error kNo{ErrorCode::kConflict, "no", "", ""};

// All rows, columns separated by spaces.
std::vector<std::string> rows_of(SqlConnection& connection, std::string_view sql, int columns) {
  std::vector<std::string> rows;
  auto statement = connection.query(sql);
  EXPECT_TRUE(statement) << statement.error().message();
  while (statement && statement->step().value()) {
    std::string& row = rows.emplace_back(statement->text(0));
    for (int i = 1; i < columns; ++i) row += " " + statement->text(i);
  }
  return rows;
}

Status put_asset(SqlConnection& connection, std::string_view id, int64_t bytes = 1,
                 std::string_view tenant = "lab") {
  return connection.run(
      "INSERT INTO assets (tenant, id, filename, content_type, bytes, created_ms)"
      " VALUES ($1, $2, '', '', $3, 5)",
      tenant, id, bytes);
}

class DatabaseConformance : public ::testing::TestWithParam<Kind> {
 protected:
  void SetUp() override { open(); }
  void open() {
    database_.reset();
    auto opened = GetParam().open(dir_.path());
    ASSERT_TRUE(opened) << opened.error().message();
    database_ = *std::move(opened);
  }
  Status put(std::string_view id, int64_t bytes = 1) {
    return database_->write([&](SqlConnection& c) { return put_asset(c, id, bytes); });
  }
  // The ids of all assets, by id.
  std::vector<std::string> ids() {
    auto reader = database_->read();
    EXPECT_TRUE(reader);
    return rows_of(**reader, "SELECT id FROM assets ORDER BY id", 1);
  }
  void tie_to_store(int64_t generation) {
    ASSERT_TRUE(database_->write([&](SqlConnection& c) {
      return c.run("INSERT INTO store (only_one, id, generation) VALUES (1, 'a', $1)", generation);
    }));
  }
  int64_t generation() {
    auto reader = database_->read();
    EXPECT_TRUE(reader);
    auto row = (*reader)->query("SELECT generation FROM store");
    EXPECT_TRUE(row && row->step().value());
    return row->int64(0);
  }

  testing::TemporaryDir dir_;
  std::unique_ptr<Database> database_;
};

using Rows = std::vector<std::string>;

// --- write()

TEST_P(DatabaseConformance, a_new_database_has_empty_tables) {
  auto reader = database_->read().value();
  for (const char* table :
       {"assets", "bundle_files", "jobs", "job_events", "idempotency_keys", "results", "frames",
        "tenant_usage", "holdings", "live_jobs", "store"}) {
    EXPECT_EQ(rows_of(*reader, "SELECT COUNT(*) FROM " + std::string(table), 1), Rows{"0"})
        << table;
  }
}

TEST_P(DatabaseConformance, a_committed_write_is_seen_at_once_and_after_reopening) {
  ASSERT_TRUE(put("a"));
  EXPECT_EQ(ids(), Rows{"a"});
  open();
  EXPECT_EQ(ids(), Rows{"a"});
}

TEST_P(DatabaseConformance, a_failed_operation_leaves_none_of_its_changes) {
  ASSERT_TRUE(put("a"));
  const Status failed = database_->write([](SqlConnection& c) -> Status {
    VOXELD_TRY(put_asset(c, "b"));
    VOXELD_TRY(c.run("UPDATE assets SET bytes = 7"));
    VOXELD_TRY(c.run("DELETE FROM assets WHERE id = 'a'"));
    return kNo;
  });
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().message(), kNo.message());
  auto reader = database_->read().value();
  EXPECT_EQ(rows_of(*reader, "SELECT id, bytes FROM assets", 2), Rows{"a 1"});
}

TEST_P(DatabaseConformance, an_operation_with_a_failed_statement_leaves_none_of_its_changes) {
  ASSERT_TRUE(put("a"));
  const Status failed = database_->write([](SqlConnection& c) -> Status {
    VOXELD_TRY(put_asset(c, "b"));
    return put_asset(c, "a");  // the key is taken
  });
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, ErrorCode::kInternal);
  EXPECT_EQ(ids(), Rows{"a"});
  EXPECT_TRUE(put("c"));
  EXPECT_EQ(ids(), (Rows{"a", "c"}));
}

TEST_P(DatabaseConformance, an_exception_undoes_its_operation_and_is_an_error) {
  const Status failed = database_->write([](SqlConnection& c) -> Status {
    VOXELD_TRY(put_asset(c, "a"));
    throw std::runtime_error("thrown");
  });
  ASSERT_FALSE(failed);
  EXPECT_EQ(failed.error().code, ErrorCode::kInternal);
  EXPECT_NE(failed.error().detail.find("thrown"), std::string::npos) << failed.error().detail;
  EXPECT_TRUE(put("b"));
  EXPECT_EQ(ids(), Rows{"b"});
}

TEST_P(DatabaseConformance, only_the_failed_ones_of_concurrent_operations_are_rolled_back) {
  constexpr int kThreads = 8, kEach = 10;
  std::atomic<int> refused{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&, t] {
      for (int i = 0; i < kEach; ++i) {
        const std::string id = std::to_string(t) + "-" + std::to_string(i);
        const Status status = database_->write([&](SqlConnection& c) -> Status {
          VOXELD_TRY(put_asset(c, id));
          return (t + i) % 4 == 0 ? Status(kNo) : Status();
        });
        refused += status ? 0 : 1;
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(refused, kThreads * kEach / 4);
  EXPECT_EQ(std::ssize(ids()), kThreads * kEach * 3 / 4);
}

TEST_P(DatabaseConformance, operations_run_one_at_a_time_and_once) {
  constexpr int kThreads = 8, kEach = 15;
  ASSERT_TRUE(put("counter", 0));
  std::atomic<int> inside{0}, runs{0};
  std::vector<std::thread> threads;
  for (int t = 0; t < kThreads; ++t) {
    threads.emplace_back([&] {
      for (int i = 0; i < kEach; ++i) {
        EXPECT_TRUE(database_->write([&](SqlConnection& c) -> Status {
          EXPECT_EQ(++inside, 1);
          ++runs;
          int64_t count = 0;
          {
            VOXELD_ASSIGN(SqlStatement row, c.query("SELECT bytes FROM assets"));
            VOXELD_TRY(row.step());
            count = row.int64(0);
          }
          std::this_thread::yield();
          Status written = c.run("UPDATE assets SET bytes = $1", count + 1);
          --inside;
          return written;
        }));
      }
    });
  }
  for (std::thread& thread : threads) thread.join();
  EXPECT_EQ(runs, kThreads * kEach);
  auto reader = database_->read().value();
  EXPECT_EQ(rows_of(*reader, "SELECT bytes FROM assets", 1),
            Rows{std::to_string(kThreads * kEach)});
}

TEST_P(DatabaseConformance, a_write_with_no_room_is_storage_full_and_loses_nothing) {
  ASSERT_TRUE(put("a"));
  ASSERT_TRUE(GetParam().set_full(*database_, true));
  Status status;
  int64_t written = 0;
  for (; status.ok() && written < 1000; ++written) {
    status = put("b" + std::to_string(written) + std::string(4000, 'x'));
  }
  ASSERT_FALSE(status);
  EXPECT_EQ(status.error().code, ErrorCode::kStorageFull) << status.error().message();
  EXPECT_EQ(std::ssize(ids()), written) << "a, and all that was acknowledged";
  ASSERT_TRUE(GetParam().set_full(*database_, false));
  EXPECT_TRUE(put("c"));
  EXPECT_EQ(std::ssize(ids()), written + 1);
}

// --- read()

TEST_P(DatabaseConformance, a_reader_within_an_operation_sees_committed_rows) {
  ASSERT_TRUE(put("a"));
  ASSERT_TRUE(database_->write([&](SqlConnection& c) -> Status {
    VOXELD_TRY(put_asset(c, "b"));
    EXPECT_EQ(ids(), Rows{"a"});
    EXPECT_EQ(rows_of(c, "SELECT id FROM assets ORDER BY id", 1), (Rows{"a", "b"}));
    return {};
  }));
  EXPECT_EQ(ids(), (Rows{"a", "b"}));
}

TEST_P(DatabaseConformance, a_statement_sees_the_commits_before_its_start) {
  for (const char* id : {"a", "b", "c"}) ASSERT_TRUE(put(id));
  auto reader = database_->read().value();
  {
    auto open = reader->query("SELECT id FROM assets ORDER BY id").value();
    ASSERT_TRUE(open.step().value());
    ASSERT_TRUE(database_->write([](SqlConnection& c) -> Status {
      VOXELD_TRY(c.run("DELETE FROM assets WHERE id = 'b'"));
      return put_asset(c, "d");
    })) << "a reader holds no writer up";
    ASSERT_TRUE(open.step().value());
    EXPECT_EQ(open.text(0), "b");
    ASSERT_TRUE(open.step().value());
    EXPECT_EQ(open.text(0), "c");
    EXPECT_FALSE(open.step().value());
  }
  EXPECT_EQ(rows_of(*reader, "SELECT id FROM assets ORDER BY id", 1), (Rows{"a", "c", "d"}));
}

TEST_P(DatabaseConformance, readers_cannot_write) {
  auto reader = database_->read().value();
  EXPECT_FALSE(put_asset(*reader, "a"));
  EXPECT_TRUE(ids().empty());
}

TEST_P(DatabaseConformance, many_read_at_the_same_time) {
  ASSERT_TRUE(put("a"));
  std::vector<Database::Lease> leases;
  for (int i = 0; i < 20; ++i) {
    auto reader = database_->read();
    ASSERT_TRUE(reader) << reader.error().message();
    leases.push_back(*std::move(reader));
  }
  for (const Database::Lease& lease : leases) {
    EXPECT_EQ(rows_of(*lease, "SELECT id FROM assets", 1), Rows{"a"});
  }
}

// --- generation, room

TEST_P(DatabaseConformance, the_generation_grows_with_commits_that_change_rows) {
  std::vector<int64_t> told;
  database_->tell_generation([&](int64_t generation) { told.push_back(generation); });
  ASSERT_TRUE(put("untied"));
  EXPECT_TRUE(told.empty()) << "it belongs to no store yet";
  tie_to_store(41);
  told.clear();
  const int64_t before = generation();
  ASSERT_TRUE(put("a"));
  ASSERT_TRUE(put("b"));
  ASSERT_EQ(told.size(), 2U);
  EXPECT_GT(told[0], before);
  EXPECT_GT(told[1], told[0]);
  EXPECT_EQ(generation(), told[1]);
  ASSERT_TRUE(database_->write(
      [](SqlConnection& c) { return c.run("UPDATE assets SET bytes = 2 WHERE id = 'none'"); }));
  ASSERT_FALSE(database_->write([](SqlConnection&) -> Status { return kNo; }));
  EXPECT_EQ(told.size(), 2U) << "nothing has changed";
  EXPECT_EQ(generation(), told[1]);
}

TEST_P(DatabaseConformance, a_commit_that_is_durable_soon_is_seen_at_once) {
  const auto put_soon = [&](std::string_view id) {
    return database_->write([&](SqlConnection& c) { return put_asset(c, id); }, Durability::kSoon);
  };
  tie_to_store(7);
  int64_t told = 0;
  database_->tell_generation([&](int64_t generation) { told = generation; });
  ASSERT_TRUE(put_soon("a"));
  EXPECT_EQ(ids(), Rows{"a"});
  ASSERT_TRUE(database_->sync());
  EXPECT_EQ(told, generation());
  ASSERT_TRUE(put_soon("b"));
  EXPECT_FALSE(put_soon("b")) << "an error undoes its own changes alone";
  // A durable commit makes those before it durable, whether or not it changes anything.
  ASSERT_TRUE(database_->write([](SqlConnection&) { return Status(); }));
  EXPECT_EQ(told, generation());
  ASSERT_TRUE(put_soon("c"));
  open();
  EXPECT_EQ(ids(), (Rows{"a", "b", "c"}));
}

TEST_P(DatabaseConformance, an_exception_after_the_commit_does_not_undo_it) {
  tie_to_store(1);
  database_->tell_generation([](int64_t) { throw std::runtime_error("told"); });
  EXPECT_TRUE(put("a"));
  EXPECT_EQ(ids(), Rows{"a"});
}

TEST_P(DatabaseConformance, space_is_made_before_a_write_that_frees) {
  EXPECT_TRUE(database_->write_freeing([](SqlConnection& c) { return put_asset(c, "a"); }));
  for (const bool is_full : {false, true}) {
    int made = 0;
    database_->set_make_way([&] {
      ++made;
      return is_full;
    });
    ASSERT_TRUE(database_->write_freeing([&](SqlConnection& c) {
      EXPECT_EQ(made, 1);
      return c.run("UPDATE assets SET bytes = bytes + 1");
    }));
    EXPECT_EQ(database_->write_freeing([](SqlConnection&) -> Status { return kNo; }).error().code,
              ErrorCode::kConflict);
    EXPECT_EQ(made, 2);
    ASSERT_TRUE(put("other " + std::to_string(static_cast<int>(is_full))));
    EXPECT_EQ(made, 2) << "write() makes none";
  }
  auto reader = database_->read().value();
  EXPECT_EQ(rows_of(*reader, "SELECT bytes FROM assets WHERE id = 'a'", 1), Rows{"3"});
}

TEST_P(DatabaseConformance, reclaiming_room_changes_no_row) {
  for (const char* id : {"a", "b", "c"}) ASSERT_TRUE(put(id));
  ASSERT_TRUE(database_->write(
      [](SqlConnection& c) { return c.run("DELETE FROM assets WHERE id = 'b'"); }));
  tie_to_store(3);
  const int64_t before = generation();
  const auto bytes = database_->reclaim();
  ASSERT_TRUE(bytes) << bytes.error().message();
  EXPECT_GE(*bytes, 0);
  EXPECT_EQ(generation(), before);
  EXPECT_EQ(ids(), (Rows{"a", "c"}));
}

// --- statements

TEST_P(DatabaseConformance, parameters_bind_by_their_number) {
  ASSERT_TRUE(put("a", 3));
  auto reader = database_->read().value();
  auto row = reader
                 ->query(
                     "SELECT id, bytes FROM assets WHERE bytes = $2 AND id = $1"
                     " AND bytes = $2 AND tenant = $3",
                     std::string("a"), int64_t{3}, "lab")
                 .value();
  ASSERT_TRUE(row.step().value());
  EXPECT_EQ(row.text(0), "a");
  EXPECT_EQ(row.int64(1), 3);
  EXPECT_FALSE(row.step().value());
}

TEST_P(DatabaseConformance, values_come_back_as_they_were) {
  const std::vector<std::string> texts = {"",
                                          "plain",
                                          "two\nlines",
                                          "gr\xC3\xB6\xC3\x9F"
                                          "e",
                                          "'quoted' $1 \\",
                                          std::string(100'000, 'x')};
  const std::vector<int64_t> numbers = {0, -1, std::numeric_limits<int64_t>::max(),
                                        std::numeric_limits<int64_t>::min()};
  for (size_t i = 0; i < texts.size(); ++i) {
    ASSERT_TRUE(put(texts[i], numbers[i % numbers.size()]));
    auto reader = database_->read().value();
    auto row = reader->query("SELECT id, bytes FROM assets WHERE id = $1", texts[i]).value();
    ASSERT_TRUE(row.step().value()) << i;
    EXPECT_EQ(row.text(0), texts[i]);
    EXPECT_EQ(row.int64(1), numbers[i % numbers.size()]);
    EXPECT_EQ(row.text(1), std::to_string(numbers[i % numbers.size()]));
    ASSERT_TRUE(database_->write([](SqlConnection& c) { return c.run("DELETE FROM assets"); }));
  }
}

TEST_P(DatabaseConformance, an_empty_text_is_not_null_and_null_reads_as_nothing) {
  ASSERT_TRUE(put(std::string_view()));
  EXPECT_EQ(ids(), Rows{""});
  auto reader = database_->read().value();
  auto row = reader->query("SELECT MAX(bytes), MAX(id) FROM assets WHERE id = 'none'").value();
  ASSERT_TRUE(row.step().value());
  EXPECT_EQ(row.int64(0), 0);
  EXPECT_EQ(row.text(1), "");
}

TEST_P(DatabaseConformance, a_statement_begins_anew_each_time) {
  for (const char* id : {"a", "b", "c"}) ASSERT_TRUE(put(id));
  auto reader = database_->read().value();
  constexpr std::string_view kSql = "SELECT id FROM assets WHERE id > $1 ORDER BY id";
  {
    auto half_read = reader->query(kSql, "a").value();
    ASSERT_TRUE(half_read.step().value());
    EXPECT_EQ(half_read.text(0), "b");
    SqlStatement moved = std::move(half_read);
    ASSERT_TRUE(moved.step().value());
    EXPECT_EQ(moved.text(0), "c");
  }
  auto again = reader->query(kSql, "").value();
  ASSERT_TRUE(again.step().value());
  EXPECT_EQ(again.text(0), "a");
}

TEST_P(DatabaseConformance, wrong_sql_is_an_internal_error) {
  auto reader = database_->read().value();
  EXPECT_EQ(reader->query("SELECT none FROM assets").error().code, ErrorCode::kInternal);
  EXPECT_TRUE(rows_of(*reader, "SELECT id FROM assets", 1).empty()) << "it goes on";
}

TEST_P(DatabaseConformance, text_is_measured_in_characters_and_in_bytes) {
  ASSERT_TRUE(
      put("gr\xC3\xB6\xC3\x9F"
          "e"));
  auto reader = database_->read().value();
  EXPECT_EQ(rows_of(*reader, "SELECT LENGTH(id), OCTET_LENGTH(id) FROM assets", 2), Rows{"5 7"});
}

TEST_P(DatabaseConformance, conflicts_update_or_do_nothing_and_rows_come_back) {
  ASSERT_TRUE(put("a", 1));
  ASSERT_TRUE(database_->write([](SqlConnection& c) -> Status {
    VOXELD_TRY(
        c.run("INSERT INTO assets (tenant, id, filename, content_type, bytes, created_ms)"
              " VALUES ('lab', 'a', '', '', 9, 5) ON CONFLICT (id, tenant) DO NOTHING"));
    EXPECT_EQ(c.changes(), 0);
    VOXELD_ASSIGN(SqlStatement row,
                  c.query("INSERT INTO assets (tenant, id, filename, content_type, bytes,"
                          " created_ms) VALUES ('lab', 'a', '', '', 9, 5)"
                          " ON CONFLICT (id, tenant) DO UPDATE SET bytes = excluded.bytes"
                          " RETURNING id, bytes"));
    EXPECT_TRUE(row.step().value());
    EXPECT_EQ(row.text(0), "a");
    EXPECT_EQ(row.int64(1), 9);
    return {};
  }));
}

TEST_P(DatabaseConformance, changes_are_those_of_the_statement_alone) {
  ASSERT_TRUE(database_->write([](SqlConnection& c) -> Status {
    for (const char* id : {"a", "b", "c"}) VOXELD_TRY(put_asset(c, id));
    EXPECT_EQ(c.changes(), 1) << "rows of holdings do not count";
    VOXELD_TRY(c.run("UPDATE assets SET bytes = 2 WHERE id > 'a'"));
    EXPECT_EQ(c.changes(), 2);
    VOXELD_TRY(c.run("DELETE FROM assets"));
    EXPECT_EQ(c.changes(), 3);
    return {};
  }));
}

// --- tables

Status put_result(SqlConnection& c, const std::string& tenant, const std::string& blob,
                  int64_t text_bytes = 0) {
  return c.run(
      "INSERT INTO results (tenant, request_hash, blob, bytes, media_type, filename, grid,"
      " grid_bytes, meta_json, warnings_json, created_ms)"
      " VALUES ($1, 'h', $2, 3, '', '', $3, 4, $4, '[]', 5)",
      tenant, blob, "grid of " + blob, std::string(static_cast<size_t>(text_bytes), 'm'));
}

Status put_job(SqlConnection& c, const std::string& tenant, const std::string& id,
               const std::string& state, int64_t text_bytes = 0) {
  return c.run(
      "INSERT INTO jobs (id, tenant, kind, state, asset, grid, filename, options_json,"
      " request_hash, use_cache, transient, created_ms)"
      " VALUES ($1, $2, 'voxelize', $3, 'a', '', '', $4, 'h', 1, 0, 5)",
      id, tenant, state, std::string(static_cast<size_t>(text_bytes), 'o'));
}

Status put_frame(SqlConnection& c, const std::string& tenant, const std::string& job,
                 int64_t frame) {
  return c.run(
      "INSERT INTO frames (job_id, frame, tenant, time_s, grid, bytes, voxel_count, content_hash)"
      " VALUES ($1, $2, $3, '0', $4, 6, 1, 'c') ON CONFLICT (job_id, frame) DO UPDATE"
      " SET grid = excluded.grid, bytes = excluded.bytes, expired_ms = 0",
      job, frame, tenant, "frame " + std::to_string(frame % 3));
}

TEST_P(DatabaseConformance, rows_are_numbered_by_arrival_and_numbers_are_not_used_again) {
  const auto last = [&] {
    auto reader = database_->read().value();
    auto row = reader->query("SELECT MAX(seq) FROM results").value();
    EXPECT_TRUE(row.step().value());
    return row.int64(0);
  };
  const auto add = [&] {
    ASSERT_TRUE(database_->write([](SqlConnection& c) { return put_result(c, "lab", "r"); }));
  };
  add();
  const int64_t first = last();
  add();
  const int64_t second = last();
  EXPECT_GT(second, first);
  ASSERT_TRUE(database_->write([](SqlConnection& c) { return c.run("DELETE FROM results"); }));
  open();
  add();
  EXPECT_GT(last(), second);
}

TEST_P(DatabaseConformance, a_use_forgets_the_age) {
  const auto ages = [&](const char* table) {
    auto reader = database_->read().value();
    return rows_of(*reader, "SELECT aged_ms FROM " + std::string(table) + " ORDER BY aged_ms", 1);
  };
  const auto run = [&](const std::string& sql) {
    ASSERT_TRUE(database_->write([&](SqlConnection& c) { return c.run(sql); })) << sql;
  };
  ASSERT_TRUE(put("a"));
  ASSERT_TRUE(put("b"));
  for (const char* column : {"used_ms", "deleted_ms"}) {
    run("UPDATE assets SET aged_ms = 9");
    run("UPDATE assets SET bytes = 2");
    EXPECT_EQ(ages("assets"), (Rows{"9", "9"}));
    run("UPDATE assets SET " + std::string(column) + " = 4 WHERE id = 'a'");
    EXPECT_EQ(ages("assets"), (Rows{"0", "9"}));
  }
  ASSERT_TRUE(database_->write([](SqlConnection& c) { return put_result(c, "lab", "r"); }));
  run("UPDATE results SET aged_ms = 9");
  EXPECT_EQ(ages("results"), Rows{"9"});
  run("UPDATE results SET used_ms = 4");
  EXPECT_EQ(ages("results"), Rows{"0"});
}

// Random changes of the rows that others are derived from. Each kind of change that the daemon
// makes is there.
class Changes {
 public:
  Status next(SqlConnection& c) {
    const std::string tenant = pick({"lab", "studio"}), number = std::to_string(random_() % 12);
    const std::string one = " WHERE tenant = '" + tenant + "' AND ";
    const int64_t text_bytes = random_() % 3 == 0 ? 5000 + static_cast<int64_t>(random_() % 9) : 9;
    switch (random_() % 18) {
      case 0:
        return c.run(
            "INSERT INTO assets (tenant, id, filename, content_type, bytes, created_ms)"
            " VALUES ($1, $2, '', '', 7, 5) ON CONFLICT (id, tenant) DO UPDATE SET deleted_ms = 0",
            tenant, "asset " + number);
      case 1:
        return c.run("UPDATE assets SET deleted_ms = 8" + one + "id = 'asset " + number + "'");
      case 2:
        return c.run("DELETE FROM assets" + one + "id = 'asset " + number + "'");
      case 3:
        return put_result(c, tenant, "asset " + number, text_bytes);
      case 4:
        return c.run("UPDATE results SET expired_ms = 8" + one + "blob = 'asset " + number + "'");
      case 5:
        return c.run("DELETE FROM results" + one + "blob = 'asset " + number + "'");
      case 6:
        return c.run(
            "UPDATE results SET warnings_json = $1" + one + "blob = 'asset " + number + "'",
            std::string(static_cast<size_t>(text_bytes), 'w'));
      case 7:
        return put_frame(c, "lab", "job " + number, static_cast<int64_t>(random_() % 4));
      case 8:
        return c.run("UPDATE frames SET expired_ms = 8 WHERE job_id = 'job " + number + "'");
      case 9:
        return c.run("DELETE FROM frames WHERE job_id = 'job " + number + "'");
      case 10:
        return put_job(c, tenant, "job " + std::to_string(++jobs_),
                       pick({"queued", "running", "done"}), text_bytes);
      case 11:
        return c.run("UPDATE jobs SET state = $1" + one + "seq % 12 = " + number,
                     pick({"queued", "running", "done", "failed"}));
      case 12:
        return c.run(
            "UPDATE jobs SET options_json = '{}', error_detail = $1" + one + "seq % 12 = " + number,
            std::string(static_cast<size_t>(text_bytes), 'e'));
      case 13:
        return c.run(
            "INSERT INTO job_events (tenant, job_id, id, type, data_json, created_ms)"
            " VALUES ($1, $2, $3, 'state', $4, 5)",
            tenant, "job " + number, ++jobs_, std::string(static_cast<size_t>(text_bytes), 'd'));
      case 14:
        return c.run("DELETE FROM job_events" + one + "job_id = 'job " + number + "'");
      case 15:
        return c.run(
            "INSERT INTO idempotency_keys (tenant, idempotency_key, request_hash, job_id,"
            " created_ms) VALUES ($1, $2, 'h', 'j', 5) ON CONFLICT (tenant, idempotency_key)"
            " DO UPDATE SET job_id = excluded.job_id",
            tenant, "key gr\xC3\xB6\xC3\x9F" + number);
      case 16:
        return c.run("UPDATE assets SET files_bytes = $1" + one + "id = 'asset " + number + "'",
                     text_bytes);
      default:
        return c.run("DELETE FROM jobs" + one + "seq % 12 = " + number);
    }
  }

 private:
  std::string pick(std::initializer_list<const char*> words) {
    return *(words.begin() + random_() % words.size());
  }
  std::mt19937 random_{7};
  int64_t jobs_ = 0;
};

TEST_P(DatabaseConformance, derived_rows_follow_from_the_others_whatever_changes) {
  Changes changes;
  size_t most = 0;
  for (int step = 0; step < 400; ++step) {
    const bool is_undone = step % 5 == 4;
    const Status status = database_->write([&](SqlConnection& c) -> Status {
      VOXELD_TRY(changes.next(c));
      VOXELD_TRY(changes.next(c));
      return is_undone ? Status(kNo) : Status();
    });
    ASSERT_EQ(status.ok(), !is_undone);
    auto reader = database_->read().value();
    for (const DerivedRows& derived : derived_rows()) {
      const Rows stored = rows_of(*reader, derived.stored, 3);
      ASSERT_EQ(stored, rows_of(*reader, derived.computed, 3)) << derived.name << ", " << step;
      most = std::max(most, stored.size());
    }
  }
  EXPECT_GT(most, 12U) << "the changes leave something";
}

INSTANTIATE_TEST_SUITE_P(Databases, DatabaseConformance, ::testing::ValuesIn(kKinds),
                         [](const auto& kind) { return std::string(kind.param.name); });

}  // namespace
}  // namespace voxeld
