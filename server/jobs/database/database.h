// The job database: one connection that writes, many that read.
#pragma once

#include <chrono>
#include <filesystem>
#include <functional>
#include <memory>
#include <vector>

#include "proto/result.h"
#include "server/base/thread_annotations.h"
#include "server/jobs/database/sqlite.h"

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
  static Result<std::unique_ptr<Database>> open(
      const std::filesystem::path& path,
      std::chrono::milliseconds reader_idle_max = kReaderIdleMax);

  // Blocks until the operation's changes are on disk. Errors: the operation's own, or the commit's.
  Status write(const Operation& operation) EXCLUDES(mutex_, writer_mutex_);

  // `told` hears the store's generation after each commit that changed rows, on the thread that
  // committed (see store_identity.h).
  void tell_generation(std::function<void(int64_t)> told) EXCLUDES(writer_mutex_);

  // The same for what deletes or expires, and for what ends a job, whose inputs and parts go then:
  // `make_way` is called first (DiskRoom), so that a full disk does not keep anybody from making
  // room on it. Where it says that the disk is full, the WAL is checkpointed, so that SQLite writes
  // over it instead of behind it.
  Status write_freeing(const Operation& operation) EXCLUDES(mutex_, writer_mutex_);
  // To be set before other threads use the database.
  void set_make_way(std::function<bool()> make_way) { make_way_ = std::move(make_way); }

  // A reader that nobody used for so long is closed at the next chance: what a crowd of clients
  // needed for a moment. Opening one takes longer than most of what they are used for, so those in
  // use stay. Of a closed one SQLite keeps the descriptor of the file for the next, since closing
  // it would drop the process's locks.
  static constexpr std::chrono::milliseconds kReaderIdleMax{10'000};

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
  struct IdleReader {
    std::unique_ptr<SqlConnection> connection;
    std::chrono::steady_clock::time_point since;
  };
  Database(std::filesystem::path path, SqlConnection writer,
           std::chrono::milliseconds reader_idle_max)
      : path_(std::move(path)), reader_idle_max_(reader_idle_max), writer_(std::move(writer)) {}
  void give_back(std::unique_ptr<SqlConnection> reader) EXCLUDES(mutex_);
  void run_batch(const std::vector<Pending*>& batch) noexcept EXCLUDES(writer_mutex_);
  Status run_operations(const std::vector<Pending*>& batch) REQUIRES(writer_mutex_);
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
  SqlConnection writer_ GUARDED_BY(writer_mutex_);
  std::function<void(int64_t)> generation_told_ GUARDED_BY(writer_mutex_);
  // The one that was used last is at the end and is taken first.
  std::vector<IdleReader> idle_readers_ GUARDED_BY(mutex_);
};

}  // namespace voxeld
