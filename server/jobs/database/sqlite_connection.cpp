#include "server/jobs/database/sqlite_connection.h"

#include <sqlite3.h>

#include <cerrno>
#include <new>
#include <utility>

#include "server/base/check.h"

namespace voxeld {
namespace {

// Only the writer of another program could hold the lock: ours has one writing connection.
constexpr int kBusyTimeoutMs = 2000;
// Twice what SQLite writes between two checkpoints.
constexpr int64_t kLogBytesKept = int64_t{8} << 20;

Error sql_error(sqlite3* db, std::string_view action) {
  const int code = sqlite3_extended_errcode(db);
  const std::string words = std::string(action) + ": " + sqlite3_errmsg(db);
  const int reason = sqlite3_system_errno(db);
  const bool is_file = (code & 0xff) == SQLITE_CANTOPEN || (code & 0xff) == SQLITE_IOERR;
  switch (is_file && (reason == ENOSPC || reason == EDQUOT) ? SQLITE_FULL : code & 0xff) {
    case SQLITE_FULL:
      return {ErrorCode::kStorageFull, "job database cannot grow, the disk is full: " + words, "",
              ""};
    case SQLITE_CORRUPT:
    case SQLITE_NOTADB:
      return {ErrorCode::kInternal, std::string(kCorruptDatabase) + ": " + words, "", ""};
    case SQLITE_BUSY:
    case SQLITE_LOCKED:
      return {ErrorCode::kInternal, "job database is locked by another program: " + words, "", ""};
    default:
      return {ErrorCode::kInternal, "job database: " + words, "", ""};
  }
}

// OCTET_LENGTH(text), which SQLite has of its own from 3.43 on.
void octet_length(sqlite3_context* context, int, sqlite3_value** values) {
  if (sqlite3_value_type(values[0]) == SQLITE_NULL) return sqlite3_result_null(context);
  sqlite3_result_int(context, sqlite3_value_bytes(values[0]));
}

Status add_functions(sqlite3* db) {
  constexpr int kFlags = SQLITE_UTF8 | SQLITE_DETERMINISTIC | SQLITE_INNOCUOUS;
  if (sqlite3_create_function_v2(db, "octet_length", 1, kFlags, nullptr, octet_length, nullptr,
                                 nullptr, nullptr) != SQLITE_OK) {
    return sql_error(db, "add a function");
  }
  return {};
}

}  // namespace

int SqliteConnection::Prepared::slot_of(int index) const {
  std::string name = std::to_string(index);
  name.insert(name.begin(), '$');
  const int slot = sqlite3_bind_parameter_index(statement_.get(), name.c_str());
  VOXELD_CHECK(slot != 0, sqlite3_sql(statement_.get()));
  return slot;
}

void SqliteConnection::Prepared::bind(int index, int64_t value) {
  sqlite3_bind_int64(statement_.get(), slot_of(index), value);
}

void SqliteConnection::Prepared::bind(int index, std::string_view value) {
  // A null pointer would bind NULL; an empty text is not NULL.
  const char* data = value.data() == nullptr ? "" : value.data();
  const int bound = sqlite3_bind_text64(statement_.get(), slot_of(index), data, value.size(),
                                        SQLITE_TRANSIENT, SQLITE_UTF8);
  // Left unbound, it would be NULL, and the statement would find something else.
  if (bound == SQLITE_NOMEM) throw std::bad_alloc();
  VOXELD_CHECK(bound == SQLITE_OK, sqlite3_sql(statement_.get()));
}

Result<bool> SqliteConnection::Prepared::step() {
  const int code = sqlite3_step(statement_.get());
  if (code == SQLITE_ROW) return true;
  if (code == SQLITE_DONE) return false;
  return sql_error(db_, "run");
}

int64_t SqliteConnection::Prepared::int64(int column) const {
  return sqlite3_column_int64(statement_.get(), column);
}

std::string SqliteConnection::Prepared::text(int column) const {
  const auto* data = reinterpret_cast<const char*>(sqlite3_column_text(statement_.get(), column));
  const auto size = static_cast<size_t>(sqlite3_column_bytes(statement_.get(), column));
  if (data == nullptr && sqlite3_errcode(db_) == SQLITE_NOMEM) throw std::bad_alloc();
  return data == nullptr ? std::string() : std::string(data, size);
}

void SqliteConnection::Prepared::end() noexcept {
  sqlite3_reset(statement_.get());
  sqlite3_clear_bindings(statement_.get());
}

void SqliteConnection::Closer::operator()(sqlite3* db) const {
  sqlite3_close_v2(db);
}
void SqliteConnection::Closer::operator()(sqlite3_stmt* statement) const {
  sqlite3_finalize(statement);
}

Result<SqliteConnection> SqliteConnection::open(const std::filesystem::path& path, Role role) {
  const int access =
      role == Role::kWriter ? SQLITE_OPEN_READWRITE | SQLITE_OPEN_CREATE : SQLITE_OPEN_READONLY;
  sqlite3* raw = nullptr;
  // NOMUTEX: each connection is used by one thread at a time.
  const int opened = sqlite3_open_v2(path.c_str(), &raw, access | SQLITE_OPEN_NOMUTEX, nullptr);
  std::unique_ptr<sqlite3, Closer> db(raw);
  if (raw == nullptr) {
    return Error{ErrorCode::kInternal, "job database: out of memory", "", ""};
  }
  if (opened != SQLITE_OK) return sql_error(raw, "open " + path.string());
  sqlite3_busy_timeout(raw, kBusyTimeoutMs);
  VOXELD_TRY(add_functions(raw));
  SqliteConnection connection(std::move(db));
  if (role == Role::kWriter) {
    // If SQLite may not write, it opens the file for reading and reports that at the first change.
    if (sqlite3_db_readonly(raw, "main") != 0) {
      return Error{ErrorCode::kInternal, "job database: cannot write to " + path.string(),
                   "a file that its owner may change", ""};
    }
    // The first pragma is void once the file has its first page, which the second one writes.
    VOXELD_TRY(connection.run_script(
        "PRAGMA auto_vacuum=INCREMENTAL; PRAGMA journal_mode=WAL; PRAGMA synchronous=FULL; PRAGMA "
        "foreign_keys=ON;"
        // The journal of a statement that may have to be undone: otherwise each makes a file.
        "PRAGMA temp_store=MEMORY;"
        // KiB of pages: the inner ones of a database of some 100 MB. The default is 2,000.
        "PRAGMA cache_size=-8192;"
        // A log that grew while a long reader kept it from being reused becomes short again.
        "PRAGMA journal_size_limit=" +
        std::to_string(kLogBytesKept)));
  } else {
    sqlite3_db_config(raw, SQLITE_DBCONFIG_NO_CKPT_ON_CLOSE, 1, nullptr);
    VOXELD_TRY(connection.run_script("PRAGMA wal_autocheckpoint=0; PRAGMA query_only=ON;"));
  }
  return connection;
}

Result<PreparedStatement*> SqliteConnection::prepare(std::string_view sql) {
  auto found = statements_.find(sql);
  if (found == statements_.end()) {
    sqlite3_stmt* raw = nullptr;
    if (sqlite3_prepare_v3(db_.get(), sql.data(), static_cast<int>(sql.size()),
                           SQLITE_PREPARE_PERSISTENT, &raw, nullptr) != SQLITE_OK) {
      return sql_error(db_.get(), "prepare");
    }
    std::unique_ptr<sqlite3_stmt, Closer> prepared(raw);
    found = statements_.try_emplace(std::string(sql), db_.get(), std::move(prepared)).first;
  }
  return &found->second;
}

Status SqliteConnection::run_script(const std::string& sql) {
  if (sqlite3_exec(db_.get(), sql.c_str(), nullptr, nullptr, nullptr) != SQLITE_OK) {
    return sql_error(db_.get(), "run");
  }
  return {};
}

int64_t SqliteConnection::changes() const {
  return sqlite3_changes64(db_.get());
}

int64_t SqliteConnection::total_changes() const {
  return sqlite3_total_changes64(db_.get());
}

bool SqliteConnection::in_transaction() const {
  return sqlite3_get_autocommit(db_.get()) == 0;
}

Result<std::string> SqliteConnection::integrity() {
  VOXELD_ASSIGN(SqlStatement check, query("PRAGMA integrity_check(1)"));
  VOXELD_ASSIGN(const bool row, check.step());
  return row ? check.text(0) : "no result";
}

// In the mode WAL, NORMAL syncs at checkpoints alone: power loss undoes the last commits.
Status SqliteConnection::set_synced(bool is_synced) {
  return run_script(is_synced ? "PRAGMA synchronous=FULL" : "PRAGMA synchronous=NORMAL");
}

Status SqliteConnection::checkpoint() {
  return run_script("PRAGMA wal_checkpoint(PASSIVE)");
}

Result<int64_t> SqliteConnection::reclaim(int64_t pages_max) {
  const auto number = [this](std::string_view pragma) -> Result<int64_t> {
    VOXELD_ASSIGN(SqlStatement row, query(pragma));
    VOXELD_TRY(row.step());
    return row.int64(0);
  };
  VOXELD_ASSIGN(const int64_t before, number("PRAGMA freelist_count"));
  VOXELD_TRY(run_script("PRAGMA incremental_vacuum(" + std::to_string(pages_max) + ")"));
  VOXELD_ASSIGN(const int64_t after, number("PRAGMA freelist_count"));
  VOXELD_ASSIGN(const int64_t page_bytes, number("PRAGMA page_size"));
  return (before - after) * page_bytes;
}

}  // namespace voxeld
