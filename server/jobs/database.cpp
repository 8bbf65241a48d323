#include "server/jobs/database.h"

#include <exception>
#include <utility>

#include "server/base/log.h"
#include "server/base/stopwatch.h"
#include "server/jobs/schema.h"

namespace voxeld {
namespace {

Status check_integrity(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement check, connection.query("PRAGMA integrity_check(1)"));
  VOXELD_ASSIGN(const bool row, check.step());
  const std::string answer = row ? check.text(0) : "no answer";
  if (answer == "ok") return {};
  return Error{ErrorCode::kInternal,
               "job database is corrupt; move it away or put back a copy. Integrity check", "ok",
               answer};
}

// One operation inside the transaction of its batch.
Status run_operation(SqlConnection& connection, const Database::Operation& operation) {
  VOXELD_TRY(connection.run("SAVEPOINT operation"));
  Status status;
  try {
    status = operation(connection);
  } catch (const std::exception& failure) {
    status = Error{ErrorCode::kInternal, std::string("job database: ") + failure.what(), "", ""};
  }
  if (!connection.in_transaction()) return status;  // SQLite has rolled everything back
  if (!status) VOXELD_TRY(connection.run("ROLLBACK TO operation"));
  VOXELD_TRY(connection.run("RELEASE operation"));
  return status;
}

}  // namespace

Result<std::unique_ptr<Database>> Database::open(const std::filesystem::path& path) {
  const Stopwatch watch;
  VOXELD_ASSIGN(SqlConnection writer, SqlConnection::open(path, SqlConnection::Role::kWriter));
  VOXELD_TRY(check_integrity(writer));
  VOXELD_TRY(migrate_schema(writer));
  log::debug("job database is open", {{"path", path.string()}, {"ms", watch.ms()}});
  return std::unique_ptr<Database>(new Database(path, std::move(writer)));
}

Status Database::write(const Operation& operation) {
  Pending mine;
  mine.operation = &operation;
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

void Database::run_batch(const std::vector<Pending*>& batch) {
  MutexLock lock(writer_mutex_);
  Status whole = writer_.run("BEGIN IMMEDIATE");
  for (Pending* pending : batch) {
    if (!whole) break;
    pending->status = run_operation(writer_, *pending->operation);
    if (!writer_.in_transaction()) {
      whole = Error{ErrorCode::kInternal, "job database: the transaction was rolled back", "", ""};
      if (!pending->status) whole = pending->status;
    }
  }
  if (whole) whole = writer_.run("COMMIT");
  if (whole) return;
  log::error("job database refused to commit", {{"error", whole.error().message()}});
  if (writer_.in_transaction()) {
    if (Status undone = writer_.run("ROLLBACK"); !undone) {
      log::error("job database refused to roll back", {{"error", undone.error().message()}});
    }
  }
  for (Pending* pending : batch) {
    if (pending->status.ok()) pending->status = whole;
  }
}

Result<Database::Lease> Database::read() {
  {
    MutexLock lock(mutex_);
    if (!idle_readers_.empty()) {
      Lease lease(*this, std::move(idle_readers_.back()));
      idle_readers_.pop_back();
      return lease;
    }
  }
  VOXELD_ASSIGN(SqlConnection reader, SqlConnection::open(path_, SqlConnection::Role::kReader));
  return Lease(*this, std::make_unique<SqlConnection>(std::move(reader)));
}

Database::Lease::~Lease() {
  if (connection_ == nullptr) return;
  MutexLock lock(database_->mutex_);
  database_->idle_readers_.push_back(std::move(connection_));
}

}  // namespace voxeld
