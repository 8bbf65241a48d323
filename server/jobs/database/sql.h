// SQL as values and Results: connections and statements of any database.
//
// Statements are written once, for every implementation, and keep to what SQLite and PostgreSQL
// both take:
//   - $1 parameters, which may come in any order and repeat; BIGINT numbers and TEXT alone.
//   - Times are passed in as milliseconds; no functions of time or chance.
//   - Truth is 0 or 1. A condition is not a number: CASE WHEN … THEN 1 ELSE 0 END.
//   - LENGTH counts characters, OCTET_LENGTH counts bytes.
//   - RETURNING, ON CONFLICT and partial indexes; no data-modifying CTEs.
// Differences between databases are in the files of each implementation (sqlite_*).
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "proto/result.h"

namespace voxeld {

// One statement of a connection, as an implementation keeps it to execute it again and again.
class PreparedStatement {
 public:
  virtual ~PreparedStatement() = default;
  // $index, from 1, which the statement must have. The bytes of a text are copied. An empty text
  // is not NULL, also where its data() is null.
  virtual void bind(int index, int64_t value) = 0;
  virtual void bind(int index, std::string_view value) = 0;
  // True: there is a row. False: done. Errors as SqlConnection.
  virtual Result<bool> step() = 0;
  // Columns of the current row, from 0. NULL is 0 and "". int64() reads a text that is a number.
  virtual int64_t int64(int column) const = 0;
  virtual std::string text(int column) const = 0;
  // Ends an execution: its rows and parameters go.
  virtual void end() noexcept = 0;
};

// One execution of a prepared statement, which ends when this goes away. It must end before its
// connection does, and before the connection executes the same text again.
class SqlStatement {
 public:
  explicit SqlStatement(PreparedStatement& prepared) : prepared_(&prepared) {}
  ~SqlStatement() {
    if (prepared_ != nullptr) prepared_->end();
  }
  SqlStatement(SqlStatement&& other) noexcept
      : prepared_(std::exchange(other.prepared_, nullptr)) {}
  SqlStatement& operator=(SqlStatement&&) = delete;

  // As of PreparedStatement.
  void bind(int index, int64_t value) { prepared_->bind(index, value); }
  void bind(int index, std::string_view value) { prepared_->bind(index, value); }
  Result<bool> step() { return prepared_->step(); }
  int64_t int64(int column) const { return prepared_->int64(column); }
  std::string text(int column) const { return prepared_->text(column); }

 private:
  PreparedStatement* prepared_;
};

// One connection, used by one thread at a time. Errors of all calls: storage-full when there is no
// room for more rows, internal with the database's words otherwise ("job database: …").
class SqlConnection {
 public:
  virtual ~SqlConnection() = default;

  // A statement with its parameters bound in order. A text that was executed before is not
  // prepared again.
  template <typename... Values>
  Result<SqlStatement> query(std::string_view sql, const Values&... values) {
    VOXELD_ASSIGN(PreparedStatement* const prepared, prepare(sql));
    SqlStatement statement(*prepared);
    int index = 0;
    (statement.bind(++index, values), ...);
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
  // Rows that the last INSERT, UPDATE or DELETE changed itself, without those that the database
  // changed as a consequence (tables.h).
  virtual int64_t changes() const = 0;

 protected:
  SqlConnection() = default;
  SqlConnection(SqlConnection&&) = default;
  SqlConnection& operator=(SqlConnection&&) = default;
  // Belongs to the connection, which keeps it for the next execution. Never null.
  virtual Result<PreparedStatement*> prepare(std::string_view sql) = 0;
};

}  // namespace voxeld
