#include "server/jobs/events/job_log.h"

#include "server/base/log.h"
#include "server/jobs/model/job_record.h"

namespace voxeld {

void log_job_change(const JobRecord& record) {
  const JobStatus& status = record.status;
  if (status.ended()) {
    log::info("job ended", {{"job", status.id},
                            {"tenant", record.tenant},
                            {"request", record.request_id},
                            {"trace", record.trace_id},
                            {"worker", record.worker},
                            {"kind", job_kind_name(status.kind)},
                            {"state", job_state_name(status.state)},
                            {"cached", status.cached ? 1 : 0},
                            {"ms", status.ended_ms - status.created_ms},
                            {"error", status.error ? status.error->message() : ""}});
  } else if (status.state == JobState::kRunning) {
    log::info("job starts", {{"job", status.id},
                             {"tenant", record.tenant},
                             {"request", record.request_id},
                             {"trace", record.trace_id},
                             {"worker", record.worker},
                             {"attempt", status.attempt}});
  } else if (record.was_preempted) {
    log::info("job is preempted", {{"job", status.id},
                                   {"tenant", record.tenant},
                                   {"request", record.request_id},
                                   {"trace", record.trace_id},
                                   {"times", status.preempted}});
  } else {
    log::warn("job is queued again", {{"job", status.id},
                                      {"tenant", record.tenant},
                                      {"request", record.request_id},
                                      {"trace", record.trace_id},
                                      {"attempt", status.attempt},
                                      {"workers", record.lost_workers}});
  }
}

}  // namespace voxeld
