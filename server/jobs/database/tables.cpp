#include "server/jobs/database/tables.h"

#include <string>
#include <string_view>

namespace voxeld {
namespace {

constexpr int kSchemaVersion = 3;
// Stands in the text for the type of a numbered primary key.
constexpr std::string_view kRowNumber = "ROW_NUMBER";

//   assets ─┐                            jobs.asset, jobs.grid and jobs.sequence name blobs, not
//   results ┼─ jobs ─┬─ job_events       rows: a deleted asset keeps its row (deleted_ms), so that
//   frames ─┘        └─ idempotency_keys asking for it says `gone`.
//
// Every row has a tenant, '' if the daemon has no keys. Indexes for the queries of tenants end in
// `tenant`, so that rows of others are not even read. Times (…_ms) are Unix time in milliseconds;
// 0: not yet.
constexpr std::string_view kAssets = R"sql(
-- Uploads. The same bytes of two tenants are two rows. A deleted asset has bytes of -1 once its
-- blob is gone or left to others who have it. aged_ms: when it was used or deleted last, by the
-- clock of retention (kept_clock.h); 0: Retention::note_ages() has not seen that yet. files_bytes:
-- of its rows in bundle_files.
CREATE TABLE assets (
  tenant TEXT NOT NULL,
  id TEXT NOT NULL,
  filename TEXT NOT NULL,
  content_type TEXT NOT NULL,
  bytes BIGINT NOT NULL,
  created_ms BIGINT NOT NULL,
  deleted_ms BIGINT NOT NULL DEFAULT 0,
  used_ms BIGINT NOT NULL DEFAULT 0,
  aged_ms BIGINT NOT NULL DEFAULT 0,
  description_json TEXT NOT NULL DEFAULT '',
  files_bytes BIGINT NOT NULL DEFAULT 0,
  PRIMARY KEY (id, tenant)
);
CREATE INDEX assets_live ON assets (tenant, created_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_to_remove ON assets (deleted_ms) WHERE deleted_ms <> 0 AND bytes >= 0;
CREATE INDEX assets_by_use ON assets (used_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_gone ON assets (deleted_ms) WHERE bytes < 0;
CREATE INDEX assets_gone_by_tenant ON assets (tenant, deleted_ms) WHERE bytes < 0;
CREATE INDEX assets_to_age ON assets (id) WHERE aged_ms = 0;
CREATE INDEX assets_by_age ON assets (aged_ms) WHERE aged_ms <> 0;

-- Files of assets that are bundles of others. They have a tenant: else uploading a manifest as a
-- plain file would tell whether someone else has it as a bundle.
CREATE TABLE bundle_files (
  tenant TEXT NOT NULL,
  bundle TEXT NOT NULL,
  position BIGINT NOT NULL,
  name TEXT NOT NULL,
  asset TEXT NOT NULL,
  PRIMARY KEY (bundle, tenant, position)
);
CREATE INDEX bundle_files_by_asset ON bundle_files (asset);
)sql";

constexpr std::string_view kJobs = R"sql(
-- seq: the order of arrival. fence: grows with each claim; a report with an older one is void.
-- asset_tenant: whose asset it is; an admin's job may work on another tenant's. deadline_ms: by the
-- clock of deadlines (kept_clock.h), moved at each start by the time without a daemon; the largest
-- number where there is none (kNoDeadline). deadline_at_ms: the same as announced at acceptance; 0:
-- none. device_us: for how long it has had its device.
-- displaced_bytes: that a worker took with it when it was ended for want of memory; 0: none was.
-- queued_ms: since when it has been in the queue again, once it has run; 0: since created_ms.
CREATE TABLE jobs (
  seq ROW_NUMBER,
  id TEXT NOT NULL UNIQUE,
  tenant TEXT NOT NULL DEFAULT '',
  kind TEXT NOT NULL,
  state TEXT NOT NULL,
  asset TEXT NOT NULL,
  asset_tenant TEXT NOT NULL DEFAULT '',
  grid TEXT NOT NULL,
  sequence TEXT NOT NULL DEFAULT '',
  filename TEXT NOT NULL,
  options_json TEXT NOT NULL,
  request_hash TEXT NOT NULL,
  request_id TEXT NOT NULL DEFAULT '',
  trace_id TEXT NOT NULL DEFAULT '',
  priority BIGINT NOT NULL DEFAULT 0,
  deadline_ms BIGINT NOT NULL DEFAULT 9223372036854775807,
  deadline_at_ms BIGINT NOT NULL DEFAULT 0,
  use_cache SMALLINT NOT NULL,
  transient SMALLINT NOT NULL,
  cached SMALLINT NOT NULL DEFAULT 0,
  cancel_requested SMALLINT NOT NULL DEFAULT 0,
  version BIGINT NOT NULL DEFAULT 1,
  attempt BIGINT NOT NULL DEFAULT 0,
  preempted BIGINT NOT NULL DEFAULT 0,
  fence BIGINT NOT NULL DEFAULT 0,
  worker TEXT NOT NULL DEFAULT '',
  lost_workers TEXT NOT NULL DEFAULT '',
  displaced_bytes BIGINT NOT NULL DEFAULT 0,
  tiles_done BIGINT NOT NULL DEFAULT 0,
  tiles_total BIGINT NOT NULL DEFAULT 0,
  frames_total BIGINT NOT NULL DEFAULT 0,
  upload_us BIGINT NOT NULL DEFAULT 0,
  device_us BIGINT NOT NULL DEFAULT 0,
  created_ms BIGINT NOT NULL,
  queued_ms BIGINT NOT NULL DEFAULT 0,
  started_ms BIGINT NOT NULL DEFAULT 0,
  ended_ms BIGINT NOT NULL DEFAULT 0,
  aged_ms BIGINT NOT NULL DEFAULT 0,
  timings_json TEXT NOT NULL DEFAULT '[]',
  result_seq BIGINT NOT NULL DEFAULT 0,
  error_code TEXT NOT NULL DEFAULT '',
  error_detail TEXT NOT NULL DEFAULT '',
  error_expected TEXT NOT NULL DEFAULT '',
  error_got TEXT NOT NULL DEFAULT ''
);
-- The queue. Indexes by tenant and by deadline begin with a column that is the same in all their
-- entries, or SQLite's planner takes jobs_by_state and sorts.
CREATE INDEX jobs_queue ON jobs (seq) WHERE state = 'queued';
CREATE INDEX jobs_queue_by_tenant ON jobs (state, tenant, priority DESC, deadline_ms, seq)
  WHERE state = 'queued';
CREATE INDEX jobs_queue_by_deadline ON jobs (state, deadline_ms) WHERE state = 'queued';
CREATE INDEX jobs_running ON jobs (seq) WHERE state = 'running';
-- Lists.
CREATE INDEX jobs_by_state ON jobs (state, seq);
CREATE INDEX jobs_by_tenant ON jobs (tenant, seq);
-- A tenant's list of one state reads no job of another state.
CREATE INDEX jobs_by_tenant_and_state ON jobs (tenant, state, seq);
-- Live jobs by what they work on.
CREATE INDEX jobs_live_by_asset ON jobs (asset)
  WHERE state IN ('queued', 'running') AND asset <> '';
CREATE INDEX jobs_live_by_grid ON jobs (grid) WHERE state IN ('queued', 'running') AND grid <> '';
CREATE INDEX jobs_live_by_sequence ON jobs (sequence)
  WHERE state IN ('queued', 'running') AND sequence <> '';
-- Retention.
CREATE INDEX jobs_ended ON jobs (ended_ms) WHERE ended_ms <> 0;
CREATE INDEX jobs_ended_by_tenant ON jobs (tenant, seq) WHERE ended_ms <> 0;
CREATE INDEX jobs_by_result ON jobs (result_seq) WHERE result_seq <> 0;
CREATE INDEX jobs_to_age ON jobs (seq) WHERE aged_ms = 0 AND ended_ms <> 0;
CREATE INDEX jobs_by_age ON jobs (aged_ms) WHERE aged_ms <> 0;

CREATE TABLE job_events (
  tenant TEXT NOT NULL,
  job_id TEXT NOT NULL,
  id BIGINT NOT NULL,
  type TEXT NOT NULL,
  data_json TEXT NOT NULL,
  created_ms BIGINT NOT NULL,
  PRIMARY KEY (job_id, id)
);

CREATE TABLE idempotency_keys (
  tenant TEXT NOT NULL,
  idempotency_key TEXT NOT NULL,
  request_hash TEXT NOT NULL,
  job_id TEXT NOT NULL,
  created_ms BIGINT NOT NULL,
  PRIMARY KEY (tenant, idempotency_key)
);
CREATE INDEX idempotency_keys_by_time ON idempotency_keys (created_ms);
CREATE INDEX idempotency_keys_by_job ON idempotency_keys (job_id);
)sql";

constexpr std::string_view kResults = R"sql(
-- Results of jobs that are done; equal jobs share one. sequence: the frames of job_id together. Of
-- an expired result the row stays, so that asking for it says `gone`; is_deleted: by its tenant.
CREATE TABLE results (
  seq ROW_NUMBER,
  tenant TEXT NOT NULL DEFAULT '',
  job_id TEXT NOT NULL DEFAULT '',
  request_hash TEXT NOT NULL,
  blob TEXT NOT NULL,
  bytes BIGINT NOT NULL,
  media_type TEXT NOT NULL,
  filename TEXT NOT NULL,
  grid TEXT NOT NULL,
  grid_bytes BIGINT NOT NULL DEFAULT 0,
  sequence TEXT NOT NULL DEFAULT '',
  sequence_bytes BIGINT NOT NULL DEFAULT 0,
  frames BIGINT NOT NULL DEFAULT 0,
  meta_json TEXT NOT NULL,
  warnings_json TEXT NOT NULL,
  created_ms BIGINT NOT NULL,
  used_ms BIGINT NOT NULL DEFAULT 0,
  aged_ms BIGINT NOT NULL DEFAULT 0,
  expired_ms BIGINT NOT NULL DEFAULT 0,
  is_deleted SMALLINT NOT NULL DEFAULT 0
);
CREATE INDEX results_by_request ON results (request_hash, tenant, seq);
CREATE INDEX results_by_grid ON results (grid, tenant) WHERE grid <> '';
CREATE INDEX results_by_sequence ON results (sequence, tenant) WHERE sequence <> '';
CREATE INDEX results_by_blob ON results (blob);
CREATE INDEX results_by_job ON results (job_id);
CREATE INDEX results_by_tenant ON results (tenant, seq) WHERE expired_ms = 0;
CREATE INDEX results_by_use ON results (used_ms, seq) WHERE expired_ms = 0;
CREATE INDEX results_to_age ON results (seq) WHERE aged_ms = 0 AND expired_ms = 0;
CREATE INDEX results_by_age ON results (aged_ms, seq) WHERE aged_ms <> 0 AND expired_ms = 0;

-- Frames that jobs have listed. time_s: a decimal text of seconds that reads back exactly. Rows
-- stay as long as their job: their grids can be asked for by id.
CREATE TABLE frames (
  job_id TEXT NOT NULL,
  frame BIGINT NOT NULL,
  tenant TEXT NOT NULL DEFAULT '',
  time_s TEXT NOT NULL,
  grid TEXT NOT NULL,
  bytes BIGINT NOT NULL DEFAULT 0,
  voxel_count BIGINT NOT NULL,
  content_hash TEXT NOT NULL,
  expired_ms BIGINT NOT NULL DEFAULT 0,
  is_deleted SMALLINT NOT NULL DEFAULT 0,
  PRIMARY KEY (job_id, frame)
);
CREATE INDEX frames_by_grid ON frames (grid, tenant);
CREATE INDEX frames_kept ON frames (job_id) WHERE expired_ms = 0;
)sql";

constexpr std::string_view kUsage = R"sql(
-- The bytes that each tenant has stored. A row of `holdings` is a blob that at least one of the
-- tenant's assets, results or frames names (`refs` of them). `bytes` is their sum, with the rows of
-- jobs, of what belongs to jobs, and of assets (CountedTable). record_bytes: of rows that go by
-- themselves, those of jobs, and what remembers deleted assets. All are derived (tables.h); blobs
-- of expired rows do not count. A row whose blob changes must be removed and added, except for
-- frames.grid and assets.deleted_ms.
CREATE TABLE tenant_usage (
  tenant TEXT PRIMARY KEY,
  bytes BIGINT NOT NULL,
  record_bytes BIGINT NOT NULL DEFAULT 0
);
CREATE INDEX tenant_usage_by_records ON tenant_usage (record_bytes);
CREATE TABLE holdings (
  tenant TEXT NOT NULL,
  blob TEXT NOT NULL,
  bytes BIGINT NOT NULL,
  refs BIGINT NOT NULL,
  PRIMARY KEY (tenant, blob)
);
CREATE INDEX holdings_by_blob ON holdings (blob);
-- Finds the blobs that an upload of a known length can be.
CREATE INDEX holdings_by_size ON holdings (tenant, bytes);

-- The numbers of queued and running jobs of each tenant, and of all under '*', which is no tenant's
-- name. Derived (tables.h).
CREATE TABLE live_jobs (
  tenant TEXT PRIMARY KEY,
  queued BIGINT NOT NULL,
  running BIGINT NOT NULL
);
)sql";

