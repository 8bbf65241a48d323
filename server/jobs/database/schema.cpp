#include "server/jobs/database/schema.h"

#include <array>
#include <string>
#include <string_view>

namespace voxeld {
namespace {

// Step n takes a database from user_version n to n + 1. A step that was released never changes.
//
//   assets ─┐                      jobs.asset, jobs.grid name blobs, not rows: a deleted asset
//   keeps results ┼─ jobs ── job_events  its row (deleted_ms), so that asking for it says `gone`.
//           └─ idempotency_keys
//
// jobs.seq is the order of arrival and what the queue is sorted by. jobs.fence grows with each
// claim: a report with an older one is void.
//
// Step 2: frames that jobs have listed, in `results` the sequence that they are together (with the
// job whose rows they are, and their number), and the files of assets that are bundles of others.
// frames.time_s is a decimal text of seconds that reads back exactly. Rows of frames stay as long
// as their job: their grids can be asked for by id.
//
// Step 3: everything has a tenant, '' where the daemon had no keys. Assets are rows of a tenant,
// also those of the same bytes; so are the files of bundles, or uploading a manifest as a plain
// file would tell whether someone else has it as a bundle. jobs.asset_tenant is whose asset it is:
// an admin's job may work on another tenant's. Indexes that tenants are answered by end in
// `tenant`.
//
// Step 4: what the queue is sorted by within a tenant. jobs.deadline_ms is Unix time, the largest
// number where there is none (kNoDeadline). jobs.device_us is for how long it has had its device.
// The indexes begin with a column that is the same in all their entries, or SQLite's planner takes
// jobs_by_state and sorts.
//
// Step 5: what was used last goes last. results.used_ms and assets.used_ms are when somebody last
// asked for them. Of an expired result the row stays, so that asking for it says `gone`; so do its
// rows of frames.
//
// Step 6: whose request submitted a job, for the log and for tracing.
//
// Step 7: what each tenant keeps. A row of `holdings` is a blob that at least one of the tenant's
// assets, results or frames names (`refs` of them), `tenant_usage` is their sum. Triggers on the
// rows that name blobs keep both, so that whoever adds or removes such a row need not know of them;
// expired ones count no more;
// a row whose blob changes must be removed and added, but for frames.grid and assets.deleted_ms.
// `holding_changes` is no table: what is inserted is a step of `refs` up or down. Bytes of -1 are
// not known yet: JobStore::measure_holdings() asks the blob store.
//
// Step 8: jobs that were preempted: how often, how far they had got, and since when they have been
// in the queue again (jobs.queued_ms; 0: since created_ms).
//
// Step 9: one row says which store the database belongs to, and counts its commits
// (store_identity.h), and whether it ever had API keys. aged_ms is when a row was used last, or
// ended, or was deleted, by the clock of retention (kept_clock.h); 0: Retention::note_ages() has
// not seen it yet.
//
// Step 10: rows whose texts are long count towards tenant_usage with what they have above 4096
// bytes (kRowBytesFree in quota.h): options of jobs, meta and warnings of results. `row_changes` is
// no table: what is inserted is a number of bytes more or less.
//
// Step 11: `live_jobs` has the numbers of queued and running jobs of each tenant, and of all under
// '*', which is no tenant's name. Triggers on jobs.state keep them in the transaction of the
// change. `live_changes` is no table: what is inserted is a step up or down.
//
// Step 12: results and frames that their tenant deleted are expired ones with is_deleted = 1.
// holdings_by_size finds the blobs that an upload of a known length can be; live jobs are found by
// what they work on.
constexpr std::array<std::string_view, 13> kSteps = {
    R"sql(
CREATE TABLE assets (
  id TEXT PRIMARY KEY,
  filename TEXT NOT NULL,
  content_type TEXT NOT NULL,
  bytes BIGINT NOT NULL,
  created_ms BIGINT NOT NULL,
  deleted_ms BIGINT NOT NULL DEFAULT 0,
  description_json TEXT NOT NULL DEFAULT ''
);
CREATE INDEX assets_live ON assets (created_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_to_remove ON assets (deleted_ms) WHERE deleted_ms <> 0 AND bytes >= 0;

CREATE TABLE results (
  seq INTEGER PRIMARY KEY AUTOINCREMENT,
  request_hash TEXT NOT NULL,
  blob TEXT NOT NULL,
  bytes BIGINT NOT NULL,
  media_type TEXT NOT NULL,
  filename TEXT NOT NULL,
  grid TEXT NOT NULL,
  meta_json TEXT NOT NULL,
  warnings_json TEXT NOT NULL,
  created_ms BIGINT NOT NULL
);
CREATE INDEX results_by_request ON results (request_hash, seq);
CREATE INDEX results_by_grid ON results (grid) WHERE grid <> '';
CREATE INDEX results_by_blob ON results (blob);

CREATE TABLE jobs (
  seq INTEGER PRIMARY KEY AUTOINCREMENT,
  id TEXT NOT NULL UNIQUE,
  kind TEXT NOT NULL,
  state TEXT NOT NULL,
  asset TEXT NOT NULL,
  grid TEXT NOT NULL,
  filename TEXT NOT NULL,
  options_json TEXT NOT NULL,
  request_hash TEXT NOT NULL,
  use_cache SMALLINT NOT NULL,
  transient SMALLINT NOT NULL,
  cached SMALLINT NOT NULL DEFAULT 0,
  cancel_requested SMALLINT NOT NULL DEFAULT 0,
  version BIGINT NOT NULL DEFAULT 1,
  attempt BIGINT NOT NULL DEFAULT 0,
  fence BIGINT NOT NULL DEFAULT 0,
  worker TEXT NOT NULL DEFAULT '',
  lost_workers TEXT NOT NULL DEFAULT '',
  upload_us BIGINT NOT NULL DEFAULT 0,
  created_ms BIGINT NOT NULL,
  started_ms BIGINT NOT NULL DEFAULT 0,
  ended_ms BIGINT NOT NULL DEFAULT 0,
  timings_json TEXT NOT NULL DEFAULT '[]',
  result_seq BIGINT NOT NULL DEFAULT 0,
  error_code TEXT NOT NULL DEFAULT '',
  error_detail TEXT NOT NULL DEFAULT '',
  error_expected TEXT NOT NULL DEFAULT '',
  error_got TEXT NOT NULL DEFAULT ''
);
CREATE INDEX jobs_queue ON jobs (seq) WHERE state = 'queued';
CREATE INDEX jobs_running ON jobs (seq) WHERE state = 'running';
CREATE INDEX jobs_by_state ON jobs (state, seq);

CREATE TABLE job_events (
  job_id TEXT NOT NULL,
  id BIGINT NOT NULL,
  type TEXT NOT NULL,
  data_json TEXT NOT NULL,
  created_ms BIGINT NOT NULL,
  PRIMARY KEY (job_id, id)
);

CREATE TABLE idempotency_keys (
  idempotency_key TEXT PRIMARY KEY,
  request_hash TEXT NOT NULL,
  job_id TEXT NOT NULL,
  created_ms BIGINT NOT NULL
);
CREATE INDEX idempotency_keys_by_time ON idempotency_keys (created_ms);
)sql",
    R"sql(
ALTER TABLE jobs ADD COLUMN sequence TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN frames_total BIGINT NOT NULL DEFAULT 0;
ALTER TABLE results ADD COLUMN sequence TEXT NOT NULL DEFAULT '';
ALTER TABLE results ADD COLUMN frames BIGINT NOT NULL DEFAULT 0;
ALTER TABLE results ADD COLUMN job_id TEXT NOT NULL DEFAULT '';
CREATE INDEX results_by_sequence ON results (sequence) WHERE sequence <> '';

CREATE TABLE frames (
  job_id TEXT NOT NULL,
  frame BIGINT NOT NULL,
  time_s TEXT NOT NULL,
  grid TEXT NOT NULL,
  voxel_count BIGINT NOT NULL,
  content_hash TEXT NOT NULL,
  PRIMARY KEY (job_id, frame)
);
CREATE INDEX frames_by_grid ON frames (grid);

CREATE TABLE bundle_files (
  bundle TEXT NOT NULL,
  position BIGINT NOT NULL,
  name TEXT NOT NULL,
  asset TEXT NOT NULL,
  PRIMARY KEY (bundle, position)
);
CREATE INDEX bundle_files_by_asset ON bundle_files (asset);
)sql",
    R"sql(
ALTER TABLE jobs ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN asset_tenant TEXT NOT NULL DEFAULT '';
CREATE INDEX jobs_by_tenant ON jobs (tenant, seq);

ALTER TABLE results ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
DROP INDEX results_by_request;
DROP INDEX results_by_grid;
DROP INDEX results_by_sequence;
CREATE INDEX results_by_request ON results (request_hash, tenant, seq);
CREATE INDEX results_by_grid ON results (grid, tenant) WHERE grid <> '';
CREATE INDEX results_by_sequence ON results (sequence, tenant) WHERE sequence <> '';

ALTER TABLE frames ADD COLUMN tenant TEXT NOT NULL DEFAULT '';
DROP INDEX frames_by_grid;
CREATE INDEX frames_by_grid ON frames (grid, tenant);

DROP INDEX assets_live;
DROP INDEX assets_to_remove;
ALTER TABLE assets RENAME TO assets_2;
CREATE TABLE assets (
  tenant TEXT NOT NULL,
  id TEXT NOT NULL,
  filename TEXT NOT NULL,
  content_type TEXT NOT NULL,
  bytes BIGINT NOT NULL,
  created_ms BIGINT NOT NULL,
  deleted_ms BIGINT NOT NULL DEFAULT 0,
  description_json TEXT NOT NULL DEFAULT '',
  PRIMARY KEY (id, tenant)
);
INSERT INTO assets
  SELECT '', id, filename, content_type, bytes, created_ms, deleted_ms, description_json
  FROM assets_2;
DROP TABLE assets_2;
CREATE INDEX assets_live ON assets (tenant, created_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_to_remove ON assets (deleted_ms) WHERE deleted_ms <> 0 AND bytes >= 0;

DROP INDEX bundle_files_by_asset;
ALTER TABLE bundle_files RENAME TO bundle_files_2;
CREATE TABLE bundle_files (
  tenant TEXT NOT NULL,
  bundle TEXT NOT NULL,
  position BIGINT NOT NULL,
  name TEXT NOT NULL,
  asset TEXT NOT NULL,
  PRIMARY KEY (bundle, tenant, position)
);
INSERT INTO bundle_files SELECT '', bundle, position, name, asset FROM bundle_files_2;
DROP TABLE bundle_files_2;
CREATE INDEX bundle_files_by_asset ON bundle_files (asset);

DROP INDEX idempotency_keys_by_time;
ALTER TABLE idempotency_keys RENAME TO idempotency_keys_2;
CREATE TABLE idempotency_keys (
  tenant TEXT NOT NULL,
  idempotency_key TEXT NOT NULL,
  request_hash TEXT NOT NULL,
  job_id TEXT NOT NULL,
  created_ms BIGINT NOT NULL,
  PRIMARY KEY (tenant, idempotency_key)
);
INSERT INTO idempotency_keys
  SELECT '', idempotency_key, request_hash, job_id, created_ms FROM idempotency_keys_2;
DROP TABLE idempotency_keys_2;
CREATE INDEX idempotency_keys_by_time ON idempotency_keys (created_ms);
)sql",
    R"sql(
ALTER TABLE jobs ADD COLUMN priority BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN deadline_ms BIGINT NOT NULL DEFAULT 9223372036854775807;
ALTER TABLE jobs ADD COLUMN device_us BIGINT NOT NULL DEFAULT 0;
CREATE INDEX jobs_queue_by_tenant ON jobs (state, tenant, priority DESC, deadline_ms, seq)
  WHERE state = 'queued';
CREATE INDEX jobs_queue_by_deadline ON jobs (state, deadline_ms) WHERE state = 'queued';
)sql",
    R"sql(
ALTER TABLE results ADD COLUMN used_ms BIGINT NOT NULL DEFAULT 0;
ALTER TABLE results ADD COLUMN expired_ms BIGINT NOT NULL DEFAULT 0;
UPDATE results SET used_ms = created_ms;
CREATE INDEX results_by_use ON results (used_ms, seq) WHERE expired_ms = 0;
CREATE INDEX results_by_job ON results (job_id);

ALTER TABLE assets ADD COLUMN used_ms BIGINT NOT NULL DEFAULT 0;
UPDATE assets SET used_ms = created_ms;
CREATE INDEX assets_by_use ON assets (used_ms) WHERE deleted_ms = 0;
CREATE INDEX assets_gone ON assets (deleted_ms) WHERE bytes < 0;

ALTER TABLE frames ADD COLUMN expired_ms BIGINT NOT NULL DEFAULT 0;
CREATE INDEX frames_kept ON frames (job_id) WHERE expired_ms = 0;

CREATE INDEX jobs_ended ON jobs (ended_ms) WHERE ended_ms <> 0;
CREATE INDEX jobs_by_result ON jobs (result_seq) WHERE result_seq <> 0;
CREATE INDEX idempotency_keys_by_job ON idempotency_keys (job_id);
)sql",
    R"sql(
