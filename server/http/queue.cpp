// GET /v1/queue: who works and who waits, as far as it is the caller's business.
#include <charconv>
#include <nlohmann/json.hpp>

#include "server/http/api.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

constexpr int kListDefault = 100, kListMax = 200;  // of jobs that wait

Result<int> requested_limit(const Request& request) {
  int limit = kListDefault;
  for (const auto& [name, value] : request.head.query) {
    if (name != "limit") {
      return Error{ErrorCode::kUnknownOption, "no such option", "limit",
                   "\"" + name.substr(0, 40) + "\""};
    }
    const char* end = value.data() + value.size();
    const auto [stopped, error] = std::from_chars(value.data(), end, limit);
    if (error != std::errc() || stopped != end || limit < 1 || limit > kListMax) {
      return Error{ErrorCode::kInvalidOption, "limit",
                   "an integer from 1 to " + std::to_string(kListMax),
                   "\"" + value.substr(0, 40) + "\""};
    }
  }
  return limit;
}

Json queue_json(const QueueView& view) {
  Json devices = Json::array(), jobs = Json::array();
  for (const QueueView::Device& device : view.devices) {
    devices.push_back({{"device", device.device},
                       {"renderer", device.renderer},
                       {"workers", device.workers},
                       {"workers_busy", device.workers_busy},
                       {"jobs", device.jobs}});
  }
  for (const QueueView::Job& job : view.jobs) {
    Json status = job_status_json(job.status);
    status["tenant"] = job.tenant;
    status["device"] = job.device;
    jobs.push_back(std::move(status));
  }
  return {{"queued", view.queued},
          {"running", view.running},
          {"others", {{"queued", view.others_queued}, {"running", view.others_running}}},
          {"devices", std::move(devices)},
          {"jobs", std::move(jobs)}};
}

Response get_queue(Request& request, Api& api) {
  const auto limit = requested_limit(request);
  if (!limit) return problem(request, limit.error());
  const auto view = api.jobs.queue(request.caller, *limit);
  if (!view) return problem(request, view.error());
  return Response::json(200,
                        queue_json(*view).dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

void add_queue_routes(Router& router, Api& api) {
  router.add("GET", "/v1/queue", [&api](Request& request) { return get_queue(request, api); });
}

}  // namespace voxeld::http
