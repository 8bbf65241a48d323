#include "server/jobs/retention/store_check.h"

#include <fcntl.h>

#include <algorithm>
#include <cerrno>
#include <system_error>
#include <utility>

#include "server/base/clock.h"
#include "server/base/disk/directory.h"
#include "server/base/disk/file.h"
#include "server/base/sha256.h"
#include "server/jobs/auth/key_file.h"
#include "server/jobs/database/sqlite_connection.h"
#include "server/jobs/database/sqlite_database.h"
#include "server/jobs/database/sqlite_schema.h"
#include "server/jobs/database/tables.h"
#include "server/jobs/records/blob_needs.h"
#include "server/store/blob_checks.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;

Result<int64_t> number(SqlConnection& connection, std::string_view sql) {
  VOXELD_ASSIGN(SqlStatement row, connection.query(sql));
  VOXELD_TRY(row.step());
  return row.int64(0);
}

// All that a row needs: id, and the first table that names it.
constexpr std::string_view kNamed =
    "SELECT id, 'an asset' FROM assets WHERE deleted_ms = 0"
    " UNION ALL SELECT blob, 'a result' FROM results WHERE expired_ms = 0"
    " UNION ALL SELECT grid, 'a grid' FROM results WHERE expired_ms = 0 AND grid <> ''"
    " UNION ALL SELECT sequence, 'a sequence' FROM results WHERE expired_ms = 0"
    "           AND sequence <> ''"
    " UNION ALL SELECT grid, 'a frame' FROM frames WHERE expired_ms = 0"
    " UNION ALL SELECT asset, 'a job that waits' FROM jobs"
    "           WHERE state IN ('queued', 'running') AND asset <> ''";

// How far the counts of live jobs, of each tenant and of all ('*'), are from their rows.
constexpr std::string_view kWrongCounts =
    "SELECT tenant, SUM(queued), SUM(running) FROM"
    " (SELECT tenant, queued, running FROM live_jobs"
    "  UNION ALL SELECT tenant, CASE WHEN state = 'queued' THEN -1 ELSE 0 END,"
    "            CASE WHEN state = 'running' THEN -1 ELSE 0 END FROM jobs"
    "  WHERE state IN ('queued', 'running')"
    "  UNION ALL SELECT '*', CASE WHEN state = 'queued' THEN -1 ELSE 0 END,"
    "            CASE WHEN state = 'running' THEN -1 ELSE 0 END FROM jobs"
    "  WHERE state IN ('queued', 'running')) n"
    " GROUP BY tenant HAVING SUM(queued) <> 0 OR SUM(running) <> 0";

struct Named {
  std::string id, by;
};

Result<std::vector<Named>> named_blobs(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement rows, connection.query(kNamed));
  std::vector<Named> named;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) break;
    named.push_back({rows.text(0), rows.text(1)});
  }
  std::ranges::stable_sort(named, {}, &Named::id);
  const auto is_same = [](const Named& a, const Named& b) { return a.id == b.id; };
  named.erase(std::unique(named.begin(), named.end(), is_same), named.end());
  return named;
}

class Check {
 public:
  explicit Check(const fs::path& dir) { report_.data_dir = dir; }

  Result<StoreReport> run() {
    const fs::path& dir = report_.data_dir;
    std::error_code failed;
    const fs::path database = sqlite_path(dir);
    if (!fs::exists(database, failed)) {
      return Error{ErrorCode::kNotFound, "there is no store in " + dir.string(),
                   "the directory of voxeld serve --data", ""};
    }
    report_.daemon_runs = is_directory_locked(dir);
    if (const auto keys = read_keys(key_file_path(dir)); !keys) {
      problem("keys", "keys", keys.error().message());
    }
    VOXELD_TRY(read_blobs());
    auto reader = SqliteConnection::open(database, SqliteConnection::Role::kReader);
    const Status checked = reader ? check_database(*reader) : Status(reader.error());
    if (!checked) database_problem(checked.error().message());
    list_leftovers();
    return std::move(report_);
  }

 private:
  void problem(std::string kind, std::string what, std::string text) {
    report_.problems.push_back({std::move(kind), std::move(what), std::move(text)});
  }

  void database_problem(std::string text) {
    problem("database", sqlite_path(report_.data_dir).filename(), std::move(text));
  }

