// SQLite as values and Results. sqlite.cpp alone includes sqlite3.h.
//
// SQL in this module keeps to what PostgreSQL takes too: $1 parameters, BIGINT milliseconds passed
// in, TEXT ids, 0 and 1 for truth, RETURNING, ON CONFLICT, partial indexes, no data-modifying CTEs.
#pragma once

#include <cstdint>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <string_view>

#include "proto/result.h"

struct sqlite3;
struct sqlite3_stmt;

namespace voxeld {

// Advice for a database that SQLite cannot read.
inline constexpr std::string_view kCorruptDatabase =
    "job database is corrupt; put back a copy and start once with --adopt, or move jobs.sqlite and "
    "jobs.sqlite-wal away and run voxeld doctor --rebuild";

// One execution of a prepared statement of a connection; it is reset when this goes away.
class SqlStatement {
 public:
  ~SqlStatement();
  SqlStatement(SqlStatement&& other) noexcept;
  SqlStatement& operator=(SqlStatement&&) = delete;

  // $index, from 1. (SQLite numbers $n by first appearance, so they are looked up by name.)
  void bind(int index, int64_t value);
  void bind(int index, std::string_view value);
  // True: there is a row. False: done. Errors as SqlConnection.
  Result<bool> step();
  // Columns of the current row, from 0.
  int64_t int64(int column) const;
  std::string text(int column) const;

 private:
  friend class SqlConnection;
  SqlStatement(sqlite3* db, sqlite3_stmt* statement) : db_(db), statement_(statement) {}
  sqlite3* db_;
  sqlite3_stmt* statement_;
};

// One connection, used by one thread at a time. Errors of all calls: storage-full when the disk is
// full, internal with SQLite's words otherwise ("job database is corrupt: …").
class SqlConnection {
 public:
  // kWriter: WAL, synchronous=FULL; the only one in the process that may write or checkpoint, for
  // SQLite before 3.51.3 can corrupt a WAL that two connections reset. kReader: read-only, and
  // never checkpoints, not even when it is closed.
  enum class Role { kWriter, kReader };
  static Result<SqlConnection> open(const std::filesystem::path& path, Role role);

  // A statement with its parameters bound in order.
  template <typename... Values>
  Result<SqlStatement> query(std::string_view sql, const Values&... values) {
    auto statement = prepare(sql);
    if (!statement) return statement;
    int index = 0;
    (statement->bind(++index, values), ...);
    return statement;
  }
  // Runs to the end; rows are dropped.
  template <typename... Values>
  Status run(std::string_view sql, const Values&... values) {
    VOXELD_ASSIGN(SqlStatement statement, query(sql, values...));
    while (true) {
      VOXELD_ASSIGN(const bool row, statement.step());
      if (!row) return {};
    }
  }
  // Several statements without parameters: schema and pragmas.
  Status run_script(const std::string& sql);
  // Rows that the last INSERT, UPDATE or DELETE changed.
  int64_t changes() const;
  // Rows that all statements changed since the connection was opened, also in what was undone.
  int64_t total_changes() const;
  // False after SQLite has rolled back on its own (disk full, I/O error).
  bool in_transaction() const;

 private:
  struct Closer {
    void operator()(sqlite3* db) const;
    void operator()(sqlite3_stmt* statement) const;
  };
  explicit SqlConnection(std::unique_ptr<sqlite3, Closer> db) : db_(std::move(db)) {}
  Result<SqlStatement> prepare(std::string_view sql);

  std::unique_ptr<sqlite3, Closer> db_;
  // Prepared once; declared after db_, so that they are finalized before it closes.
  std::map<std::string, std::unique_ptr<sqlite3_stmt, Closer>, std::less<>> statements_;
};

}  // namespace voxeld
