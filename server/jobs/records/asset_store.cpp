#include "server/jobs/records/asset_store.h"

#include <optional>
#include <set>
#include <utility>

#include "proto/asset_id.h"
#include "server/base/clock.h"
#include "server/jobs/model/assets.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/records/quota.h"

namespace voxeld {
namespace {

constexpr std::string_view kSelect =
    "SELECT id, tenant, filename, content_type, bytes, created_ms, description_json, deleted_ms"
    " FROM assets";
constexpr int kDeletedColumn = 7;

Asset read_asset(const SqlStatement& statement) {
  Asset asset;
  asset.id = statement.text(0);
  asset.tenant = statement.text(1);
  asset.filename = statement.text(2);
  asset.content_type = statement.text(3);
  asset.bytes = statement.int64(4);
  asset.created_ms = statement.int64(5);
  asset.description_json = statement.text(6);
  return asset;
}

Result<SqlStatement> select_asset(SqlConnection& connection, const Caller& caller,
                                  std::string_view id) {
  static const std::string own = std::string(kSelect) + " WHERE id = $1 AND tenant = $2";
  static const std::string any =
      std::string(kSelect) +
      " WHERE id = $1 ORDER BY deleted_ms <> 0, tenant <> $2, created_ms DESC LIMIT 1";
  return connection.query(caller.sees_all() ? any : own, id, caller.tenant());
}

// A row of an asset that is deleted.
struct DeletedAsset {
  std::string id, tenant;
};

// Deleted assets that nobody has looked at since, and that no live job of their tenant needs.
Result<std::vector<DeletedAsset>> deleted_assets(SqlConnection& connection) {
  VOXELD_ASSIGN(
      SqlStatement rows,
      connection.query("SELECT a.id, a.tenant FROM assets a WHERE a.deleted_ms <> 0"
                       " AND a.bytes >= 0"
                       " AND NOT EXISTS (SELECT 1 FROM jobs n WHERE n.asset = a.id"
                       "   AND n.asset <> '' AND n.asset_tenant = a.tenant"
                       "   AND n.state IN ('queued', 'running'))"
                       " AND NOT EXISTS (SELECT 1 FROM bundle_files b JOIN jobs n"
                       "   ON n.asset = b.bundle WHERE b.asset = a.id AND b.tenant = a.tenant"
                       "   AND n.asset <> '' AND n.asset_tenant = a.tenant"
                       "   AND n.state IN ('queued', 'running'))"));
  std::vector<DeletedAsset> assets;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return assets;
    assets.push_back({rows.text(0), rows.text(1)});
  }
}

// The rest of the row only records that the asset was deleted.
Status keep_record(SqlConnection& connection, const DeletedAsset& asset) {
  VOXELD_TRY(connection.run("DELETE FROM bundle_files WHERE bundle = $1 AND tenant = $2", asset.id,
                            asset.tenant));
  return connection.run(
      "UPDATE assets SET bytes = -1, filename = '', content_type = '', description_json = '',"
      " files_bytes = 0 WHERE id = $1 AND tenant = $2",
      asset.id, asset.tenant);
}

// The asset that the caller's tenant has of these bytes already.
Result<std::optional<Asset>> find_own(SqlConnection& connection, const Caller& caller,
                                      std::string_view blob) {
  static const std::string sql =
      std::string(kSelect) + " WHERE id = $1 AND tenant = $2 AND deleted_ms = 0";
  VOXELD_ASSIGN(SqlStatement found, connection.query(sql, blob, caller.tenant()));
  VOXELD_ASSIGN(const bool is_there, found.step());
  return is_there ? std::optional(read_asset(found)) : std::nullopt;
}

// Writes the row of new bytes, or of ones that were deleted; of others what they are called.
Status put_row(SqlConnection& connection, const ObjectStore& blobs, const Caller& caller,
               const BlobInfo& blob, std::string_view filename, std::string_view content_type) {
  if (!blobs.stat(blob.id)) {
    return Error{ErrorCode::kConflict, "the asset was deleted while it was uploaded; send it again",
                 "", ""};
  }
  return connection.run(
      "INSERT INTO assets (id, filename, content_type, bytes, created_ms, tenant, used_ms)"
      " VALUES ($1, $2, $3, $4, $5, $6, $5) ON CONFLICT (id, tenant) DO UPDATE SET"
      " filename = excluded.filename, content_type = excluded.content_type,"
      " description_json = CASE WHEN assets.deleted_ms <> 0 THEN ''"
      "                    ELSE assets.description_json END,"
      " bytes = excluded.bytes, deleted_ms = 0, used_ms = excluded.used_ms",
      blob.id, filename, content_type, blob.bytes, unix_time_ms(), caller.tenant());
}

// Registers the blob under a name, beside what the tenant calls it already. The name of an asset
// changes only to one that is read alike: jobs that name none go by it.
Result<Asset> put_named(SqlConnection& connection, const ObjectStore& blobs, const Caller& caller,
                        const BlobInfo& blob, const std::string& filename,
                        const std::string& content_type) {
  VOXELD_ASSIGN(const std::optional<Asset> earlier, find_own(connection, caller, blob.id));
  const bool is_other = earlier && reading_of(earlier->filename) != reading_of(filename);
  const bool keeps_name = is_other || (earlier && filename.empty());
  const bool keeps_type = is_other || (earlier && content_type.empty());
  VOXELD_TRY(put_row(connection, blobs, caller, blob, keeps_name ? earlier->filename : filename,
                     keeps_type ? earlier->content_type : content_type));
  AssetId id{blob.id, std::nullopt};
  if (is_other) id.reading = reading_of(filename);
  const Caller owner = Caller::tenant(caller.tenant(), /*is_admin=*/false);
  VOXELD_ASSIGN(Asset asset, load_asset(connection, owner, id.text()));
  if (is_other) {
    if (!filename.empty()) asset.filename = filename;
    asset.content_type = content_type;
  }
  asset.existed = earlier.has_value();
  return asset;
}

Result<std::vector<BundleFile>> read_files(SqlStatement rows) {
  std::vector<BundleFile> files;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return files;
    files.push_back({rows.text(0), rows.text(1)});
  }
}