ALTER TABLE jobs ADD COLUMN request_id TEXT NOT NULL DEFAULT '';
ALTER TABLE jobs ADD COLUMN trace_id TEXT NOT NULL DEFAULT '';
)sql",
    R"sql(
ALTER TABLE results ADD COLUMN grid_bytes BIGINT NOT NULL DEFAULT -1;
ALTER TABLE results ADD COLUMN sequence_bytes BIGINT NOT NULL DEFAULT -1;
ALTER TABLE frames ADD COLUMN bytes BIGINT NOT NULL DEFAULT -1;
CREATE INDEX jobs_queued_by_tenant ON jobs (tenant) WHERE state = 'queued';
CREATE INDEX jobs_running_by_tenant ON jobs (tenant) WHERE state = 'running';

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
CREATE INDEX holdings_to_measure ON holdings (blob) WHERE bytes < 0;

CREATE TRIGGER holdings_insert AFTER INSERT ON holdings BEGIN
  INSERT INTO tenant_usage (tenant, bytes) VALUES (NEW.tenant, MAX(NEW.bytes, 0))
    ON CONFLICT (tenant) DO UPDATE SET bytes = bytes + excluded.bytes;
END;
CREATE TRIGGER holdings_measure AFTER UPDATE OF bytes ON holdings BEGIN
  UPDATE tenant_usage SET bytes = bytes + MAX(NEW.bytes, 0) - MAX(OLD.bytes, 0)
    WHERE tenant = NEW.tenant;
