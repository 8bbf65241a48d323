// The job database: one connection that writes, many that read.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/sqlite.h"

namespace voxeld {

// Thread-safe. Writes are serialized and committed in groups: a synced commit takes about 2 ms, and
// all operations that arrive while one runs share the next one (leader and followers, as LevelDB's
// write queue does).
class Database {
 public:
  // Changes rows. Runs inside a transaction, one at a time; an Error undoes its changes alone. It
  // may run on another caller's thread.
  using Operation = std::function<Status(SqlConnection&)>;

  // Opens or creates, checks integrity and brings the schema up to date. Errors: internal (corrupt,
  // newer schema than this program knows), storage-full.
  static Result<std::unique_ptr<Database>> open(const std::filesystem::path& path);

  // Blocks until the operation's changes are on disk. Errors: the operation's own, or the commit's.
  Status write(const Operation& operation) EXCLUDES(mutex_, writer_mutex_);

  // Readers that are kept for later; more, which a crowd of clients needs for a moment, are closed
  // when they are given back. Each has up to 2 MB of pages. Of a closed one SQLite keeps the
  // descriptor of the file for the next, since closing it would drop the process's locks.
  static constexpr size_t kIdleReadersMax = 8;

  // A reading connection for the caller alone, given back when the lease goes away.
  class Lease {
   public:
    ~Lease();
    Lease(Lease&&) noexcept = default;
    Lease& operator=(Lease&&) = delete;
    SqlConnection& operator*() const { return *connection_; }
    SqlConnection* operator->() const { return connection_.get(); }

   private:
    friend class Database;
    Lease(Database& database, std::unique_ptr<SqlConnection> connection)
        : database_(&database), connection_(std::move(connection)) {}
    Database* database_;
    std::unique_ptr<SqlConnection> connection_;
  };
  Result<Lease> read() EXCLUDES(mutex_);

 private:
  struct Pending {
    const Operation* operation = nullptr;
    Status status;
    bool done = false;
  };
  Database(std::filesystem::path path, SqlConnection writer)
      : path_(std::move(path)), writer_(std::move(writer)) {}
  void run_batch(const std::vector<Pending*>& batch) noexcept EXCLUDES(writer_mutex_);
  Status run_operations(const std::vector<Pending*>& batch) REQUIRES(writer_mutex_);
  Status run_operation(Pending& pending) REQUIRES(writer_mutex_);
  void undo(const Error& why) REQUIRES(writer_mutex_);

  const std::filesystem::path path_;
  Mutex mutex_;
  CondVar changed_;
  std::vector<Pending*> pending_ GUARDED_BY(mutex_);
  bool leading_ GUARDED_BY(mutex_) = false;
  // Declared before the readers, so that it is closed after them and checkpoints the WAL.
  Mutex writer_mutex_;
  SqlConnection writer_ GUARDED_BY(writer_mutex_);
  std::vector<std::unique_ptr<SqlConnection>> idle_readers_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
