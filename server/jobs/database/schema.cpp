#include "server/jobs/database/schema.h"

#include <string>
#include <string_view>

namespace voxeld {
namespace {

// The schema that this program reads and writes (PRAGMA user_version).
constexpr int kSchemaVersion = 1;

//   assets ─┐                            jobs.asset, jobs.grid and jobs.sequence name blobs, not
//   results ┼─ jobs ─┬─ job_events       rows: a deleted asset keeps its row (deleted_ms), so that
//   frames ─┘        └─ idempotency_keys asking for it says `gone`.
//
// Every row has a tenant, '' where the daemon has no keys. Indexes that answer tenants end in
// `tenant`, so that rows of others are not even read. Times (…_ms) are Unix time in milliseconds;
// 0: not yet.
constexpr std::string_view kAssets = R"sql(
-- Uploads. The same bytes of two tenants are two rows. A deleted asset whose blob is gone has bytes
-- of -1. aged_ms: when it was used or deleted last, by the clock of retention (kept_clock.h);
-- 0: Retention::note_ages() has not seen that yet.
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
  PRIMARY KEY (id, tenant)
);
CREATE INDEX assets_live ON assets (tenant, created_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_to_remove ON assets (deleted_ms) WHERE deleted_ms <> 0 AND bytes >= 0;
CREATE INDEX assets_by_use ON assets (used_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_gone ON assets (deleted_ms) WHERE bytes < 0;
CREATE INDEX assets_to_age ON assets (id) WHERE aged_ms = 0;
CREATE INDEX assets_by_age ON assets (aged_ms) WHERE aged_ms <> 0;
CREATE TRIGGER assets_use AFTER UPDATE OF used_ms, deleted_ms ON assets BEGIN
  UPDATE assets SET aged_ms = 0 WHERE id = NEW.id AND tenant = NEW.tenant;
END;

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
-- asset_tenant: whose asset it is; an admin's job may work on another tenant's. deadline_ms: the
-- largest number where there is none (kNoDeadline). device_us: for how long it has had its device.
-- queued_ms: since when it has been in the queue again, once it was preempted; 0: since created_ms.
CREATE TABLE jobs (
  seq INTEGER PRIMARY KEY AUTOINCREMENT,
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
CREATE INDEX jobs_by_result ON jobs (result_seq) WHERE result_seq <> 0;
CREATE INDEX jobs_to_age ON jobs (seq) WHERE aged_ms = 0 AND ended_ms <> 0;
CREATE INDEX jobs_by_age ON jobs (aged_ms) WHERE aged_ms <> 0;

CREATE TABLE job_events (
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
  seq INTEGER PRIMARY KEY AUTOINCREMENT,
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
CREATE TRIGGER results_use AFTER UPDATE OF used_ms ON results BEGIN
  UPDATE results SET aged_ms = 0 WHERE seq = NEW.seq;
END;

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
-- tenant's assets, results or frames names (`refs` of them); `tenant_usage` is their sum. Triggers
-- on the rows that name blobs maintain both, so that code that adds or removes such a row need not
-- know of them; expired rows do not count. A row whose blob changes must be removed and added,
-- except for frames.grid and assets.deleted_ms.
CREATE TABLE tenant_usage (
  tenant TEXT PRIMARY KEY,
  bytes BIGINT NOT NULL
);
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
CREATE TRIGGER holdings_insert AFTER INSERT ON holdings BEGIN
  INSERT INTO tenant_usage (tenant, bytes) VALUES (NEW.tenant, MAX(NEW.bytes, 0))
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER holdings_delete AFTER DELETE ON holdings BEGIN
  UPDATE tenant_usage SET bytes = bytes - MAX(OLD.bytes, 0) WHERE tenant = OLD.tenant;
END;

-- No table: what is inserted is a step of `refs` up or down.
CREATE VIEW holding_changes AS SELECT tenant, blob, bytes, refs AS step FROM holdings;
CREATE TRIGGER holding_changes_insert INSTEAD OF INSERT ON holding_changes
WHEN NEW.blob <> '' BEGIN
  INSERT INTO holdings (tenant, blob, bytes, refs)
    VALUES (NEW.tenant, NEW.blob, NEW.bytes, NEW.step)
    ON CONFLICT (tenant, blob) DO UPDATE SET refs = refs + excluded.refs;
  DELETE FROM holdings WHERE tenant = NEW.tenant AND blob = NEW.blob AND refs <= 0;
END;
CREATE TRIGGER assets_insert AFTER INSERT ON assets WHEN NEW.deleted_ms = 0 BEGIN
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.id, NEW.bytes, 1);
END;
CREATE TRIGGER assets_restore AFTER UPDATE OF deleted_ms ON assets
WHEN OLD.deleted_ms <> 0 AND NEW.deleted_ms = 0 BEGIN
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.id, NEW.bytes, 1);
END;
CREATE TRIGGER assets_mark_deleted AFTER UPDATE OF deleted_ms ON assets
WHEN OLD.deleted_ms = 0 AND NEW.deleted_ms <> 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.id, OLD.bytes, -1);
END;
CREATE TRIGGER assets_delete AFTER DELETE ON assets WHEN OLD.deleted_ms = 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.id, OLD.bytes, -1);
END;
CREATE TRIGGER results_insert AFTER INSERT ON results BEGIN
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.blob, NEW.bytes, 1);
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.grid, NEW.grid_bytes, 1);
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.sequence, NEW.sequence_bytes, 1);
END;
CREATE TRIGGER results_delete AFTER DELETE ON results WHEN OLD.expired_ms = 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.blob, OLD.bytes, -1);
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.grid, OLD.grid_bytes, -1);
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.sequence, OLD.sequence_bytes, -1);
END;
CREATE TRIGGER results_expire AFTER UPDATE OF expired_ms ON results
WHEN OLD.expired_ms = 0 AND NEW.expired_ms <> 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.blob, OLD.bytes, -1);
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.grid, OLD.grid_bytes, -1);
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.sequence, OLD.sequence_bytes, -1);
END;
CREATE TRIGGER frames_insert AFTER INSERT ON frames BEGIN
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.grid, NEW.bytes, 1);
END;
CREATE TRIGGER frames_replace AFTER UPDATE OF grid ON frames BEGIN
  INSERT INTO holding_changes SELECT OLD.tenant, OLD.grid, OLD.bytes, -1 WHERE OLD.expired_ms = 0;
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.grid, NEW.bytes, 1);
END;
CREATE TRIGGER frames_expire AFTER UPDATE OF expired_ms ON frames
WHEN OLD.expired_ms = 0 AND NEW.expired_ms <> 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.grid, OLD.bytes, -1);
END;
CREATE TRIGGER frames_delete AFTER DELETE ON frames WHEN OLD.expired_ms = 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.grid, OLD.bytes, -1);
END;

