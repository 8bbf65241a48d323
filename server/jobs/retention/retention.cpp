#include "server/jobs/retention/retention.h"

#include <algorithm>
#include <set>
#include <utility>

#include "server/base/clock.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/records/expiry.h"

namespace voxeld {
namespace {

// A batch takes some milliseconds; other writers come in between.
constexpr int64_t kBatch = 64;
constexpr size_t kIdsMax = 1024;  // files of one batch, but for those of a single result
// Uses that are remembered between two flushes; more are forgotten, which makes a result a little
// older than it is.
constexpr size_t kTouchedMax = 50'000;
// A result that is used all the time is noted so often. Ages are days. A last use that is more than
// this ahead was noted before the system's clock was set back.
constexpr int64_t kUsePrecisionMs = int64_t{10} * 60 * 1000;

// How a result needs the blob $1.
constexpr std::string_view kUses[] = {"blob = $1", "grid = $1 AND grid <> ''",
                                      "sequence = $1 AND sequence <> ''",
                                      "job_id IN (SELECT job_id FROM frames WHERE grid = $1)"};

using Ids = std::vector<std::string>;

// Between the two, which they are not. No live job works on any part of them.
// `column`: used_ms, or aged_ms, which is 0 as long as it is not known.
Result<std::vector<ExpiringResult>> old_results(SqlConnection& connection, std::string_view column,
                                                int64_t after_ms, int64_t before_ms,
                                                int64_t count_max) {
  const std::string by(column);
  VOXELD_ASSIGN(
      SqlStatement rows,
      connection.query(
          "SELECT seq, job_id FROM results r WHERE expired_ms = 0 AND " + by + " > $3 AND " + by +
              " < $1"
              " AND NOT EXISTS (SELECT 1 FROM jobs n WHERE n.state IN ('queued',"
              " 'running') AND ((n.grid <> '' AND n.grid IN (r.grid, r.blob))"
              " OR (n.sequence <> '' AND n.sequence = r.sequence)"
              " OR (n.grid <> '' AND r.sequence <> '' AND EXISTS (SELECT 1 FROM frames f"
              " WHERE f.job_id = r.job_id AND f.grid = n.grid))))"
              " ORDER BY " +
              by + ", seq LIMIT $2",
          before_ms, std::min(count_max, kBatch), after_ms));
  std::vector<ExpiringResult> results;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return results;
    results.push_back({rows.int64(0), rows.text(1)});
  }
}

// Removes a batch of the deleted assets of which `condition` on $1 is true, by the column `order`;
// of those that need no look any more (AssetStore::remove_unneeded).
template <typename Value>
Status forget_assets(SqlConnection& connection, std::string_view condition, std::string_view order,
                     const Value& value) {
  const std::string which = " (SELECT id, tenant FROM assets WHERE bytes < 0 AND " +
                            std::string(condition) + " ORDER BY " + std::string(order) +
                            " LIMIT $2)";
  VOXELD_TRY(
      connection.run("DELETE FROM bundle_files WHERE (bundle, tenant) IN" + which, value, kBatch));
  return connection.run("DELETE FROM assets WHERE (id, tenant) IN" + which, value, kBatch);
}

// Whether the database knows a blob that nothing needs: it was deleted, or it expired.
Result<bool> has_ended(SqlConnection& connection, std::string_view id) {
  VOXELD_ASSIGN(SqlStatement answer,
                connection.query("SELECT CASE WHEN EXISTS (SELECT 1 FROM assets WHERE id = $1)"
                                 " OR EXISTS (SELECT 1 FROM results WHERE blob = $1)"
                                 " OR EXISTS (SELECT 1 FROM results WHERE grid = $1 AND grid <> '')"
                                 " OR EXISTS (SELECT 1 FROM results WHERE sequence = $1"
                                 "            AND sequence <> '')"
                                 " OR EXISTS (SELECT 1 FROM frames WHERE grid = $1)"
                                 " THEN 1 ELSE 0 END",
                                 id));
  VOXELD_TRY(answer.step());
  return answer.int64(0) != 0;
}

}  // namespace

void Retention::touch(const std::string& blob) {
  const MutexLock lock(mutex_);
  if (used_ms_.size() < kTouchedMax) used_ms_[blob] = unix_time_ms();
}

