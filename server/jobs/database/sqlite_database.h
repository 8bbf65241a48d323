// The embedded job database: a SQLite file, one connection that writes, many that read.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <utility>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/database/database.h"
#include "server/jobs/database/sqlite_connection.h"

namespace voxeld {

// DIR/jobs.sqlite, beside which SQLite keeps jobs.sqlite-wal and jobs.sqlite-shm.
std::filesystem::path sqlite_path(const std::filesystem::path& data_dir);

// Commits in groups: a synced commit takes about 2 ms, and all operations that arrive while one
// runs share the next one (leader and followers, as LevelDB's write queue does).
class SqliteDatabase final : public Database {
 public:
  // Opens or creates, checks integrity and brings the schema up to date. Errors: internal (corrupt,
  // newer schema than this program knows), storage-full.
  static Result<std::unique_ptr<SqliteDatabase>> open(
      const std::filesystem::path& path,
      std::chrono::milliseconds reader_idle_max = kReaderIdleMax);

  using Database::write;
  Status write(const Operation& operation, Durability durability) override
      EXCLUDES(mutex_, writer_mutex_);
  Status sync() override EXCLUDES(mutex_, writer_mutex_);
  // On a full disk the WAL is checkpointed, so that SQLite overwrites it instead of appending.
  Status write_freeing(const Operation& operation) override EXCLUDES(mutex_, writer_mutex_);
  Result<int64_t> reclaim() override EXCLUDES(writer_mutex_);
  void set_make_way(std::function<bool()> make_way) override { make_way_ = std::move(make_way); }
  void tell_generation(std::function<void(int64_t)> told) override EXCLUDES(writer_mutex_);
  Result<Lease> read() override EXCLUDES(mutex_);

  // A reader that is unused for this long is closed: many clients at a time need it only briefly.
  // Readers in use stay open, because opening one takes longer than most reads. SQLite holds the
  // file descriptor of a closed reader for the next one, because closing it would drop the
  // process's locks.
  static constexpr std::chrono::milliseconds kReaderIdleMax{10'000};

 private:
  struct Pending {
    const Operation* operation = nullptr;
    Durability durability = Durability::kNow;
    Status status;
    bool done = false;
  };
  struct IdleReader {
    std::unique_ptr<SqlConnection> connection;
    std::chrono::steady_clock::time_point since;
  };
  SqliteDatabase(std::filesystem::path path, SqliteConnection writer,
                 std::chrono::milliseconds reader_idle_max)
      : path_(std::move(path)), reader_idle_max_(reader_idle_max), writer_(std::move(writer)) {}
  void give_back(std::unique_ptr<SqlConnection> reader) override EXCLUDES(mutex_);
  void run_batch(const std::vector<Pending*>& batch) noexcept EXCLUDES(writer_mutex_);
  Status run_operations(const std::vector<Pending*>& batch) REQUIRES(writer_mutex_);
  Status use(Durability durability) REQUIRES(writer_mutex_);
  Status run_operation(Pending& pending) REQUIRES(writer_mutex_);
  void undo(const Error& why) REQUIRES(writer_mutex_);

  const std::filesystem::path path_;
  const std::chrono::milliseconds reader_idle_max_;
  std::function<bool()> make_way_;  // set once
  Mutex mutex_;
  CondVar changed_;
  std::vector<Pending*> pending_ GUARDED_BY(mutex_);
  bool leading_ GUARDED_BY(mutex_) = false;
  // Declared before the readers, so that it is closed after them and checkpoints the WAL.
  Mutex writer_mutex_;
  SqliteConnection writer_ GUARDED_BY(writer_mutex_);
  std::function<void(int64_t)> generation_told_ GUARDED_BY(writer_mutex_);
  Durability used_ GUARDED_BY(writer_mutex_) = Durability::kNow;  // by the writer's commits
  bool is_synced_ GUARDED_BY(writer_mutex_) = true;               // all commits are durable
  // The one that was used last is at the end and is taken first.
  std::vector<IdleReader> idle_readers_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