END;
CREATE TRIGGER holdings_delete AFTER DELETE ON holdings BEGIN
  UPDATE tenant_usage SET bytes = bytes - MAX(OLD.bytes, 0) WHERE tenant = OLD.tenant;
END;

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
CREATE TRIGGER frames_expire AFTER UPDATE OF expired_ms ON frames
WHEN OLD.expired_ms = 0 AND NEW.expired_ms <> 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.grid, OLD.bytes, -1);
END;
CREATE TRIGGER frames_insert AFTER INSERT ON frames BEGIN
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.grid, NEW.bytes, 1);
END;
CREATE TRIGGER frames_replace AFTER UPDATE OF grid ON frames BEGIN
  INSERT INTO holding_changes SELECT OLD.tenant, OLD.grid, OLD.bytes, -1 WHERE OLD.expired_ms = 0;
  INSERT INTO holding_changes VALUES (NEW.tenant, NEW.grid, NEW.bytes, 1);
END;
CREATE TRIGGER frames_delete AFTER DELETE ON frames WHEN OLD.expired_ms = 0 BEGIN
  INSERT INTO holding_changes VALUES (OLD.tenant, OLD.grid, OLD.bytes, -1);
END;

INSERT INTO holding_changes SELECT tenant, id, bytes, 1 FROM assets WHERE deleted_ms = 0;
INSERT INTO holding_changes SELECT tenant, blob, bytes, 1 FROM results WHERE expired_ms = 0;
INSERT INTO holding_changes SELECT tenant, grid, grid_bytes, 1 FROM results WHERE expired_ms = 0;
INSERT INTO holding_changes
  SELECT tenant, sequence, sequence_bytes, 1 FROM results WHERE expired_ms = 0;