Status Retention::flush() {
  std::unordered_map<std::string, int64_t> used;
  {
    const MutexLock lock(mutex_);
    used.swap(used_ms_);
  }
  while (!used.empty()) {
    const auto& [id, at_ms] = *used.begin();
    for (const std::string_view uses : kUses) {
      if (Status noted = note_use(id, uses, at_ms); !noted) {
        const MutexLock lock(mutex_);
        used_ms_.merge(used);
        return noted;
      }
    }
    used.erase(used.begin());
  }
  return {};
}

// Results of equal content have one blob, and there may be thousands of them: they are found
// without the writer, and noted in several transactions (note_ages).
Status Retention::note_use(const std::string& id, std::string_view uses, int64_t at_ms) {
  while (true) {
    std::vector<int64_t> rows;
    {
      VOXELD_ASSIGN(Database::Lease reader, database_.read());
      VOXELD_ASSIGN(SqlStatement found,
                    reader->query("SELECT seq FROM results WHERE expired_ms = 0"
                                  " AND used_ms NOT BETWEEN $2 AND $3 AND " +
                                      std::string(uses) + " LIMIT $4",
                                  id, at_ms - kUsePrecisionMs, at_ms + kUsePrecisionMs, kBatch));
      while (true) {
        VOXELD_ASSIGN(const bool row, found.step());
        if (!row) break;
        rows.push_back(found.int64(0));
      }
    }
    if (rows.empty()) return {};
    Status committed = database_.write([&](SqlConnection& connection) -> Status {
      for (const int64_t seq : rows) {
        VOXELD_TRY(connection.run("UPDATE results SET used_ms = $1 WHERE seq = $2", at_ms, seq));
      }
      return {};
    });
    VOXELD_TRY(committed);
  }
}

Result<int64_t> Retention::remove(const Ids& ids, std::string_view quarantine_day) {
  const auto remove_one = [&](const std::string& id) {
    return quarantine_day.empty() ? blobs_.remove(id) : blobs_.quarantine(id, quarantine_day);
  };
  // The files of a sequence are thousands: the writer is free for others in between.
  int64_t removed = 0;
  for (size_t first = 0; first < ids.size(); first += kBatch) {
    const size_t last = std::min(ids.size(), first + kBatch);
    const Ids batch(ids.begin() + static_cast<std::ptrdiff_t>(first),
                    ids.begin() + static_cast<std::ptrdiff_t>(last));
    Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
      VOXELD_ASSIGN(const Ids gone, remove_blobs(connection, database_, batch, remove_one));
      removed += static_cast<int64_t>(gone.size());
      return {};
    });
    VOXELD_TRY(committed);
  }
  return removed;
}

// One transaction for all that came since the last time would hold the writer for seconds, and its
// pages are in memory until then.
Status Retention::note_ages(int64_t kept_now_ms) {
  struct Unknown {
    std::string_view table, key, rows;
  };
  // Nothing expires by age whose age is not known.
  constexpr Unknown kUnknown[] = {{"results", "seq", "aged_ms = 0 AND expired_ms = 0"},
                                  {"assets", "id, tenant", "aged_ms = 0"},
                                  {"jobs", "seq", "aged_ms = 0 AND ended_ms <> 0"}};
  for (const Unknown& unknown : kUnknown) {
    std::string rows = " FROM ";
    rows.append(unknown.table).append(" WHERE ").append(unknown.rows).append(" LIMIT ");
    std::string note = "UPDATE ";
    note.append(unknown.table).append(" SET aged_ms = $1 WHERE (").append(unknown.key);
    note.append(") IN (SELECT ").append(unknown.key).append(rows).append("$2)");
    while (true) {
      {
        VOXELD_ASSIGN(Database::Lease reader, database_.read());
        VOXELD_ASSIGN(SqlStatement row, reader->query("SELECT 1" + rows + "1"));
        VOXELD_ASSIGN(const bool found, row.step());
        if (!found) break;
      }
      VOXELD_TRY(database_.write_freeing([&](SqlConnection& connection) -> Status {
        return connection.run(note, kept_now_ms, kBatch);
      }));
    }
  }
  return {};
}

