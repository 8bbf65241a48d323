// A second implementation of Database, for its conformance tests: one transaction for each
// operation, and a new connection for each reader. It shares the SQL engine with SqliteDatabase,
// and none of its transactions, batches and pools.
#pragma once

#include <filesystem>
#include <functional>
#include <memory>
#include <utility>

#include "server/base/thread_annotations.h"
#include "server/jobs/database/database.h"
#include "server/jobs/database/sqlite_connection.h"

namespace voxeld::testing {

class PlainDatabase final : public Database {
 public:
  static Result<std::unique_ptr<Database>> open(const std::filesystem::path& path);

  using Database::write;
  // Each commit is durable.
  Status write(const Operation& operation, Durability durability) override EXCLUDES(mutex_);
  Status sync() override { return {}; }
  Status write_freeing(const Operation& operation) override EXCLUDES(mutex_);
  Result<int64_t> reclaim() override { return int64_t{0}; }
  void set_make_way(std::function<bool()> make_way) override { make_way_ = std::move(make_way); }
  void tell_generation(std::function<void(int64_t)> told) override { told_ = std::move(told); }
  Result<Lease> read() override;

 private:
  PlainDatabase(std::filesystem::path path, SqliteConnection writer)
      : path_(std::move(path)), writer_(std::move(writer)) {}
  void give_back(std::unique_ptr<SqlConnection>) override {}
  Result<int64_t> commit(const Operation& operation) REQUIRES(mutex_);

  const std::filesystem::path path_;
  std::function<bool()> make_way_;
  std::function<void(int64_t)> told_;
  Mutex mutex_;
  SqliteConnection writer_ GUARDED_BY(mutex_);
};

}  // namespace voxeld::testing