INSERT INTO holding_changes SELECT tenant, grid, bytes, 1 FROM frames WHERE expired_ms = 0;
)sql",
    R"sql(
ALTER TABLE jobs ADD COLUMN preempted BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN tiles_done BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN tiles_total BIGINT NOT NULL DEFAULT 0;
ALTER TABLE jobs ADD COLUMN queued_ms BIGINT NOT NULL DEFAULT 0;
)sql",
    R"sql(
CREATE TABLE store (
  only_one SMALLINT PRIMARY KEY CHECK (only_one = 1),
  id TEXT NOT NULL,
  generation BIGINT NOT NULL,
  had_keys SMALLINT NOT NULL DEFAULT 0
);

ALTER TABLE results ADD COLUMN aged_ms BIGINT NOT NULL DEFAULT 0;
CREATE INDEX results_to_age ON results (seq) WHERE aged_ms = 0 AND expired_ms = 0;
CREATE INDEX results_by_age ON results (aged_ms, seq) WHERE aged_ms <> 0 AND expired_ms = 0;
CREATE TRIGGER results_use AFTER UPDATE OF used_ms ON results BEGIN
  UPDATE results SET aged_ms = 0 WHERE seq = NEW.seq;
END;

ALTER TABLE assets ADD COLUMN aged_ms BIGINT NOT NULL DEFAULT 0;
CREATE INDEX assets_to_age ON assets (id) WHERE aged_ms = 0;
CREATE INDEX assets_by_age ON assets (aged_ms) WHERE aged_ms <> 0;
CREATE TRIGGER assets_use AFTER UPDATE OF used_ms, deleted_ms ON assets BEGIN
  UPDATE assets SET aged_ms = 0 WHERE id = NEW.id AND tenant = NEW.tenant;
