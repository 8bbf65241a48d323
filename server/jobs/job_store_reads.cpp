// What of jobs is read without changing anything.
#include <utility>

#include "server/jobs/job_store.h"
#include "server/jobs/quota.h"
#include "server/jobs/visibility.h"

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

Result<std::vector<JobEvent>> JobStore::events(const Caller& caller, std::string_view id,
                                               int64_t after_id) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(const bool known,
                sees_row(*reader, caller, "SELECT 1 FROM jobs WHERE id = $1", id));
  if (!known) {
    return Error{ErrorCode::kNotFound, "no such job", "the id of a job",
                 std::string(id.substr(0, 80))};
  }
  VOXELD_ASSIGN(SqlStatement rows, reader->query("SELECT id, type, data_json FROM job_events"
                                                 " WHERE job_id = $1 AND id > $2 ORDER BY id"
                                                 " LIMIT $3",
                                                 id, after_id, kEventsReadMax));
  std::vector<JobEvent> events;
  while (true) {
    VOXELD_ASSIGN(const bool row, rows.step());
    if (!row) return events;
    events.push_back({rows.int64(0), rows.text(1), rows.text(2)});
  }
}

Result<int64_t> JobStore::count(JobState state) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement statement,
                reader->query("SELECT COUNT(*) FROM jobs WHERE state = $1", job_state_name(state)));
  VOXELD_TRY(statement.step());
  return statement.int64(0);
}

Result<int64_t> JobStore::count(const Caller& caller, JobState state) {
  if (caller.sees_all()) return count(state);
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  VOXELD_ASSIGN(SqlStatement statement,
                reader->query("SELECT COUNT(*) FROM jobs WHERE state = $1 AND tenant = $2",
                              job_state_name(state), caller.tenant()));
  VOXELD_TRY(statement.step());
  return statement.int64(0);
}

Result<std::vector<JobRecord>> JobStore::live(const Caller& caller, int limit) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  std::vector<JobRecord> records;
  for (const JobState state : {JobState::kRunning, JobState::kQueued}) {
    const JobQuery query{state, JobOrder::kOldestFirst, JobTexts::kBrief, ""};
    int left = limit;
    VOXELD_TRY(each_job(*reader, caller, query, [&](JobRecord&& record) -> Result<bool> {
      records.push_back(std::move(record));
      return --left > 0;
    }));
  }
  return records;
}

Result<TenantUsage> JobStore::usage(std::string_view tenant) {
  VOXELD_ASSIGN(Database::Lease reader, database_.read());
  return tenant_usage(*reader, tenant);
}

}  // namespace voxeld
