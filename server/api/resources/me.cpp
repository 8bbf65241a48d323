// GET /v1/me: the tenant of a key, its limits and its usage.
#include <nlohmann/json.hpp>

#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

using Json = nlohmann::json;

// A limit of 0 is none.
Json limit(int64_t value) {
  return value == 0 ? Json() : Json(value);
}

}  // namespace

Reply get_me(Request& request, Api& api) {
  const auto usage = api.jobs.usage(request.caller);
  if (!usage) return problem(request, usage.error());
  const TenantLimits limits = api.jobs.limits(request.caller);
  return Response::json(200, Json{{"tenant", request.caller.tenant()},
                                  {"key", request.key_id},
                                  {"admin", !request.key_id.empty() && request.caller.sees_all()},
                                  {"limits",
                                   {{"requests_per_minute", limit(limits.requests_per_minute)},
                                    {"queued_jobs", limit(limits.queued_jobs)},
                                    {"bytes", limit(limits.bytes)},
                                    {"cells", limit(limits.cells)}}},
                                  {"usage",
                                   {{"queued_jobs", usage->queued_jobs},
                                    {"running_jobs", usage->running_jobs},
                                    {"bytes", usage->bytes}}}}
                                 .dump());
}

}  // namespace voxeld::api
