#include "server/api/admin.h"

#include <prometheus/registry.h>
#include <prometheus/text_serializer.h>

#include <nlohmann/json.hpp>

namespace voxeld::api {
namespace {

using Json = nlohmann::json;

Response ready_response(JobService& jobs, const KeyRing& keys) {
  Status ready = jobs.ready();
  if (Status readable = keys.status(); !readable) ready = readable;
  Json workers = Json::array();
  for (const WorkerState& worker : jobs.workers()) {
    workers.push_back({{"device", worker.device},
                       {"slot", worker.slot},
                       {"renderer", worker.renderer},
                       {"driver", worker.driver},
                       {"pid", worker.pid},
                       {"connected", worker.connected},
                       {"restarts", worker.restarts},
                       {"sandbox", worker.sandbox},
                       {"memory_bytes", worker.memory_bytes},
                       {"task", worker.task},
                       {"last_error", worker.last_error},
                       {"device_failure", worker.device_failure}});
  }
  return Response::json(ready.ok() ? 200 : 503,
                        Json{{"ready", ready.ok()},
                             {"reason", ready.ok() ? "" : ready.error().message()},
                             {"access", keys.needs_keys() ? "keys" : "open"},
                             {"queued_jobs", jobs.queued_jobs()},
                             {"workers", workers}}
                            .dump(-1, ' ', false, Json::error_handler_t::replace));
}

}  // namespace

std::vector<std::string> admin_paths() {
  return {"/livez", "/readyz", "/metrics"};
}

HealthHandler admin_handler(JobService& jobs, const KeyRing& keys,
                            std::shared_ptr<prometheus::Registry> metrics,
                            std::function<void()> refresh) {
  return [&jobs, &keys, metrics = std::move(metrics),
          refresh = std::move(refresh)](const Head& head) {
    if (head.path == "/livez") return Response::text(200, "ok\n");
    if (head.path == "/readyz") return ready_response(jobs, keys);
    refresh();
    Response response = Response::text(
        200, metrics ? prometheus::TextSerializer().Serialize(metrics->Collect()) : std::string());
    response.headers["Content-Type"] = "text/plain; version=0.0.4; charset=utf-8";
    return response;
  };
}

}  // namespace voxeld::api