Result<std::vector<BundleFile>> load_bundle(SqlConnection& connection, std::string_view tenant,
                                            std::string_view id) {
  VOXELD_ASSIGN(SqlStatement rows,
                connection.query("SELECT name, asset FROM bundle_files"
                                 " WHERE bundle = $1 AND tenant = $2 ORDER BY position",
                                 id, tenant));
  return read_files(std::move(rows));
}

// The files that are not plainly an asset of the tenant, or are a bundle; mostly none. A bundle has
// up to limits::kBundleEntriesMax files, and each submission looks at them.
Result<std::vector<BundleFile>> doubtful_files(SqlConnection& connection, std::string_view tenant,
                                               std::string_view id) {
  VOXELD_ASSIGN(SqlStatement rows,
                connection.query("SELECT name, asset FROM bundle_files b"
                                 " WHERE bundle = $1 AND tenant = $2"
                                 " AND (NOT EXISTS (SELECT 1 FROM assets a WHERE a.id = b.asset"
                                 "   AND a.tenant = b.tenant AND a.deleted_ms = 0)"
                                 " OR EXISTS (SELECT 1 FROM bundle_files n"
                                 "   WHERE n.bundle = b.asset AND n.tenant = b.tenant))"
                                 " ORDER BY position",
                                 id, tenant));
  return read_files(std::move(rows));
}

