#include "server/jobs/records/blob_needs.h"

#include <utility>

#include "server/base/log.h"

namespace voxeld {
namespace {

// Whether a row needs the blob $1.
constexpr std::string_view kIsNeeded =
    "SELECT CASE WHEN"
    " (EXISTS (SELECT 1 FROM assets n WHERE n.id = $1 AND n.deleted_ms = 0)"
    " OR EXISTS (SELECT 1 FROM results n WHERE n.blob = $1 AND n.expired_ms = 0)"
    " OR EXISTS (SELECT 1 FROM results n WHERE n.grid = $1 AND n.grid <> ''"
    "            AND n.expired_ms = 0)"
    " OR EXISTS (SELECT 1 FROM results n WHERE n.sequence = $1 AND n.sequence <> ''"
    "            AND n.expired_ms = 0)"
    " OR EXISTS (SELECT 1 FROM frames n WHERE n.grid = $1 AND n.expired_ms = 0)"
    // As the partial indexes on live jobs have it, one for each of the three.
    " OR EXISTS (SELECT 1 FROM jobs n WHERE n.asset = $1 AND n.asset <> ''"
    "            AND n.state IN ('queued', 'running'))"
    " OR EXISTS (SELECT 1 FROM jobs n WHERE n.grid = $1 AND n.grid <> ''"
    "            AND n.state IN ('queued', 'running'))"
    " OR EXISTS (SELECT 1 FROM jobs n WHERE n.sequence = $1 AND n.sequence <> ''"
    "            AND n.state IN ('queued', 'running'))"
    " OR EXISTS (SELECT 1 FROM bundle_files b JOIN jobs n ON n.asset = b.bundle"
    "            WHERE b.asset = $1 AND n.asset <> '' AND n.state IN ('queued', 'running'))"
    // Frames of a sequence that was deleted while a job works on it.
    " OR EXISTS (SELECT 1 FROM frames f JOIN results r ON r.job_id = f.job_id"
    "            JOIN jobs n ON n.sequence = r.sequence WHERE f.grid = $1"
    "            AND n.sequence <> '' AND n.state IN ('queued', 'running')))"
    " THEN 1 ELSE 0 END";

// The ids among `ids` that no row needs, as this connection sees it.
Result<std::vector<std::string>> free_blobs(SqlConnection& connection,
                                            const std::vector<std::string>& ids) {
  std::vector<std::string> unneeded;
  for (const std::string& id : ids) {
    VOXELD_ASSIGN(const bool needed, is_needed(connection, id));
    if (!needed) unneeded.push_back(id);
  }
  return unneeded;
}

}  // namespace

Result<bool> is_needed(SqlConnection& connection, std::string_view id) {
  VOXELD_ASSIGN(SqlStatement answer, connection.query(kIsNeeded, id));
  VOXELD_TRY(answer.step());
  return answer.int64(0) != 0;
}

Result<std::vector<std::string>> remove_blobs(
    SqlConnection& writer, Database& database, const std::vector<std::string>& ids,
    const std::function<Status(const std::string& id)>& remove) {
  VOXELD_ASSIGN(std::vector<std::string> unneeded, free_blobs(writer, ids));
  {
    // A reader sees what is committed.
    VOXELD_ASSIGN(Database::Lease reader, database.read());
    VOXELD_ASSIGN(unneeded, free_blobs(*reader, unneeded));
  }
  std::vector<std::string> gone;
  for (std::string& id : unneeded) {
    const Status removed = remove(id);
    if (!removed && removed.error().code == ErrorCode::kConflict) continue;  // uploaded just now
    if (!removed && removed.error().code != ErrorCode::kNotFound) {
      log::warn("cannot remove a blob", {{"blob", id}, {"error", removed.error().message()}});
      continue;
    }
    gone.push_back(std::move(id));
  }
  return gone;
}

Result<BlobInfo> named_blob(const ObjectStore& blobs, std::string_view id, std::string_view what,
                            std::string_view remedy) {
  auto blob = blobs.verified(id);
  if (blob) return blob;
  const ErrorCode code = blob.error().code;
  if (code != ErrorCode::kNotFound && code != ErrorCode::kGone) return blob;
  const bool is_damaged = code == ErrorCode::kGone;
  return Error{ErrorCode::kGone,
               std::string(what) +
                   (is_damaged ? " was damaged on disk; "
                               : " is not stored any more: it expired or made room for others; ") +
                   std::string(remedy),
               "", ""};
}

}  // namespace voxeld
