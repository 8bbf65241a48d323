#include "server/jobs/database/sqlite_database.h"

#include <algorithm>
#include <exception>
#include <iterator>
#include <utility>

#include "server/base/clock.h"
#include "server/base/guard.h"
#include "server/base/log.h"
#include "server/jobs/database/sqlite_schema.h"

namespace voxeld {
namespace {

// Free pages that stay for new rows.
constexpr int64_t kFreePagesKept = 256;
// Pages at a time: other writers wait for some milliseconds, and the log restarts in between.
constexpr int64_t kPagesReclaimed = 1024;

Status check_integrity(SqliteConnection& connection) {
  VOXELD_ASSIGN(std::string result, connection.integrity());
  if (result == "ok") return {};
  return Error{ErrorCode::kInternal, std::string(kCorruptDatabase) + ". Integrity check", "ok",
               std::move(result)};
}

// 0 where the database is not tied to a store.
Result<int64_t> next_generation(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement row, connection.query("UPDATE store SET generation = generation + 1"
                                                   " RETURNING generation"));
  VOXELD_ASSIGN(const bool tied, row.step());
  return tied ? row.int64(0) : int64_t{0};
}

}  // namespace

std::filesystem::path sqlite_path(const std::filesystem::path& data_dir) {
  return data_dir / "jobs.sqlite";
}

Result<std::unique_ptr<SqliteDatabase>> SqliteDatabase::open(
    const std::filesystem::path& path, std::chrono::milliseconds reader_idle_max) {
  const Stopwatch watch;
  VOXELD_ASSIGN(SqliteConnection writer,
                SqliteConnection::open(path, SqliteConnection::Role::kWriter));
  VOXELD_TRY(check_integrity(writer));
  VOXELD_TRY(create_sqlite_schema(writer));
  log::debug("job database is open", {{"path", path.string()}, {"ms", watch.ms()}});
  return std::unique_ptr<SqliteDatabase>(
      new SqliteDatabase(path, std::move(writer), reader_idle_max));
}

Status SqliteDatabase::write(const Operation& operation, Durability durability) {
  Pending mine;
  mine.operation = &operation;
  mine.durability = durability;
  std::vector<Pending*> batch;
  {
    MutexLock lock(mutex_);
    pending_.push_back(&mine);
    while (!mine.done && leading_) changed_.wait(lock);
    if (mine.done) return mine.status;
    leading_ = true;
    batch.swap(pending_);
  }
  run_batch(batch);
  MutexLock lock(mutex_);
  for (Pending* pending : batch) pending->done = true;
  leading_ = false;
  changed_.notify_all();
  return mine.status;
}

// A durable commit syncs the log with all commits in it.
Status SqliteDatabase::sync() {
  {
    const MutexLock lock(writer_mutex_);
    if (is_synced_) return {};
  }
  return write([](SqlConnection&) { return Status(); }, Durability::kNow);
}

// SQLite changes this between transactions alone.
Status SqliteDatabase::use(Durability durability) {
  if (durability == used_) return {};
  VOXELD_TRY(writer_.set_synced(durability == Durability::kNow));
  used_ = durability;
  return {};
}

Status SqliteDatabase::write_freeing(const Operation& operation) {
  if (make_way_ && make_way_()) {
    const MutexLock lock(writer_mutex_);
    // As far as readers allow; where it fails, the ballast alone has to do.
    if (Status done = writer_.checkpoint(); !done) {
      log::warn("job database cannot checkpoint", {{"error", done.error().message()}});
    }
  }
  return write(operation);
}

Result<int64_t> SqliteDatabase::reclaim() {
  {
    VOXELD_ASSIGN(const Lease reader, read());
    VOXELD_ASSIGN(SqlStatement free, reader->query("PRAGMA freelist_count"));
    VOXELD_TRY(free.step());
    if (free.int64(0) <= kFreePagesKept) return int64_t{0};
  }
  const bool is_full = make_way_ && make_way_();
  const MutexLock lock(writer_mutex_);
  if (writer_.in_transaction()) return int64_t{0};  // where there was no memory to undo it
  if (is_full) VOXELD_TRY(writer_.checkpoint());
  VOXELD_ASSIGN(const int64_t bytes, writer_.reclaim(kPagesReclaimed));
  VOXELD_TRY(writer_.checkpoint());  // shortens the file
  return bytes;
}