// Files of a bundle are its tenant's own, also where an admin looks at it.
Status check_bundle_file(SqlConnection& connection, std::string_view tenant,
                         const BundleFile& file) {
  const std::string what = "bundle file \"" + file.name + "\": ";
  const Caller owner = Caller::tenant(std::string(tenant), /*is_admin=*/false);
  if (auto asset = load_asset(connection, owner, file.asset); !asset) {
    Error error = std::move(asset).error();
    error.detail = what + error.detail;
    return error;
  }
  VOXELD_ASSIGN(const auto inner, load_bundle(connection, tenant, file.asset));
  if (inner.empty()) return {};
  return Error{ErrorCode::kMalformedBundle, what + "it is a bundle itself", "a file", file.asset};
}

// Bytes that the rows of a bundle's files take on the disk, as CountedTable::bytes.
int64_t bytes_of_rows(const std::vector<BundleFile>& files) {
  constexpr int64_t kRowBytes = 384;
  int64_t bytes = 0;
  for (const BundleFile& file : files) bytes += kRowBytes + std::ssize(file.name);
  return bytes;
}

// A manifest's rows; those of the same bytes are the same.
Status put_files(SqlConnection& connection, std::string_view tenant, std::string_view bundle,
                 const std::vector<BundleFile>& files) {
  VOXELD_TRY(
      connection.run("DELETE FROM bundle_files WHERE bundle = $1 AND tenant = $2", bundle, tenant));
  for (size_t i = 0; i < files.size(); ++i) {
    VOXELD_TRY(check_bundle_file(connection, tenant, files[i]));
    VOXELD_TRY(
        connection.run("INSERT INTO bundle_files (tenant, bundle, position, name, asset)"
                       " VALUES ($1, $2, $3, $4, $5)",
                       tenant, bundle, static_cast<int64_t>(i), files[i].name, files[i].asset));
  }
  return {};
}

}  // namespace

Result<Asset> load_asset(SqlConnection& connection, const Caller& caller, std::string_view id) {
  const AssetId named = AssetId::parse(id);
  VOXELD_ASSIGN(SqlStatement statement, select_asset(connection, caller, named.blob));
  VOXELD_ASSIGN(const bool found, statement.step());
  if (!found) {
    return Error{ErrorCode::kNotFound, "no such asset", "the id of an uploaded asset",
                 std::string(id.substr(0, 80))};
  }
  if (statement.int64(kDeletedColumn) != 0) {
    return Error{ErrorCode::kGone, "asset " + named.blob + " was deleted", "", ""};
  }
  Asset asset = read_asset(statement);
  if (named.reading && *named.reading != reading_of(asset.filename)) {
    asset.id = named.text();
    asset.filename = filename_read_as(asset.filename, *named.reading);
    asset.description_json.clear();
  }
  return asset;
}

Status check_bundle(SqlConnection& connection, std::string_view tenant, std::string_view id) {
  VOXELD_ASSIGN(const auto files, doubtful_files(connection, tenant, id));
  for (const BundleFile& file : files) VOXELD_TRY(check_bundle_file(connection, tenant, file));
  return {};
}

Result<Asset> AssetStore::put(const Caller& caller, const BlobInfo& blob,
                              const std::string& filename, const std::string& content_type,
                              int64_t bytes_max, Durability durability) {
  std::optional<Asset> asset;
  const auto put_it = [&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const int64_t used, used_bytes(connection, caller.tenant()));
    VOXELD_ASSIGN(asset, put_named(connection, blobs_, caller, blob, filename, content_type));
    return check_growth(connection, caller.tenant(), used, bytes_max);
  };
  const Status committed = database_.write(put_it, durability);
  VOXELD_TRY(committed);
  return *std::move(asset);
}

