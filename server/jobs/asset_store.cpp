#include "server/jobs/asset_store.h"

#include <optional>
#include <utility>

#include "server/base/log.h"
#include "server/jobs/job_record.h"

namespace voxeld {
namespace {

constexpr std::string_view kSelect =
    "SELECT id, filename, content_type, bytes, created_ms, description_json, deleted_ms FROM "
    "assets";

Asset read_asset(const SqlStatement& statement) {
  return {statement.text(0),  statement.text(1),  statement.text(2),
          statement.int64(3), statement.int64(4), statement.text(5)};
}

Result<Asset> load_asset(SqlConnection& connection, std::string_view id) {
  static const std::string sql = std::string(kSelect) + " WHERE id = $1";
  VOXELD_ASSIGN(SqlStatement statement, connection.query(sql, id));
  VOXELD_ASSIGN(const bool found, statement.step());
  if (!found) {
    return Error{ErrorCode::kNotFound, "no such asset", "the id of an uploaded asset",
                 std::string(id.substr(0, 80))};
  }
  if (statement.int64(6) != 0) {
    return Error{ErrorCode::kGone, "asset " + std::string(id) + " was deleted", "", ""};
  }
  return read_asset(statement);
}

// Deleted assets whose blob may still be there and that nothing needs.
Result<std::vector<std::string>> unneeded(SqlConnection& connection) {
  VOXELD_ASSIGN(SqlStatement rows,
                connection.query("SELECT id FROM assets a WHERE deleted_ms <> 0 AND bytes >= 0"
                                 " AND NOT EXISTS (SELECT 1 FROM jobs WHERE asset = a.id"
                                 "                 AND state IN ('queued', 'running'))"
                                 " AND NOT EXISTS (SELECT 1 FROM results WHERE blob = a.id)"
                                 " AND NOT EXISTS (SELECT 1 FROM results WHERE grid = a.id"
                                 "                 AND grid <> '')"));
  std::vector<std::string> ids;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return ids;
    ids.push_back(rows.text(0));
  }
}

}  // namespace

Result<Asset> AssetStore::put(const BlobInfo& blob, const std::string& filename,
                              const std::string& content_type) {
  std::optional<Asset> asset;
  Status committed = database_.write([&](SqlConnection& connection) -> Status {
    if (!blobs_.stat(blob.id)) {
      return Error{ErrorCode::kConflict,
                   "the asset was deleted while it was uploaded; send it again", "", ""};
    }
    VOXELD_TRY(connection.run(
        "INSERT INTO assets (id, filename, content_type, bytes, created_ms)"
        " VALUES ($1, $2, $3, $4, $5) ON CONFLICT (id) DO UPDATE SET"
        " filename = CASE WHEN excluded.filename <> '' THEN excluded.filename"
        "            ELSE assets.filename END,"
        " content_type = CASE WHEN excluded.content_type <> '' THEN excluded.content_type"
        "                ELSE assets.content_type END,"
        " bytes = excluded.bytes, deleted_ms = 0",
        blob.id, filename, content_type, blob.bytes, unix_time_ms()));
    VOXELD_ASSIGN(asset, load_asset(connection, blob.id));
    return {};
  });
  VOXELD_TRY(committed);
  return *std::move(asset);
}

Result<Asset> AssetStore::get(std::string_view id) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return load_asset(*reader, id);
}

Result<std::vector<Asset>> AssetStore::list(int limit) {
  static const std::string sql =
      std::string(kSelect) + " WHERE deleted_ms = 0 ORDER BY created_ms DESC, id LIMIT $1";
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement rows, reader->query(sql, int64_t{limit}));
  std::vector<Asset> assets;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return assets;
    assets.push_back(read_asset(rows));
  }
}

Status AssetStore::mark_deleted(std::string_view id) {
  return database_.write([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(load_asset(connection, id));
    return connection.run("UPDATE assets SET deleted_ms = $2 WHERE id = $1", id, unix_time_ms());
  });
}

Result<int64_t> AssetStore::remove_unneeded() {
  {
    // Mostly there is nothing to do, and reading is cheap.
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(const auto ids, unneeded(*reader));
    if (ids.empty()) return int64_t{0};
  }
  int64_t removed = 0;
  Status committed = database_.write([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto ids, unneeded(connection));
    for (const std::string& id : ids) {
      if (Status gone = blobs_.remove(id); !gone && gone.error().code != ErrorCode::kNotFound) {
        log::warn("cannot remove the blob of a deleted asset",
                  {{"asset", id}, {"error", gone.error().message()}});
        continue;
      }
      // A negative size says that the bytes are gone, so that this row is not looked at again.
      VOXELD_TRY(connection.run("UPDATE assets SET bytes = -1 WHERE id = $1", id));
      ++removed;
    }
    return {};
  });
  VOXELD_TRY(committed);
  return removed;
}

}  // namespace voxeld
