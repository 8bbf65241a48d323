// GET /v1/queue: devices and live jobs, those of other tenants as numbers only; for an admin also
// memory and storage.
#include <optional>
#include <utility>

#include "proto/messages/job_text.h"
#include "proto/messages/json_writer.h"
#include "proto/text/number_text.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

void write_devices(JsonWriter& json, const QueueView& view) {
  json.key("devices").begin_array();
  for (const QueueView::Device& device : view.devices) {
    json.begin_object()
        .member("device", device.device)
        .member("renderer", device.renderer)
        .member("workers", device.workers)
        .member("workers_busy", device.workers_busy);
    if (view.store) json.member("memory_bytes", device.memory_bytes);
    json.key("jobs").begin_array();
    for (const std::string& job : device.jobs) json.value(job);
    json.end_array().end_object();
  }
  json.end_array();
}

// The members before the list of jobs.
std::string queue_members(const QueueView& view) {
  std::string text;
  JsonWriter json(text);
  json.member("queued", view.queued).member("running", view.running);
  json.key("others").begin_object().member("queued", view.others_queued);
  json.member("running", view.others_running).end_object();
  write_devices(json, view);
  if (view.store) {
    json.key("store")
        .begin_object()
        .member("bytes", view.store->bytes)
        .member("disk_free_bytes", view.store->disk_free_bytes)
        .member("disk_bytes", view.store->disk_bytes)
        .end_object();
  }
  return text;
}

std::string row_text(const ListedJob& job) {
  std::string row = job_row_text(job.status);
  row.pop_back();
  JsonWriter(row).member("tenant", job.tenant).member("device", job.device).end_object();
  return row;
}

// Running jobs, then waiting ones, each in the order of arrival. A cursor is "running.SEQ" or
// "queued.SEQ", the list and the job that was last; the job may have left that list since.
Status add_jobs(Api& api, const Caller& caller, const std::string& after, ListRows& rows) {
  const size_t dot = after.find('.');
  const auto list = job_state_from_name(after.substr(0, dot));
  const auto seq = dot == std::string::npos
                       ? std::nullopt
                       : parse_digits<int64_t>(std::string_view(after).substr(dot + 1));
  const bool is_cursor = seq && (list == JobState::kRunning || list == JobState::kQueued);
  if (!after.empty() && !is_cursor) return bad_cursor(after);
  bool goes_on = true;
  for (const JobState state : {JobState::kRunning, JobState::kQueued}) {
    if (state == JobState::kRunning && list == JobState::kQueued) continue;
    const std::string prefix = std::string(job_state_name(state)) + ".";
    const JobQuery query{state, JobOrder::kOldestFirst, JobTexts::kBrief,
                         state == list ? seq : std::nullopt};
    VOXELD_TRY(api.jobs.list(caller, query, [&](const ListedJob& job) {
      goes_on = rows.add(row_text(job), prefix + std::to_string(job.seq));
      return goes_on;
    }));
    if (!goes_on) break;
  }
  return {};
}

}  // namespace

Reply get_queue(Request& request, Api& api) {
  auto page = requested_page(request);
  if (!page) return problem(request, page.error());
  const auto view = api.jobs.queue(request.caller);
  if (!view) return problem(request, view.error());
  return list_response(queue_members(*view), "jobs", *std::move(page),
                       [&api, caller = request.caller](const std::string& after, ListRows& rows) {
                         return add_jobs(api, caller, after, rows);
                       });
}

}  // namespace voxeld::api