-- Rows whose texts are long (options of jobs, meta and warnings of results) count towards
-- tenant_usage with their bytes above 4096 (kRowBytesFree in quota.h). No table: what is inserted
-- is a number of bytes more or less.
CREATE VIEW row_changes AS SELECT tenant, bytes FROM tenant_usage;
CREATE TRIGGER row_changes_insert INSTEAD OF INSERT ON row_changes WHEN NEW.bytes <> 0 BEGIN
  INSERT INTO tenant_usage (tenant, bytes) VALUES (NEW.tenant, NEW.bytes)
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER jobs_row_insert AFTER INSERT ON jobs BEGIN
  INSERT INTO row_changes
    VALUES (NEW.tenant, MAX(LENGTH(CAST(NEW.options_json AS BLOB)) - 4096, 0));
END;
CREATE TRIGGER jobs_row_change AFTER UPDATE OF options_json ON jobs BEGIN
  INSERT INTO row_changes
    VALUES (NEW.tenant, MAX(LENGTH(CAST(NEW.options_json AS BLOB)) - 4096, 0)
                      - MAX(LENGTH(CAST(OLD.options_json AS BLOB)) - 4096, 0));
END;
CREATE TRIGGER jobs_row_delete AFTER DELETE ON jobs BEGIN
  INSERT INTO row_changes
    VALUES (OLD.tenant, -MAX(LENGTH(CAST(OLD.options_json AS BLOB)) - 4096, 0));