Result<int64_t> Retention::count(Aged what) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(
      SqlStatement row,
      reader->query(what == Aged::kResults  ? "SELECT COUNT(*) FROM results WHERE expired_ms = 0"
                    : what == Aged::kAssets ? "SELECT COUNT(*) FROM assets WHERE deleted_ms = 0"
                                            : "SELECT COUNT(*) FROM jobs WHERE ended_ms <> 0"));
  VOXELD_TRY(row.step());
  return row.int64(0);
}

Result<int64_t> Retention::asset_bytes() {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement row,
                reader->query("SELECT COALESCE(SUM(bytes), 0) FROM"
                              " (SELECT DISTINCT id, bytes FROM assets WHERE deleted_ms = 0)"));
  VOXELD_TRY(row.step());
  return row.int64(0);
}

Result<int64_t> Retention::expire_results(int64_t used_before_ms, int64_t bytes_wanted) {
  // Noted before the system's clock was set back: no use since then.
  const int64_t ahead_ms = unix_time_ms() + kUsePrecisionMs;
  auto expired = expire_results_by("used_ms", ahead_ms, used_before_ms, kBatch, bytes_wanted);
  if (!expired || *expired > 0) return expired;
  return expire_results_by("used_ms", 0, used_before_ms, kBatch, bytes_wanted);
}

Result<int64_t> Retention::expire_aged_results(int64_t aged_before_ms, int64_t count_max) {
  return expire_results_by("aged_ms", 0, aged_before_ms, count_max, kAllBytes);
}

Result<int64_t> Retention::expire_results_by(std::string_view column, int64_t after_ms,
                                             int64_t before_ms, int64_t count_max,
                                             int64_t bytes_wanted) {
  Ids ids;
  int64_t expired = 0;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto results,
                  old_results(connection, column, after_ms, before_ms, count_max));
    // Each file once; what others need too is counted all the same.
    std::set<std::string> counted;
    int64_t bytes = 0;
    for (const ExpiringResult& result : results) {
      const size_t before = ids.size();
      VOXELD_TRY(expire_result(connection, result, Expiry::kAged, ids));
      ++expired;
      if (ids.size() >= kIdsMax) break;
      if (bytes_wanted == kAllBytes) continue;
      for (size_t i = before; i < ids.size(); ++i) {
        if (!counted.insert(ids[i]).second) continue;
        if (const auto blob = blobs_.stat(ids[i])) bytes += blob->bytes;
      }
      if (bytes >= bytes_wanted) break;
    }
    return {};
  });
  VOXELD_TRY(committed);
  VOXELD_TRY(remove(ids));
  return expired;
}

Result<int64_t> Retention::expire_frames(int64_t aged_before_ms) {
  constexpr std::string_view kOld =
      "SELECT DISTINCT f.job_id FROM frames f JOIN jobs j ON j.id = f.job_id"
      " WHERE f.expired_ms = 0 AND j.state IN ('failed', 'cancelled') AND j.aged_ms <> 0"
      " AND j.aged_ms < $1"
      " LIMIT $2";
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(SqlStatement rows, reader->query(kOld, aged_before_ms, kBatch));
    VOXELD_ASSIGN(const bool some, rows.step());
    if (!some) return int64_t{0};
  }
  Ids ids, jobs;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    {
      VOXELD_ASSIGN(SqlStatement rows, connection.query(kOld, aged_before_ms, kBatch));
      VOXELD_TRY(collect_ids(std::move(rows), jobs));
    }
    for (const std::string& job : jobs) {
      VOXELD_TRY(expire_frames_of(connection, job, Expiry::kAged, ids));
    }
    return {};
  });
  VOXELD_TRY(committed);
  VOXELD_TRY(remove(ids));
  return static_cast<int64_t>(jobs.size());
}

Result<int64_t> Retention::expire_assets(int64_t aged_before_ms, int64_t count_max) {
  int64_t expired = 0;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(
        connection.run("UPDATE assets SET deleted_ms = $2 WHERE (id, tenant) IN"
                       " (SELECT id, tenant FROM assets WHERE deleted_ms = 0"
                       "  AND aged_ms <> 0 AND aged_ms < $1 ORDER BY aged_ms LIMIT $3)",
                       aged_before_ms, unix_time_ms(), std::min(count_max, kBatch)));
    expired = connection.changes();
    return {};
  });
  VOXELD_TRY(committed);
  return expired;
}