constexpr std::string_view kStore = R"sql(
-- One row: which store the database belongs to, the number of its commits (store_identity.h), and
-- whether it ever had API keys (key_memory.h).
CREATE TABLE store (
  only_one SMALLINT PRIMARY KEY CHECK (only_one = 1),
  id TEXT NOT NULL,
  generation BIGINT NOT NULL,
  had_keys SMALLINT NOT NULL DEFAULT 0
);
)sql";

// A deleted asset has no bytes that its tenant could free: its row counts as a record alone.
constexpr CountedTable kCountedTables[] = {
    {"jobs",
     "1024 + OCTET_LENGTH(@filename) + OCTET_LENGTH(@options_json) + OCTET_LENGTH(@timings_json)"
     " + OCTET_LENGTH(@lost_workers) + OCTET_LENGTH(@error_detail) + OCTET_LENGTH(@error_expected)"
     " + OCTET_LENGTH(@error_got)",
     "1 = 1", "1 = 1",
     "options_json, timings_json, lost_workers, error_detail, error_expected, error_got"},
    {"job_events", "256 + OCTET_LENGTH(@data_json)", "1 = 1", "1 = 1", ""},
    // The key is in the row and in its index.
    {"idempotency_keys", "256 + 2 * OCTET_LENGTH(@idempotency_key)", "1 = 1", "1 = 1", ""},
    {"results",
     "1024 + OCTET_LENGTH(@filename) + OCTET_LENGTH(@meta_json) + OCTET_LENGTH(@warnings_json)",
     "1 = 1", "1 = 0", "meta_json, warnings_json"},
    {"frames", "512", "1 = 1", "1 = 0", ""},
    {"assets",
     "384 + OCTET_LENGTH(@filename) + OCTET_LENGTH(@content_type) + OCTET_LENGTH(@description_json)"
     " + @files_bytes",
     "@deleted_ms = 0", "@deleted_ms <> 0",
     "filename, content_type, description_json, files_bytes, deleted_ms"},
};

