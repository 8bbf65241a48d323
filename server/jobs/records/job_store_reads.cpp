// Reads of jobs that change nothing.
#include "server/jobs/model/caller.h"
#include "server/jobs/model/job_record.h"
#include "server/jobs/model/tenant_limits.h"
#include "server/jobs/records/job_changes.h"
#include "server/jobs/records/job_rows.h"
#include "server/jobs/records/job_store.h"
#include "server/jobs/records/quota.h"
#include "server/jobs/records/visibility.h"

namespace voxeld {

Result<JobRecord> JobStore::get(const Caller& caller, std::string_view id, JobTexts texts) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return load_job(*reader, caller, id, texts);
}

Status JobStore::list(const Caller& caller, const JobQuery& query,
                      const std::function<Result<bool>(JobRecord&&)>& take) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return each_job(*reader, caller, query, take);
}

Result<std::vector<QueueHead>> JobStore::queue_heads() {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return voxeld::queue_heads(*reader);
}

Result<std::vector<RunningJob>> JobStore::running() {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement rows,
                reader->query("SELECT id, fence FROM jobs WHERE state = 'running' ORDER BY seq"));
  std::vector<RunningJob> running;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return running;
    running.push_back({rows.text(0), rows.int64(1)});
  }
}

Result<std::vector<JobEvent>> JobStore::events(const Caller& caller, std::string_view id,
                                               int64_t after_id) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(const bool known,
                sees_row(*reader, caller, "SELECT 1 FROM jobs WHERE id = $1", id));
  if (!known) {
    return Error{ErrorCode::kNotFound, "no such job", "the id of a job",
                 std::string(id.substr(0, 80))};
  }
  return load_events(*reader, id, after_id, kEventsReadMax);
}

Result<LiveJobs> JobStore::live() {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return live_jobs(*reader);
}

Result<LiveJobs> JobStore::live(const Caller& caller) {
  if (caller.sees_all()) return live();
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return live_jobs(*reader, caller.tenant());
}

Result<TenantUsage> JobStore::usage(std::string_view tenant) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return tenant_usage(*reader, tenant);
}

Result<JobStore::UploadRoom> JobStore::upload_room(std::string_view tenant, int64_t asked) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  UploadRoom room;
  VOXELD_ASSIGN(const TenantUsage usage, tenant_usage(*reader, tenant));
  room.used = usage.bytes;
  VOXELD_ASSIGN(room.can_be_there, has_blob_of(*reader, tenant, asked));
  VOXELD_ASSIGN(room.longest_blob, longest_blob(*reader, tenant));
  return room;
}

}  // namespace voxeld
