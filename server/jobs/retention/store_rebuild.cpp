#include "server/jobs/retention/store_rebuild.h"

#include <algorithm>
#include <map>
#include <system_error>
#include <utility>
#include <variant>
#include <vector>

#include "proto/limits.h"
#include "proto/messages/bundle_manifest.h"
#include "proto/messages/sequence.h"
#include "proto/options/options.h"
#include "server/base/clock.h"
#include "server/base/disk/file.h"
#include "server/jobs/auth/api_key.h"
#include "server/jobs/auth/key_file.h"
#include "server/jobs/model/caller.h"
#include "server/jobs/model/store_limits.h"
#include "server/jobs/records/asset_store.h"
#include "server/jobs/records/blob_needs.h"
#include "server/jobs/retention/store_identity.h"
#include "server/store/data_dir.h"

namespace voxeld {
namespace {

namespace fs = std::filesystem;
using namespace std::string_view_literals;

// Begins a format that only jobs write: nobody uploads it.
constexpr std::string_view kSequenceHead = "VOXSEQ\0\0"sv;
constexpr std::string_view kGridHead = "VOXGRID\0"sv;
// A local file header of a zip; the name of the file stands behind its 30 bytes.
constexpr std::string_view kZipHead = "PK\3\4"sv;
constexpr size_t kZipNameLengthAt = 26, kZipNameAt = 30;
// Manifests of the longest sequences have some megabytes; a larger JSON file is a glTF.
constexpr size_t kManifestBytesMax = size_t{64} << 20;

struct AssetBlob {};
struct GridBlob {};
struct OutputBlob {};
using BundleBlob = std::vector<BundleFile>;
using SequenceBlob = SequenceManifest;
using BlobKind = std::variant<AssetBlob, GridBlob, OutputBlob, BundleBlob, SequenceBlob>;

// .npz is a zip, too: of arrays alone.
bool is_npz(std::string_view bytes) {
  if (!bytes.starts_with(kZipHead) || bytes.size() < kZipNameAt) return false;
  const auto byte = [&](size_t at) { return static_cast<uint8_t>(bytes[at]); };
  const size_t length = byte(kZipNameLengthAt) + size_t{256} * byte(kZipNameLengthAt + 1);
  return bytes.substr(kZipNameAt, length).ends_with(".npy");
}

BlobKind kind_of(std::string_view bytes) {
  if (bytes.starts_with(kGridHead)) return GridBlob();
  if (bytes.starts_with(kSequenceHead) || is_npz(bytes)) return OutputBlob();
  if (!bytes.starts_with('{') || bytes.size() > kManifestBytesMax) return AssetBlob();
  if (auto sequence = parse_sequence(bytes)) return *std::move(sequence);
  if (bytes.size() <= static_cast<size_t>(limits::kJsonBodyBytesMax)) {
    if (auto files = parse_bundle_manifest(bytes)) return *std::move(files);
  }
  return AssetBlob();
}

Status insert_result(SqlConnection& connection, const std::string& tenant, const BlobInfo& blob,
                     std::string_view media_type, std::string_view column, int64_t frames) {
  const bool is_grid = column == "grid";
  return connection.run(
      "INSERT INTO results (request_hash, blob, bytes, media_type, filename, grid, meta_json,"
      " warnings_json, created_ms, sequence, frames, job_id, tenant, grid_bytes, sequence_bytes,"
      " used_ms) VALUES ('', $1, $2, $3, '', $4, '{}', '[]', $5, $6, $7, '', $8, $9, $10, $5)",
      blob.id, blob.bytes, media_type, is_grid ? blob.id : std::string(), unix_time_ms(),
      is_grid ? std::string() : blob.id, frames, tenant, is_grid ? blob.bytes : int64_t{0},
      is_grid ? int64_t{0} : blob.bytes);
}

class Rebuild {
 public:
  Rebuild(BlobStore blobs, StoreDatabase store, std::string tenant)
      : blobs_(std::move(blobs)),
        store_(std::move(store)),
        database_(*store_.database),
        assets_(database_, blobs_),
        caller_(Caller::tenant(tenant, /*is_admin=*/false)) {
    report_.data_dir = blobs_.root();
    report_.tenant = std::move(tenant);
  }

  Result<RebuildReport> run() {
    VOXELD_ASSIGN(const auto quarantined, Quarantine(blobs_.root()).list());
    for (const QuarantinedBlob& blob : quarantined) VOXELD_TRY(blobs_.restore(blob));
    VOXELD_ASSIGN(const auto ids, blobs_.list());
    for (const std::string& id : ids) VOXELD_TRY(look(id));
    for (const auto& [id, bytes] : found_) VOXELD_TRY(put_asset(id, bytes));
    for (const auto& [id, files] : bundles_) VOXELD_TRY(put_bundle(id, files));
    return std::move(report_);
  }