// One operation inside the transaction of its batch. Errors: what undoes the whole batch; the
// operation's own are in `pending`.
Status SqliteDatabase::run_operation(Pending& pending) {
  if (pending.status = writer_.run("SAVEPOINT operation"); !pending.status) return {};
  try {
    pending.status = (*pending.operation)(writer_);
  } catch (const std::exception& failure) {
    pending.status = exception_error(failure);
    pending.status.error().detail.insert(0, "job database: ");
  }
  if (!writer_.in_transaction()) {  // SQLite has rolled everything back
    if (!pending.status) return pending.status;
    return Error{ErrorCode::kInternal, "job database: the transaction was rolled back", "", ""};
  }
  if (!pending.status) VOXELD_TRY(writer_.run("ROLLBACK TO operation"));
  return writer_.run("RELEASE operation");
}

Status SqliteDatabase::run_operations(const std::vector<Pending*>& batch) {
  // Left over where there was no memory to undo it.
  if (writer_.in_transaction()) VOXELD_TRY(writer_.run("ROLLBACK"));
  const bool is_now = std::ranges::any_of(
      batch, [](const Pending* pending) { return pending->durability == Durability::kNow; });
  VOXELD_TRY(use(is_now ? Durability::kNow : Durability::kSoon));
  VOXELD_TRY(writer_.run("BEGIN IMMEDIATE"));
  const int64_t before = writer_.total_changes();
  for (Pending* pending : batch) VOXELD_TRY(run_operation(*pending));
  const bool is_changed = writer_.total_changes() != before;
  int64_t generation = 0;
  // SQLite syncs at a change: the generation is one where the operations made none.
  if (is_changed || (is_now && !is_synced_)) {
    VOXELD_ASSIGN(generation, next_generation(writer_));
  }
  VOXELD_TRY(writer_.run("COMMIT"));
  is_synced_ = is_now || (is_synced_ && !is_changed);
  if (generation > 0 && generation_told_ && is_now) {
    // The batch is durable: what fails from here on must not report it as undone.
    const std::function<void(int64_t)>* const told = &generation_told_;
    guarded("the generation of the job database", [&] { (*told)(generation); });
  }
  return {};
}

void SqliteDatabase::tell_generation(std::function<void(int64_t)> told) {
  const MutexLock lock(writer_mutex_);
  generation_told_ = std::move(told);
}

void SqliteDatabase::undo(const Error& why) {
  log::error("job database refused to commit", {{"error", why.message()}});
  if (!writer_.in_transaction()) return;
  if (Status undone = writer_.run("ROLLBACK"); !undone) {
    log::error("job database refused to roll back", {{"error", undone.error().message()}});
  }
}

// Always wakes the followers: they wait for this thread, which must not end early.
void SqliteDatabase::run_batch(const std::vector<Pending*>& batch) noexcept {
  const MutexLock lock(writer_mutex_);
  Status whole;
  try {
    whole = run_operations(batch);
    if (whole) return;
    undo(whole.error());
  } catch (const std::exception& failure) {
    whole = exception_error(failure);  // what is left of the transaction, the next batch undoes
  }
  for (Pending* pending : batch) {
    if (!pending->status) continue;
    // A copy needs memory that there may not be; an error without words is one, too.
    pending->status = Error{};
    guarded("the job database", [&] { pending->status = whole; });
  }
}

Result<Database::Lease> SqliteDatabase::read() {
  std::unique_ptr<SqlConnection> reader;
  {
    const MutexLock lock(mutex_);
    if (!idle_readers_.empty()) {
      reader = std::move(idle_readers_.back().connection);
      idle_readers_.pop_back();
    }
  }
  if (reader == nullptr) {
    VOXELD_ASSIGN(SqliteConnection opened,
                  SqliteConnection::open(path_, SqliteConnection::Role::kReader));
    reader = std::make_unique<SqliteConnection>(std::move(opened));
  }
  return lease(std::move(reader));
}

void SqliteDatabase::give_back(std::unique_ptr<SqlConnection> reader) {
  const auto now = std::chrono::steady_clock::now();
  std::vector<IdleReader> old;  // closed without the lock
  const MutexLock lock(mutex_);
  idle_readers_.push_back({std::move(reader), now});
  const auto used = std::find_if(idle_readers_.begin(), idle_readers_.end(), [&](const auto& idle) {
    return now - idle.since <= reader_idle_max_;
  });
  old.assign(std::make_move_iterator(idle_readers_.begin()), std::make_move_iterator(used));
  idle_readers_.erase(idle_readers_.begin(), used);
}

}  // namespace voxeld