Result<Asset> AssetStore::put_bundle(const Caller& caller, const BlobInfo& blob,
                                     const std::string& filename,
                                     const std::vector<BundleFile>& files, int64_t bytes_max,
                                     Durability durability) {
  std::optional<Asset> asset;
  const auto put_it = [&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const int64_t used, used_bytes(connection, caller.tenant()));
    VOXELD_TRY(put_files(connection, caller.tenant(), blob.id, files));
    VOXELD_ASSIGN(asset, put_named(connection, blobs_, caller, blob, filename,
                                   std::string(kBundleMediaType)));
    VOXELD_TRY(connection.run("UPDATE assets SET files_bytes = $3 WHERE id = $1 AND tenant = $2",
                              blob.id, caller.tenant(), bytes_of_rows(files)));
    return check_growth(connection, caller.tenant(), used, bytes_max);
  };
  const Status committed = database_.write(put_it, durability);
  VOXELD_TRY(committed);
  return *std::move(asset);
}

Result<std::vector<BundleFile>> AssetStore::bundle_files(std::string_view tenant,
                                                         std::string_view id) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return load_bundle(*reader, tenant, id);
}

Result<Asset> AssetStore::get(const Caller& caller, std::string_view id) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return load_asset(*reader, caller, id);
}

Status AssetStore::list(const Caller& caller, const AssetCursor& after,
                        const std::function<bool(const Asset&)>& take) {
  static const std::string select =
      "SELECT id, tenant, filename, content_type, bytes, created_ms, '' FROM assets";
  static const std::string end =
      " AND deleted_ms = 0 AND created_ms <= $2"
      " AND (created_ms < $2 OR id > $3 OR (id = $3 AND tenant > $4))"
      " ORDER BY created_ms DESC, id, tenant";
  static const std::string own = select + " WHERE tenant = $1" + end;
  static const std::string any = select + " WHERE $1 = $1" + end;
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement rows, reader->query(caller.sees_all() ? any : own, caller.tenant(),
                                                 after.created_ms, after.id, after.tenant));
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row || !take(read_asset(rows))) return {};
  }
}

Status AssetStore::mark_deleted(const Caller& caller, std::string_view id) {
  constexpr std::string_view kOwn =
      "UPDATE assets SET deleted_ms = $2 WHERE id = $1 AND deleted_ms = 0 AND tenant = $3";
  constexpr std::string_view kAny =
      "UPDATE assets SET deleted_ms = $2 WHERE id = $1 AND deleted_ms = 0 AND $3 = $3";
  return database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(load_asset(connection, caller, id));
    return connection.run(caller.sees_all() ? kAny : kOwn, AssetId::parse(id).blob, unix_time_ms(),
                          caller.tenant());
  });
}

std::function<Status(const std::string&)> AssetStore::remove_blob() {
  return [this](const std::string& id) { return blobs_.remove(id); };
}

Result<int64_t> AssetStore::remove_unneeded() {
  {
    // Mostly there is nothing to do, and reading is cheap.
    VOXELD_ASSIGN(Database::Lease reader, database_.read());
    VOXELD_ASSIGN(const auto deleted, deleted_assets(*reader));
    if (deleted.empty()) return int64_t{0};
  }
  int64_t done = 0;
  Status committed = database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_ASSIGN(const auto deleted, deleted_assets(connection));
    std::set<std::string> ids;
    for (const DeletedAsset& asset : deleted) ids.insert(asset.id);
    VOXELD_ASSIGN(const auto removed,
                  remove_blobs(connection, database_, {ids.begin(), ids.end()}, remove_blob()));
    const std::set<std::string> gone(removed.begin(), removed.end());
    for (const DeletedAsset& asset : deleted) {
      // Whoever keeps the blob lets it go.
      VOXELD_ASSIGN(const bool is_kept, is_needed(connection, asset.id));
      if (!is_kept && !gone.contains(asset.id)) continue;
      VOXELD_TRY(keep_record(connection, asset));
      ++done;
    }
    return {};
  });
  VOXELD_TRY(committed);
  return done;
}

Status AssetStore::remove_unnamed(const std::vector<std::string>& ids) {
  return database_.write_freeing([&](SqlConnection& connection) -> Status {
    VOXELD_TRY(remove_blobs(connection, database_, ids, remove_blob()));
    return {};
  });
}

}  // namespace voxeld