std::string computed_usage() {
  std::string sql =
      "SELECT tenant, SUM(bytes), SUM(record_bytes) FROM ("
      "  SELECT tenant, CASE WHEN bytes > 0 THEN bytes ELSE 0 END AS bytes, 0 AS record_bytes"
      "  FROM holdings";
  for (const CountedTable& table : kCountedTables) {
    const std::string bytes = of_row(table.bytes, "");
    sql.append(" UNION ALL SELECT tenant, CASE WHEN ").append(of_row(table.counts_if, ""));
    sql.append(" THEN ").append(bytes).append(" ELSE 0 END, CASE WHEN ");
    sql.append(of_row(table.is_record_if, "")).append(" THEN ").append(bytes);
    sql.append(" ELSE 0 END FROM ").append(table.name);
  }
  return sql +
         ") n GROUP BY tenant HAVING SUM(bytes) <> 0 OR SUM(record_bytes) <> 0 ORDER BY 1, 2, 3";
}

constexpr std::string_view kComputedHoldings =
    "SELECT tenant, blob, COUNT(*) FROM ("
    "  SELECT tenant, id AS blob FROM assets WHERE deleted_ms = 0"
    "  UNION ALL SELECT tenant, blob FROM results WHERE expired_ms = 0 AND blob <> ''"
    "  UNION ALL SELECT tenant, grid FROM results WHERE expired_ms = 0 AND grid <> ''"
    "  UNION ALL SELECT tenant, sequence FROM results WHERE expired_ms = 0 AND sequence <> ''"
    "  UNION ALL SELECT tenant, grid FROM frames WHERE expired_ms = 0 AND grid <> '') n"
    " GROUP BY tenant, blob ORDER BY 1, 2, 3";

