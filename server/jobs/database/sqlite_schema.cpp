#include "server/jobs/database/sqlite_schema.h"

#include <string>
#include <string_view>

#include "server/jobs/database/tables.h"

namespace voxeld {
namespace {

// Triggers use nothing but SQLite's own functions, so that other programs can change rows as well:
// LENGTH(CAST(text AS BLOB)) is OCTET_LENGTH(text).
constexpr std::string_view kAges = R"sql(
-- aged_ms of what was used or deleted.
CREATE TRIGGER assets_use AFTER UPDATE OF used_ms, deleted_ms ON assets BEGIN
  UPDATE assets SET aged_ms = 0 WHERE id = NEW.id AND tenant = NEW.tenant;
END;
CREATE TRIGGER results_use AFTER UPDATE OF used_ms ON results BEGIN
  UPDATE results SET aged_ms = 0 WHERE seq = NEW.seq;
END;
)sql";

constexpr std::string_view kHoldings = R"sql(
-- The tables holdings and tenant_usage.
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
)sql";

constexpr std::string_view kRowBytes = R"sql(
-- Long texts in tenant_usage.
-- No table: what is inserted is a number of bytes more or less.
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
)sql";

constexpr std::string_view kLiveJobs = R"sql(
-- The table live_jobs.
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

}  // namespace

Result<int64_t> sqlite_schema_version(SqliteConnection& connection) {
  VOXELD_ASSIGN(SqlStatement statement, connection.query("PRAGMA user_version"));
  VOXELD_TRY(statement.step());
  return statement.int64(0);
}

Status create_sqlite_schema(SqliteConnection& connection) {
  VOXELD_ASSIGN(const int64_t present, sqlite_schema_version(connection));
  if (present == schema_version()) return {};
  if (present != 0) {
    return Error{ErrorCode::kInternal, "job database was written by another voxeld: schema version",
                 std::to_string(schema_version()), std::to_string(present)};
  }
  std::string script = "BEGIN IMMEDIATE;" + tables_sql("INTEGER PRIMARY KEY AUTOINCREMENT");
  for (const std::string_view part : {kAges, kHoldings, kRowBytes, kLiveJobs}) script += part;
  script += "PRAGMA user_version=" + std::to_string(schema_version()) + "; COMMIT;";
  Status created = connection.run_script(script);
  if (!created && connection.in_transaction()) VOXELD_TRY(connection.run_script("ROLLBACK"));
  return created;
}

}  // namespace voxeld