END;

ALTER TABLE jobs ADD COLUMN aged_ms BIGINT NOT NULL DEFAULT 0;
CREATE INDEX jobs_to_age ON jobs (seq) WHERE aged_ms = 0 AND ended_ms <> 0;
CREATE INDEX jobs_by_age ON jobs (aged_ms) WHERE aged_ms <> 0;
)sql",
    R"sql(
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
INSERT INTO row_changes
  SELECT tenant, SUM(MAX(LENGTH(CAST(options_json AS BLOB)) - 4096, 0)) FROM jobs GROUP BY tenant;
INSERT INTO row_changes
  SELECT tenant, SUM(MAX(LENGTH(CAST(meta_json AS BLOB))
                       + LENGTH(CAST(warnings_json AS BLOB)) - 4096, 0))
  FROM results GROUP BY tenant;
)sql",
    R"sql(
DROP INDEX jobs_queued_by_tenant;
DROP INDEX jobs_running_by_tenant;
CREATE TABLE live_jobs (
  tenant TEXT PRIMARY KEY,
  queued BIGINT NOT NULL,
  running BIGINT NOT NULL
);
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
INSERT INTO live_changes
  SELECT tenant, SUM(state = 'queued'), SUM(state = 'running') FROM jobs
  WHERE state IN ('queued', 'running') GROUP BY tenant;
)sql",
    R"sql(
ALTER TABLE results ADD COLUMN is_deleted SMALLINT NOT NULL DEFAULT 0;
ALTER TABLE frames ADD COLUMN is_deleted SMALLINT NOT NULL DEFAULT 0;
CREATE INDEX results_by_tenant ON results (tenant, seq) WHERE expired_ms = 0;
CREATE INDEX holdings_by_size ON holdings (tenant, bytes);
CREATE INDEX jobs_live_by_asset ON jobs (asset)
  WHERE state IN ('queued', 'running') AND asset <> '';
CREATE INDEX jobs_live_by_grid ON jobs (grid) WHERE state IN ('queued', 'running') AND grid <> '';
CREATE INDEX jobs_live_by_sequence ON jobs (sequence)
  WHERE state IN ('queued', 'running') AND sequence <> '';
)sql",
    R"sql(
-- A tenant's list of one state reads no job of another state.
CREATE INDEX jobs_by_tenant_and_state ON jobs (tenant, state, seq);
)sql"};

Result<int64_t> user_version(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement statement, connection.query("PRAGMA user_version"));
  VOXELD_TRY(statement.step());
  return statement.int64(0);
}

}  // namespace

int schema_version() {
  return static_cast<int>(kSteps.size());
}

Status migrate_schema(SqlConnection& connection, int last) {
  VOXELD_ASSIGN(const int64_t present, user_version(connection));
  if (present < 0 || present > schema_version()) {
    return Error{ErrorCode::kInternal, "job database was written by a newer voxeld: schema version",
                 "at most " + std::to_string(schema_version()), std::to_string(present)};
  }
  for (auto step = static_cast<size_t>(present); step < static_cast<size_t>(last); ++step) {
    Status applied =
        connection.run_script("BEGIN IMMEDIATE;" + std::string(kSteps[step]) +
                              "PRAGMA user_version=" + std::to_string(step + 1) + "; COMMIT;");
    if (!applied) {
      if (connection.in_transaction()) VOXELD_TRY(connection.run_script("ROLLBACK"));
      return applied;
    }
  }
  return {};
}

}  // namespace voxeld
