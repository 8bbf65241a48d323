// Assets in the database: what was uploaded under which name.
#pragma once

#include <functional>
#include <string>
#include <string_view>
#include <vector>

#include "proto/bundle_manifest.h"
#include "proto/result.h"
#include "server/jobs/database.h"
#include "server/jobs/job_service.h"
#include "server/store/blob_store.h"

namespace voxeld {

// Thread-safe; holds no state of its own.
class AssetStore {
 public:
  AssetStore(Database& database, const BlobStore& blobs) : database_(database), blobs_(blobs) {}

  // Registers a blob, or brings a deleted asset back. A name or type that is empty keeps the one
  // that is known. Errors: conflict when the blob was removed since it was stored.
  Result<Asset> put(const BlobInfo& blob, const std::string& filename,
                    const std::string& content_type);
  // The same for a bundle manifest with these files. Errors: as put(); not-found and gone, naming
  // the file whose asset is not there; malformed-bundle for a bundle in a bundle.
  Result<Asset> put_bundle(const BlobInfo& blob, const std::string& filename,
                           const std::vector<BundleFile>& files);
  // In the order of the manifest; none when the asset is no bundle.
  Result<std::vector<BundleFile>> bundle_files(std::string_view id);
  // Errors: not-found, gone.
  Result<Asset> get(std::string_view id);
  // Newest first.
  Result<std::vector<Asset>> list(int limit);
  // Errors: not-found, gone.
  Status mark_deleted(std::string_view id);
  // Removes blobs of deleted assets that no live job, bundle of a live job, result or grid needs.
  // Runs where nothing can start to need one meanwhile: inside the database's only writer. Returns
  // how many went.
  Result<int64_t> remove_unneeded();

 private:
  Database& database_;
  const BlobStore& blobs_;
};

// When the asset is a bundle: that each of its files is an asset that is there. Errors as those of
// put_bundle().
Status check_bundle(SqlConnection& connection, std::string_view id);

}  // namespace voxeld
