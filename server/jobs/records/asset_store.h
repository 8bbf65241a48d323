// Assets in the database: what which tenant uploaded under which name.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages/bundle_manifest.h"
#include "proto/result.h"
#include "server/jobs/database/database.h"
#include "server/jobs/model/assets.h"
#include "server/jobs/model/caller.h"
#include "server/store/object_store.h"

namespace voxeld {

// Thread-safe; holds no state of its own.
class AssetStore {
 public:
  AssetStore(Database& database, ObjectStore& blobs) : database_(database), blobs_(blobs) {}

  // Registers a blob as the caller's, or brings its deleted asset back. Where the tenant has it
  // under a name that is read otherwise (reading_of()), that asset stays as it is, and the id that
  // comes back says how this one is read (proto/asset_id.h). Errors: quota-exceeded and
  // payload-too-large where the caller's tenant would keep more than `bytes_max` (0: any); conflict
  // when the blob was removed since it was stored, which a pinned one cannot be.
  Result<Asset> put(const Caller& caller, const BlobInfo& blob, const std::string& filename,
                    const std::string& content_type, int64_t bytes_max,
                    Durability durability = Durability::kNow);
  // The same for a bundle manifest with these files. Errors: as put(); not-found and gone, naming
  // the file whose asset is not there; malformed-bundle for a bundle in a bundle.
  Result<Asset> put_bundle(const Caller& caller, const BlobInfo& blob, const std::string& filename,
                           const std::vector<BundleFile>& files, int64_t bytes_max,
                           Durability durability = Durability::kNow);
  // The files of the tenant's bundle, in the order of the manifest; none if it is not a bundle.
  Result<std::vector<BundleFile>> bundle_files(std::string_view tenant, std::string_view id);
  // Errors: not-found, gone.
  Result<Asset> get(const Caller& caller, std::string_view id);
  // Calls `take` with one asset after the other, newest first, without its description, until it
  // gives false. Those of several tenants with the same bytes are several.
  Status list(const Caller& caller, const AssetCursor& after,
              const std::function<bool(const Asset&)>& take);
  // For a caller who sees all: of every tenant that has it. Errors: not-found, gone.
  Status mark_deleted(const Caller& caller, std::string_view id);
  // Looks at each deleted asset once no live job of its tenant needs it or its bundle: removes the
  // blob, unless others have it as an asset, result or input, and what the row has but the id. Runs
  // where nothing can start to need a blob meanwhile: inside the database's only writer. Returns
  // how many assets that were.
  Result<int64_t> remove_unneeded();
  // Removes those of these blobs that nobody's row names: what a job left that may not keep it.
  Status remove_unnamed(const std::vector<std::string>& ids);

 private:
  std::function<Status(const std::string&)> remove_blob();
  Database& database_;
  ObjectStore& blobs_;
};

// The asset as the caller sees it, named as its id says (AssetId). A caller who sees all gets an
// own one first, then the newest. Errors: not-found, gone.
Result<Asset> load_asset(SqlConnection& connection, const Caller& caller, std::string_view id);
// When the tenant's asset is a bundle: that each of its files is an asset that is there. Errors as
// those of put_bundle().
Status check_bundle(SqlConnection& connection, std::string_view tenant, std::string_view id);

}  // namespace voxeld
