#include "server/jobs/database/sqlite_schema.h"

#include <string>
#include <string_view>
#include <utility>

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

constexpr std::string_view kRowChanges = R"sql(
-- Rows in tenant_usage.
-- No table: what is inserted is a number of bytes more or less.
CREATE VIEW row_changes AS SELECT tenant, bytes, record_bytes FROM tenant_usage;
CREATE TRIGGER row_changes_insert INSTEAD OF INSERT ON row_changes
WHEN NEW.bytes <> 0 OR NEW.record_bytes <> 0 BEGIN
  INSERT INTO tenant_usage (tenant, bytes, record_bytes)
    VALUES (NEW.tenant, NEW.bytes, NEW.record_bytes)
    ON CONFLICT (tenant) DO UPDATE SET
    bytes = bytes + excluded.bytes, record_bytes = record_bytes + excluded.record_bytes;
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

// OCTET_LENGTH(column), everywhere in the text.
std::string with_own_functions(std::string sql) {
  constexpr std::string_view kLength = "OCTET_LENGTH(", kOwnLength = "LENGTH(CAST(",
                             kOwnEnd = " AS BLOB)";
  for (size_t at = sql.find(kLength); at != std::string::npos; at = sql.find(kLength, at)) {
    sql.replace(at, kLength.size(), kOwnLength);
    at = sql.find(')', at);
    sql.insert(at, kOwnEnd);
  }
  return sql;
}

// SQL of the bytes of a row that count under the condition, in tenant_usage.bytes or record_bytes.
std::string bytes_in(const CountedTable& table, std::string_view condition, std::string_view row) {
  return "CASE WHEN " + of_row(condition, row) + " THEN " + of_row(table.bytes, row) +
         " ELSE 0 END";
}

// An expression of the new row, of the old one, or of both: by how much the new one has more.
std::string row_trigger(const CountedTable& table, std::string_view event, bool has_new,
                        bool has_old) {
  const auto change = [&](std::string_view condition) {
    std::string sql = has_new ? bytes_in(table, condition, "NEW.") : "0";
    if (has_old) sql += " - " + bytes_in(table, condition, "OLD.");
    return sql;
  };
  const std::string name(table.name), kind(event.substr(0, event.find(' ')));
  return "CREATE TRIGGER " + name + "_row_" + kind + " AFTER " + std::string(event) + " ON " +
         name + " BEGIN INSERT INTO row_changes VALUES (" + (has_new ? "NEW" : "OLD") +
         ".tenant, " + change(table.counts_if) + ", " + change(table.is_record_if) + "); END;\n";
}

std::string row_triggers() {
  std::string script(kRowChanges);
  for (const CountedTable& table : counted_tables()) {
    script += row_trigger(table, "INSERT", true, false);
    script += row_trigger(table, "DELETE", false, true);
    if (table.changing.empty()) continue;
    script += row_trigger(table, "UPDATE OF " + std::string(table.changing), true, true);
  }
  return with_own_functions(std::move(script));
}

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
  for (const std::string_view part : {kAges, kHoldings, kLiveJobs}) script += part;
  script += row_triggers();
  script += "PRAGMA user_version=" + std::to_string(schema_version()) + "; COMMIT;";
  Status created = connection.run_script(script);
  if (!created && connection.in_transaction()) VOXELD_TRY(connection.run_script("ROLLBACK"));
  return created;
}

}  // namespace voxeld