  // Hashes every file of the store. One that goes meanwhile was deleted.
  Status read_blobs() {
    const Stopwatch watch;
    std::error_code failed;
    for (fs::recursive_directory_iterator it(report_.data_dir / "blobs", failed), end;
         !failed && it != end; it.increment(failed)) {
      const std::string id = it->path().filename().string();
      if (!is_sha256_id(id)) continue;
      const UniqueFd fd(::open(it->path().c_str(), O_RDONLY | O_CLOEXEC));
      if (!fd.valid() && errno == ENOENT) continue;
      if (!fd.valid()) return errno_error("open", it->path());
      const auto hashed = hash_file(fd.get(), it->path());
      stored_.push_back(id);
      ++report_.blobs;
      if (!hashed) {
        problem("damaged", id, hashed.error().message());
        continue;
      }
      report_.bytes += hashed->second;
      if (hashed->first != id) {
        problem("damaged", id,
                "its bytes (" + std::to_string(hashed->second) + ") are those of " + hashed->first);
      }
    }
    report_.hash_seconds = watch.ms() / 1000.0;
    if (failed) return Error{ErrorCode::kInternal, "list blobs: " + failed.message(), "", ""};
    std::ranges::sort(stored_);
    return {};
  }

  Status check_database(SqliteConnection& reader) {
    VOXELD_ASSIGN(const std::string answer, reader.integrity());
    if (answer != "ok") {
      database_problem("integrity check: " + answer);
      return {};
    }
    VOXELD_ASSIGN(report_.schema_version, sqlite_schema_version(reader));
    if (report_.schema_version != schema_version()) {
      return Error{ErrorCode::kInternal, "schema of another version of voxeld",
                   std::to_string(schema_version()), std::to_string(report_.schema_version)};
    }
    return check_rows(reader);
  }

  Status check_rows(SqlConnection& reader) {
    VOXELD_ASSIGN(report_.jobs, number(reader, "SELECT COUNT(*) FROM jobs"));
    VOXELD_ASSIGN(report_.results,
                  number(reader, "SELECT COUNT(*) FROM results WHERE expired_ms = 0"));
    VOXELD_ASSIGN(report_.assets,
                  number(reader, "SELECT COUNT(*) FROM assets WHERE deleted_ms = 0"));
    VOXELD_TRY(find_missing(reader));
    VOXELD_TRY(check_counts(reader));
    for (const std::string& id : stored_) {
      VOXELD_ASSIGN(const bool needed, is_needed(reader, id));
      if (!needed) report_.orphans.push_back(id);
    }
    return {};
  }

  // Blobs that a running daemon stored or removed since the files were read are looked at again.
  Status find_missing(SqlConnection& reader) {
    VOXELD_ASSIGN(const std::vector<Named> named, named_blobs(reader));
    for (const Named& one : named) {
      if (std::ranges::binary_search(stored_, one.id)) continue;
      VOXELD_ASSIGN(const bool needed, is_needed(reader, one.id));
      if (!needed) continue;
      const std::string folder = one.id.size() > 9 ? one.id.substr(7, 2) : "";
      if (stamp_of(report_.data_dir / "blobs" / folder / one.id)) continue;
      problem("missing", one.id, "no file; it is named by " + one.by);
    }
    return {};
  }

  // Limits of the queue go by them.
  Status check_counts(SqlConnection& reader) {
    VOXELD_ASSIGN(SqlStatement rows, reader.query(kWrongCounts));
    while (true) {
      VOXELD_ASSIGN(const bool row, rows.step());
      if (!row) return {};
      problem("counts", "tenant '" + rows.text(0) + "'",
              "counts " + std::to_string(rows.int64(1)) + " queued and " +
                  std::to_string(rows.int64(2)) + " running jobs more than there are");
    }
  }

  void list_leftovers() {
    if (report_.daemon_runs) return;  // they are in use
    for (const char* folder : {"tmp", "run/scratch"}) {
      std::error_code failed;
      for (fs::recursive_directory_iterator it(report_.data_dir / folder, failed), end;
           !failed && it != end; it.increment(failed)) {
        if (it->is_directory(failed)) continue;
        report_.leftovers.push_back(it->path().lexically_relative(report_.data_dir).string());
      }
    }
  }

  StoreReport report_;
  std::vector<std::string> stored_;
};

}  // namespace

Result<StoreReport> check_store(const fs::path& data_dir) {
  return Check(data_dir).run();
}

}  // namespace voxeld