 private:
  Status look(const std::string& id) {
    {
      VOXELD_ASSIGN(Database::Lease reader, database_.read());
      VOXELD_ASSIGN(const bool is_known, is_needed(*reader, id));
      if (is_known) {
        ++report_.known;
        return {};
      }
    }
    auto blob = blobs_.verified(id);
    if (!blob && blob.error().code == ErrorCode::kGone) {
      ++report_.damaged;
      return {};
    }
    if (!blob) return std::move(blob).error();
    VOXELD_ASSIGN(const fs::path path, blobs_.local_file(id));
    VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
    const auto bytes = file.bytes();
    return take(*blob, kind_of({reinterpret_cast<const char*>(bytes.data()), bytes.size()}));
  }

  Status take(const BlobInfo& blob, BlobKind kind) {
    if (std::holds_alternative<OutputBlob>(kind)) ++report_.outputs;
    if (std::holds_alternative<AssetBlob>(kind)) found_.emplace(blob.id, blob.bytes);
    if (const auto* files = std::get_if<BundleBlob>(&kind)) {
      found_.emplace(blob.id, blob.bytes);
      bundles_.emplace(blob.id, *files);
      for (const BundleFile& one : *files) names_.emplace(one.asset, one.name);
    }
    if (std::holds_alternative<GridBlob>(kind)) {
      ++report_.grids;
      return database_.write([&](SqlConnection& connection) {
        return insert_result(connection, report_.tenant, blob, format_media_type(Format::kNative),
                             "grid", 0);
      });
    }
    if (const auto* sequence = std::get_if<SequenceBlob>(&kind)) {
      ++report_.sequences;
      return database_.write([&](SqlConnection& connection) {
        return insert_result(connection, report_.tenant, blob, "application/json", "sequence",
                             static_cast<int64_t>(sequence->frames.size()));
      });
    }
    return {};
  }

  // Under the name that a bundle calls it by, if any.
  Status put_asset(const std::string& id, int64_t bytes) {
    if (bundles_.contains(id)) return {};
    const auto name = names_.find(id);
    VOXELD_TRY(assets_.put(caller_, {id, bytes}, name == names_.end() ? "" : name->second, "",
                           /*bytes_max=*/0));
    ++report_.assets;
    return {};
  }

  // One whose files are lost stays an asset of its own, which says so when it is used.
  Status put_bundle(const std::string& id, const BundleBlob& files) {
    const BlobInfo blob{id, found_.at(id)};
    const std::string name = "recovered" + std::string(kBundleExtension);
    ++report_.assets;
    if (assets_.put_bundle(caller_, blob, name, files, /*bytes_max=*/0)) return {};
    VOXELD_TRY(assets_.put(caller_, blob, name, "", /*bytes_max=*/0));
    return {};
  }

  BlobStore blobs_;
  const StoreDatabase store_;
  Database& database_;
  AssetStore assets_;
  const Caller caller_;
  RebuildReport report_;
  std::map<std::string, int64_t> found_;  // assets by id, with their bytes
  std::map<std::string, BundleBlob> bundles_;
  std::map<std::string, std::string> names_;  // that bundles call their files by
};

Result<std::string> owner(const fs::path& data_dir, const std::optional<std::string>& tenant) {
  if (tenant) {
    VOXELD_TRY(check_tenant_name(*tenant));
    return *tenant;
  }
  VOXELD_ASSIGN(const auto keys, read_keys(key_file_path(data_dir)));
  if (!keys) return std::string();
  return Error{ErrorCode::kInvalidOption,
               "there are API keys, and files do not tell which tenant's they are", "--tenant NAME",
               "no --tenant"};
}

}  // namespace

Result<RebuildReport> rebuild_store(const fs::path& data_dir,
                                    const std::optional<std::string>& tenant) {
  std::error_code failed;
  if (!fs::exists(data_dir / "blobs", failed)) {
    return Error{ErrorCode::kNotFound, "there is no store in " + data_dir.string(),
                 "the directory of voxeld serve --data", ""};
  }
  VOXELD_ASSIGN(std::string name, owner(data_dir, tenant));
  VOXELD_ASSIGN(const UniqueFd lock, prepare_data_dir(data_dir));
  VOXELD_ASSIGN(BlobStore blobs, BlobStore::open(data_dir));
  VOXELD_ASSIGN(StoreDatabase store, open_store_database(blobs, StoreMatch::kAdopt));
  return Rebuild(std::move(blobs), std::move(store), std::move(name)).run();
}

}  // namespace voxeld