constexpr std::string_view kComputedLiveJobs =
    "SELECT tenant, SUM(queued), SUM(running) FROM ("
    "  SELECT tenant, CASE WHEN state = 'queued' THEN 1 ELSE 0 END AS queued,"
    "         CASE WHEN state = 'running' THEN 1 ELSE 0 END AS running"
    "  FROM jobs WHERE state IN ('queued', 'running')"
    "  UNION ALL SELECT '*', CASE WHEN state = 'queued' THEN 1 ELSE 0 END,"
    "            CASE WHEN state = 'running' THEN 1 ELSE 0 END"
    "  FROM jobs WHERE state IN ('queued', 'running')) n"
    " GROUP BY tenant ORDER BY 1, 2, 3";

}  // namespace

int schema_version() {
  return kSchemaVersion;
}

std::string tables_sql(std::string_view row_number) {
  std::string script;
  for (const std::string_view part : {kAssets, kJobs, kResults, kUsage, kStore}) script += part;
  for (size_t at = script.find(kRowNumber); at != std::string::npos;
       at = script.find(kRowNumber, at)) {
    script.replace(at, kRowNumber.size(), row_number);
  }
  return script;
}

std::span<const DerivedRows> derived_rows() {
  static const std::string usage = computed_usage();
  static const DerivedRows rows[] = {
      {"holdings", "SELECT tenant, blob, refs FROM holdings ORDER BY 1, 2, 3", kComputedHoldings},
      {"tenant_usage",
       "SELECT tenant, bytes, record_bytes FROM tenant_usage WHERE bytes <> 0 OR record_bytes <> 0"
       " ORDER BY 1, 2, 3",
       usage},
      {"live_jobs",
       "SELECT tenant, queued, running FROM live_jobs WHERE queued <> 0 OR running <> 0"
       " ORDER BY 1, 2, 3",
       kComputedLiveJobs},
  };
  return rows;
}

std::span<const CountedTable> counted_tables() {
  return kCountedTables;
}

std::string of_row(std::string_view sql, std::string_view row) {
  std::string text;
  for (const char c : sql) {
    if (c == '@') {
      text += row;
    } else {
      text += c;
    }
  }
  return text;
}

}  // namespace voxeld
