// The job database as its users see it. SqliteDatabase is the embedded implementation. Any
// implementation passes tests/unit/jobs/database/database_conformance_test.cpp.
#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <utility>

#include "proto/result.h"
#include "server/base/durability.h"
#include "server/base/guard.h"
#include "server/jobs/database/sql.h"

namespace voxeld {

// Thread-safe. Has the tables of tables.h from the start. Errors of all calls: storage-full when
// there is no room for more rows, internal otherwise.
class Database {
 public:
  // Changes rows. Runs once, inside a transaction, on any thread. Operations run one at a time:
  // one reads what all before it wrote, and what it has read does not change under it.
  using Operation = std::function<Status(SqlConnection&)>;

  virtual ~Database() = default;

  // Blocks until the operation's changes are committed, and readers from then on see them. An Error
  // or an exception of the operation undoes all of its changes and nothing else. Power loss undoes
  // commits in the reverse of their order: a durable one makes all before it durable. Errors: the
  // operation's own, or the commit's.
  virtual Status write(const Operation& operation, Durability durability) = 0;
  Status write(const Operation& operation) { return write(operation, Durability::kNow); }

  // Makes all commits durable. Returns at once if they are.
  virtual Status sync() = 0;

  // The same for operations that free space: what deletes or expires, and what ends a job, whose
  // inputs and parts go then. make_way() is called first, so that a full disk does not keep anybody
  // from making room on it; where it says that the disk is full, the database does what it can to
  // reuse its own space before it grows.
  virtual Status write_freeing(const Operation& operation) = 0;

  // Gives some of the room of removed rows back to the file system, between two operations. Returns
  // how many bytes; 0: what is left is kept for new rows. The file shrinks once readers allow it.
  virtual Result<int64_t> reclaim() = 0;

  // Called by write_freeing() and reclaim(); true: the disk is full (DiskRoom). To be set before
  // other threads use the database.
  virtual void set_make_way(std::function<bool()> make_way) = 0;

  // Calls `told` with the store's generation once commits that changed rows are durable, on the
  // thread that made them so (store_identity.h). The database raises `generation` in the row of the
  // table `store` within each such commit. Without a row, `told` is not called. Its exceptions are
  // logged.
  virtual void tell_generation(std::function<void(int64_t)> told) = 0;

  // A reading connection for the caller alone, given back when the lease goes away. Each statement
  // sees what was committed when it began, also within an operation of write(), whose own changes
  // it does not see. It neither waits for writers nor holds them up, and cannot write.
  class Lease {
   public:
    ~Lease() {
      if (connection_ == nullptr) return;
      // Without memory for it, the connection is closed.
      guarded("a reader of the job database",
              [this] { database_->give_back(std::move(connection_)); });
    }
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
  virtual Result<Lease> read() = 0;

 protected:
  Lease lease(std::unique_ptr<SqlConnection> connection) { return {*this, std::move(connection)}; }
  // Takes the connection of a lease that ends. May throw; the connection is closed then.
  virtual void give_back(std::unique_ptr<SqlConnection> connection) = 0;
};

}  // namespace voxeld