Result<int64_t> Retention::trim_jobs(int64_t aged_before_ms, int64_t count_max) {
  Ids ids, jobs;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    {
      VOXELD_ASSIGN(SqlStatement rows,
                    connection.query("SELECT id FROM jobs WHERE aged_ms <> 0 AND aged_ms < $1"
                                     " AND ended_ms <> 0 ORDER BY aged_ms LIMIT $2",
                                     aged_before_ms, std::min(count_max, kBatch)));
      VOXELD_TRY(collect_ids(std::move(rows), jobs));
    }
    for (const std::string& job : jobs) {
      VOXELD_TRY(forget_job(connection, job, Expiry::kAged, ids));
    }
    return forget_assets(connection, "aged_ms <> 0 AND aged_ms < $1", "aged_ms", aged_before_ms);
  });
  VOXELD_TRY(committed);
  VOXELD_TRY(remove(ids));
  return static_cast<int64_t>(jobs.size());
}

Result<int64_t> Retention::trim_records(int64_t record_bytes_max) {
  std::vector<std::string> tenants;
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(SqlStatement rows,
                  reader->query("SELECT tenant FROM tenant_usage WHERE record_bytes > $1"
                                " ORDER BY record_bytes DESC LIMIT $2",
                                record_bytes_max, kBatch));
    while (true) {
      VOXELD_ASSIGN(const bool row, rows.step());
      if (!row) break;
      tenants.push_back(rows.text(0));
    }
  }
  int64_t trimmed = 0;
  for (const std::string& tenant : tenants) {
    VOXELD_ASSIGN(const int64_t of_tenant, trim_records_of(tenant));
    trimmed += of_tenant;
  }
  return trimmed;
}

Result<int64_t> Retention::trim_records_of(std::string_view tenant) {
  Ids ids, jobs;
  int64_t assets = 0;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    {
      VOXELD_ASSIGN(SqlStatement rows,
                    connection.query("SELECT id FROM jobs WHERE tenant = $1 AND ended_ms <> 0"
                                     " ORDER BY seq LIMIT $2",
                                     tenant, kBatch));
      VOXELD_TRY(collect_ids(std::move(rows), jobs));
    }
    for (const std::string& job : jobs) {
      VOXELD_TRY(forget_job(connection, job, Expiry::kAged, ids));
    }
    if (!jobs.empty()) return {};
    VOXELD_TRY(forget_assets(connection, "tenant = $1", "deleted_ms", tenant));
    assets = connection.changes();
    return {};
  });
  VOXELD_TRY(committed);
  VOXELD_TRY(remove(ids));
  return static_cast<int64_t>(jobs.size()) + assets;
}

Result<int64_t> Retention::remove_suspects() {
  const std::set<std::string> suspects = blobs_.take_suspects();
  if (suspects.empty()) return int64_t{0};
  return remove_unnamed({suspects.begin(), suspects.end()}, {});
}

Result<int64_t> Retention::quarantine_orphans(std::string_view day) {
  VOXELD_ASSIGN(const Ids stored, blobs_.list());
  Ids unknown, ended;
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    for (const std::string& id : stored) {
      VOXELD_ASSIGN(const bool known, has_ended(*reader, id));
      (known ? ended : unknown).push_back(id);
    }
  }
  VOXELD_TRY(remove_unnamed(ended, {}));
  return remove_unnamed(unknown, day);
}

Result<int64_t> Retention::restore_quarantined() {
  VOXELD_ASSIGN(const auto quarantined, Quarantine(blobs_.root()).list());
  if (quarantined.empty()) return int64_t{0};
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  int64_t restored = 0;
  Status last;
  for (const QuarantinedBlob& blob : quarantined) {
    VOXELD_ASSIGN(const bool needed, is_needed(*reader, blob.id));
    if (!needed) continue;
    if (Status moved = blobs_.restore(blob); moved) {
      ++restored;
    } else {
      last = std::move(moved);
    }
  }
  VOXELD_TRY(last);
  return restored;
}

// Most are needed, which is found without the writer.
Result<int64_t> Retention::remove_unnamed(const Ids& ids, std::string_view quarantine_day) {
  Ids orphans;
  {
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    for (const std::string& id : ids) {
      VOXELD_ASSIGN(const bool needed, is_needed(*reader, id));
      if (!needed) orphans.push_back(id);
    }
  }
  return remove(orphans, quarantine_day);
}

}  // namespace voxeld
