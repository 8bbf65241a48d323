#include "server/jobs/model/request_hash.h"

#include "proto/asset_id.h"
#include "server/base/algorithm_version.h"
#include "server/base/sha256.h"

namespace voxeld {
namespace {

// Each part is preceded by its length, so that no two lists of parts give the same bytes.
void add_part(Sha256& hash, std::string_view part) {
  hash.update(std::to_string(part.size()) + ":");
  hash.update(part);
}

void add_request(Sha256& hash, const JobRequest& request) {
  add_part(hash, job_kind_name(request.kind));
  add_part(hash, request.asset);
  add_part(hash, request.grid);
  add_part(hash, reading_of(request.filename));
  add_part(hash, canonical_json(request.options, option_scope(request)));
  // Only where there is one, so that the names of all other results are what they were before.
  if (!request.sequence.empty()) add_part(hash, request.sequence);
}

}  // namespace

std::string request_hash(const JobRequest& request) {
  Sha256 hash;
  add_part(hash, std::to_string(kAlgorithmVersion));
  add_request(hash, request);
  return hash.finish_id();
}

std::string idempotency_hash(const JobRequest& request) {
  Sha256 hash;
  add_request(hash, request);
  add_part(hash, request.filename);
  add_part(hash, request.options.use_cache ? "cache" : "no-cache");
  if (request.priority) add_part(hash, "priority " + std::to_string(*request.priority));
  if (request.deadline_ms) add_part(hash, "deadline " + std::to_string(*request.deadline_ms));
  return hash.finish_id();
}

}  // namespace voxeld