END;
CREATE TRIGGER results_row_insert AFTER INSERT ON results BEGIN
  INSERT INTO row_changes
    VALUES (NEW.tenant, MAX(LENGTH(CAST(NEW.meta_json AS BLOB))
                          + LENGTH(CAST(NEW.warnings_json AS BLOB)) - 4096, 0));
END;
CREATE TRIGGER results_row_change AFTER UPDATE OF meta_json, warnings_json ON results BEGIN
  INSERT INTO row_changes
    VALUES (NEW.tenant, MAX(LENGTH(CAST(NEW.meta_json AS BLOB))
                          + LENGTH(CAST(NEW.warnings_json AS BLOB)) - 4096, 0)
                      - MAX(LENGTH(CAST(OLD.meta_json AS BLOB))
                          + LENGTH(CAST(OLD.warnings_json AS BLOB)) - 4096, 0));
END;
CREATE TRIGGER results_row_delete AFTER DELETE ON results BEGIN
  INSERT INTO row_changes
    VALUES (OLD.tenant, -MAX(LENGTH(CAST(OLD.meta_json AS BLOB))
                           + LENGTH(CAST(OLD.warnings_json AS BLOB)) - 4096, 0));
END;

-- The numbers of queued and running jobs of each tenant, and of all under '*', which is no tenant's
-- name. Triggers on jobs.state maintain them in the transaction of the change.
CREATE TABLE live_jobs (
  tenant TEXT PRIMARY KEY,
  queued BIGINT NOT NULL,
  running BIGINT NOT NULL
);
-- No table: what is inserted is a step up or down.
CREATE VIEW live_changes AS SELECT tenant, queued, running FROM live_jobs;
CREATE TRIGGER live_changes_insert INSTEAD OF INSERT ON live_changes
WHEN NEW.queued <> 0 OR NEW.running <> 0 BEGIN
  INSERT INTO live_jobs VALUES (NEW.tenant, NEW.queued, NEW.running)
    ON CONFLICT (tenant) DO UPDATE SET
    queued = queued + excluded.queued, running = running + excluded.running;
  INSERT INTO live_jobs VALUES ('*', NEW.queued, NEW.running)
    ON CONFLICT (tenant) DO UPDATE SET
    queued = queued + excluded.queued, running = running + excluded.running;
END;
CREATE TRIGGER jobs_live_insert AFTER INSERT ON jobs BEGIN
  INSERT INTO live_changes VALUES (NEW.tenant, NEW.state = 'queued', NEW.state = 'running');
END;
CREATE TRIGGER jobs_live_change AFTER UPDATE OF state ON jobs BEGIN
  INSERT INTO live_changes
    VALUES (NEW.tenant, (NEW.state = 'queued') - (OLD.state = 'queued'),
            (NEW.state = 'running') - (OLD.state = 'running'));
END;
CREATE TRIGGER jobs_live_delete AFTER DELETE ON jobs BEGIN
  INSERT INTO live_changes VALUES (OLD.tenant, -(OLD.state = 'queued'), -(OLD.state = 'running'));
END;
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

Result<int64_t> user_version(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement statement, connection.query("PRAGMA user_version"));
  VOXELD_TRY(statement.step());
  return statement.int64(0);
}

}  // namespace

int schema_version() {
  return kSchemaVersion;
}

Status create_schema(SqlConnection& connection) {
  VOXELD_ASSIGN(const int64_t present, user_version(connection));
  if (present == kSchemaVersion) return {};
  if (present != 0) {
    return Error{ErrorCode::kInternal, "job database was written by another voxeld: schema version",
                 std::to_string(kSchemaVersion), std::to_string(present)};
  }
  std::string script = "BEGIN IMMEDIATE;";
  for (const std::string_view part : {kAssets, kJobs, kResults, kUsage, kStore}) script += part;
  script += "PRAGMA user_version=" + std::to_string(kSchemaVersion) + "; COMMIT;";
  Status created = connection.run_script(script);
  if (!created && connection.in_transaction()) VOXELD_TRY(connection.run_script("ROLLBACK"));
  return created;
}

}  // namespace voxeld
