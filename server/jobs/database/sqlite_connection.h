// Connections to a SQLite file. sqlite_connection.cpp alone includes sqlite3.h.
#pragma once

#include <cstdint>
#include <filesystem>
#include <functional>
#include <map>
#include <memory>
#include <string>
#include <string_view>
#include <utility>

#include "proto/result.h"
#include "server/jobs/database/sql.h"

struct sqlite3;
struct sqlite3_stmt;

namespace voxeld {

// Advice for a database that SQLite cannot read.
inline constexpr std::string_view kCorruptDatabase =
    "job database is corrupt; put back a copy and start once with --adopt, or move jobs.sqlite and "
    "jobs.sqlite-wal away and run voxeld doctor --rebuild";

// Errors: storage-full when the disk is full, internal with SQLite's words otherwise ("job database
// is corrupt: …").
class SqliteConnection final : public SqlConnection {
 public:
  // kWriter: WAL, synchronous=FULL; the only one in the process that may write or checkpoint, for
  // SQLite before 3.51.3 can corrupt a WAL that two connections reset. kReader: read-only, and
  // never checkpoints, not even when it is closed.
  enum class Role { kWriter, kReader };
  static Result<SqliteConnection> open(const std::filesystem::path& path, Role role);

  int64_t changes() const override;
  // Several statements without parameters: schema and pragmas.
  Status run_script(const std::string& sql);
  // Rows that all statements changed since the connection was opened, also in what was undone.
  int64_t total_changes() const;
  // False after SQLite has rolled back on its own (disk full, I/O error).
  bool in_transaction() const;
  // "ok", or the first thing that SQLite finds wrong. Reads the whole file.
  Result<std::string> integrity();
  // Whether commits from now on are durable on return (the default). Not inside a transaction.
  Status set_synced(bool is_synced);
  // Writes pages of the WAL into the file as far as readers allow, so that SQLite writes over it
  // instead of behind it.
  Status checkpoint();
  // Takes at most so many free pages out of the database and returns their bytes. The next whole
  // checkpoint shortens the file. Not inside a transaction.
  Result<int64_t> reclaim(int64_t pages_max);

 private:
  struct Closer {
    void operator()(sqlite3* db) const;
    void operator()(sqlite3_stmt* statement) const;
  };
  class Prepared final : public PreparedStatement {
   public:
    Prepared(sqlite3* db, std::unique_ptr<sqlite3_stmt, Closer> statement)
        : db_(db), statement_(std::move(statement)) {}
    void bind(int index, int64_t value) override;
    void bind(int index, std::string_view value) override;
    Result<bool> step() override;
    int64_t int64(int column) const override;
    std::string text(int column) const override;
    void end() noexcept override;

   private:
    // SQLite numbers $n by first appearance, so parameters are looked up by name.
    int slot_of(int index) const;
    sqlite3* db_;
    std::unique_ptr<sqlite3_stmt, Closer> statement_;
  };
  explicit SqliteConnection(std::unique_ptr<sqlite3, Closer> db) : db_(std::move(db)) {}
  Result<PreparedStatement*> prepare(std::string_view sql) override;

  std::unique_ptr<sqlite3, Closer> db_;
  // Prepared once; declared after db_, so that they are finalized before it closes.
  std::map<std::string, Prepared, std::less<>> statements_;
};

}  // namespace voxeld
