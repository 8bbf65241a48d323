// GET /v1/queue: devices and live jobs, those of other tenants as numbers only.

#include "proto/messages/job_text.h"
#include "proto/messages/json_writer.h"
#include "proto/number_text.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

constexpr int kListDefault = 100, kListMax = 200;  // queued jobs
// Memory of a response with kListMax queued and as many running jobs: their rows, and the text that
// is sent.
constexpr int64_t kQueueBytesMax = int64_t{2} << 20;

Result<int> requested_limit(const Request& request) {
  int limit = kListDefault;
  for (const auto& [name, value] : request.head.query) {
    if (name != "limit") {
      return Error{ErrorCode::kUnknownOption, "no such option", "limit",
                   "\"" + name.substr(0, 40) + "\""};
    }
    const auto wanted = parse_number<int>(value, 1, kListMax);
    if (!wanted) {
      return Error{ErrorCode::kInvalidOption, "limit",
                   "an integer from 1 to " + std::to_string(kListMax),
                   "\"" + value.substr(0, 40) + "\""};
    }
    limit = *wanted;
  }
  return limit;
}

void write_devices(JsonWriter& json, const QueueView& view) {
  json.key("devices").begin_array();
  for (const QueueView::Device& device : view.devices) {
    json.begin_object()
        .member("device", device.device)
        .member("renderer", device.renderer)
        .member("workers", device.workers)
        .member("workers_busy", device.workers_busy)
        .key("jobs")
        .begin_array();
    for (const std::string& job : device.jobs) json.value(job);
    json.end_array().end_object();
  }
  json.end_array();
}

std::string queue_text(const QueueView& view) {
  std::string text;
  JsonWriter json(text);
  json.begin_object().member("queued", view.queued).member("running", view.running);
  json.key("others").begin_object().member("queued", view.others_queued);
  json.member("running", view.others_running).end_object();
  write_devices(json, view);
  json.key("jobs").begin_array();
  for (const QueueView::Job& job : view.jobs) {
    std::string row = job_row_text(job.status);
    row.pop_back();
    JsonWriter(row).member("tenant", job.tenant).member("device", job.device).end_object();
    json.raw(row);
  }
  json.end_array().end_object();
  return text;
}

}  // namespace

// The list is made while it is sent, so that a client that does not read counts in the memory
// budget.
Reply get_queue(Request& request, Api& api) {
  const auto limit = requested_limit(request);
  if (!limit) return problem(request, limit.error());
  Response response = Response::json(200, "");
  response.body = PieceBody{[&api, caller = request.caller, limit = *limit]() -> Result<Piece> {
                              VOXELD_ASSIGN(const QueueView view, api.jobs.queue(caller, limit));
                              return Piece{queue_text(view), true};
                            },
                            kQueueBytesMax};
  return response;
}

}  // namespace voxeld::api
