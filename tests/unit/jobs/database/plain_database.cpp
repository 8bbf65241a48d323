#include "tests/unit/jobs/database/plain_database.h"

#include <exception>

#include "server/base/guard.h"
#include "server/jobs/database/sqlite_schema.h"

namespace voxeld::testing {

Result<std::unique_ptr<Database>> PlainDatabase::open(const std::filesystem::path& path) {
  VOXELD_ASSIGN(SqliteConnection writer,
                SqliteConnection::open(path, SqliteConnection::Role::kWriter));
  VOXELD_TRY(create_sqlite_schema(writer));
  return std::unique_ptr<Database>(new PlainDatabase(path, std::move(writer)));
}

// Returns the generation; 0: there is none, or nothing has changed.
Result<int64_t> PlainDatabase::commit(const Operation& operation) {
  const int64_t before = writer_.total_changes();
  try {
    VOXELD_TRY(operation(writer_));
  } catch (const std::exception& failure) {
    return exception_error(failure);
  }
  int64_t generation = 0;
  if (writer_.total_changes() != before) {
    VOXELD_ASSIGN(SqlStatement row, writer_.query("UPDATE store SET generation = generation + 1"
                                                  " RETURNING generation"));
    VOXELD_ASSIGN(const bool tied, row.step());
    if (tied) generation = row.int64(0);
  }
  VOXELD_TRY(writer_.run("COMMIT"));
  return generation;
}

Status PlainDatabase::write(const Operation& operation, Durability /*durability*/) {
  const MutexLock lock(mutex_);
  VOXELD_TRY(writer_.run("BEGIN IMMEDIATE"));
  const Result<int64_t> generation = commit(operation);
  if (!generation) {
    if (writer_.in_transaction()) VOXELD_TRY(writer_.run("ROLLBACK"));
    return generation.error();
  }
  if (*generation > 0 && told_) guarded("told", [&] { told_(*generation); });
  return {};
}

Status PlainDatabase::write_freeing(const Operation& operation) {
  if (make_way_ && make_way_()) {
    const MutexLock lock(mutex_);
    VOXELD_TRY(writer_.checkpoint());
  }
  return write(operation);
}

Result<Database::Lease> PlainDatabase::read() {
  VOXELD_ASSIGN(SqliteConnection reader,
                SqliteConnection::open(path_, SqliteConnection::Role::kReader));
  return lease(std::make_unique<SqliteConnection>(std::move(reader)));
}

}  // namespace voxeld::testing
