// /v1/jobs: submit, list, look at (long poll), cancel.
#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>

#include "proto/job_text.h"
#include "server/http/api.h"
#include "server/http/body_reader.h"
#include "server/http/list_body.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

constexpr ListLimits kListLimits{100, 1000};
// How long a waiting poll may overlook that its client left.
constexpr auto kPollStep = std::chrono::milliseconds(200);

// A web page may send other types than this one without asking first.
constexpr std::string_view kJsonMediaType = "application/json";

Result<JobRequest> read_job_request(Request& request) {
  if (request.head.media_type() != kJsonMediaType) {
    return Error{ErrorCode::kUnsupportedMedia, "Content-Type of the body",
                 std::string(kJsonMediaType),
                 "\"" + header_safe(request.head.header("Content-Type").substr(0, 80)) + "\""};
  }
  VOXELD_ASSIGN(const std::string text, request.body->read_text(limits::kJsonBodyBytesMax));
  VOXELD_ASSIGN(const Json body, parse_json_bounded(text));
  return parse_job_request(body);
}

// What the request is understood as and what it would cost, without queueing it.
Response dry_run(Request& request, const JobRequest& job, Api& api) {
  const auto price = api.jobs.price(request.caller, job);
  if (!price) return problem(request, price.error());
  const Json options = Json::parse(canonical_json(job.options, option_scope(job)));
  return Response::json(200, Json{{"kind", job_kind_name(job.kind)},
                                  {"asset", job.asset},
                                  {"grid", job.grid},
                                  {"sequence", job.sequence},
                                  {"options", options},
                                  {"cached", price->cached},
                                  {"queue_position", price->queue_position},
                                  {"estimate", job_estimate_json(*price->estimate)},
                                  {"expected_start_ms", price->expected_start_ms},
                                  {"expected_end_ms", price->expected_end_ms}}
                                 .dump());
}

Response post_job(Request& request, Api& api) {
  auto job = read_job_request(request);
  if (!job) return problem(request, job.error());
  if (request.query("dry_run").value_or("0") == "1") return dry_run(request, *job, api);
  SubmitOptions submit;
  submit.idempotency_key = request.head.header("Idempotency-Key");
  submit.request_id = request.request_id;
  submit.trace_id = request.trace.trace_id;
  auto status = api.jobs.submit(request.caller, *job, submit);
  if (!status) return problem(request, status.error());
  const int wait = preferred_wait_seconds(request);
  if (wait > 0 && !status->ended()) {
    const bool cached = status->cached;
    status = api.jobs.wait_end(request.caller, status->id,
                               JobService::Clock::now() + std::chrono::seconds(wait),
                               [&] { return is_abandoned(request, api); });
    if (!status) return problem(request, status.error());
    if (auto refused = key_ended(request, api)) return *std::move(refused);
    status->cached = cached;
  }
  Response response = status_response(request, api, status->ended() ? 200 : 202, *status);
  response.headers["Location"] = "/v1/jobs/" + status->id;
  if (wait > 0) response.headers["Preference-Applied"] = "wait=" + std::to_string(wait);
  if (!status->ended()) response.headers["Retry-After"] = "1";
  return response;
}

// Jobs in brief: long texts of a job are left to GET /v1/jobs/{id}.
Response list_jobs(Request& request, Api& api) {
  auto page = requested_page(request, kListLimits, {"state"});
  if (!page) return problem(request, page.error());
  JobQuery query;
  if (const auto name = request.query("state")) {
    query.state = job_state_from_name(*name);
    if (!query.state) {
      return problem(request, {ErrorCode::kInvalidOption, "state",
                               "queued | running | done | failed | cancelled",
                               "\"" + name->substr(0, 40) + "\""});
    }
  }
  return list_response(
      "", "jobs", *std::move(page),
      [&api, caller = request.caller, query](const std::string& after, ListRows& rows) mutable {
        query.after = after;
        return api.jobs.list(caller, query, [&](const JobStatus& status) {
          return rows.add(job_row_text(status), status.id);
        });
      });
}

Response get_job(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  auto status = api.jobs.get(request.caller, id);
  if (!status) return problem(request, status.error());
  const int wait = preferred_wait_seconds(request);
  const auto deadline = JobService::Clock::now() + std::chrono::seconds(wait);
  const auto tag = [](const JobStatus& s) { return "\"" + std::to_string(s.version) + "\""; };
  const std::string_view known = request.head.header("If-None-Match");
  const auto abandoned = [&] { return api.stopping || is_abandoned(request, api); };
  if (known.empty() && wait > 0 && !status->ended()) {
    status = api.jobs.wait_end(request.caller, id, deadline, abandoned);
    if (!status) return problem(request, status.error());
  }
  // With If-None-Match, the next change after what the client knows, which may have been already.
  while (known == tag(*status) && !status->ended() && JobService::Clock::now() < deadline &&
         !abandoned()) {
    status = api.jobs.wait_change(request.caller, id, status->version,
                                  std::min(deadline, JobService::Clock::now() + kPollStep));
    if (!status) return problem(request, status.error());
  }
  if (auto refused = key_ended(request, api)) return *std::move(refused);
  Response response = status_response(request, api, 200, *status);
  if (!known.empty() && known == tag(*status)) {
    response.status = 304;
    response.body = std::string();
  }
  return response;
}

Response cancel_job(Request& request, Api& api) {
  auto status = api.jobs.cancel(request.caller, request.path_parameters[0]);
  if (!status) return problem(request, status.error());
  return status_response(request, api, status->ended() ? 200 : 202, *status);
}

}  // namespace

void add_job_routes(Router& router, Api& api) {
  router.add("POST", "/v1/jobs", [&api](Request& r) { return post_job(r, api); });
  router.add("GET", "/v1/jobs", [&api](Request& r) { return list_jobs(r, api); });
  router.add("GET", "/v1/jobs/{id}", [&api](Request& r) { return get_job(r, api); });
  router.add("DELETE", "/v1/jobs/{id}", [&api](Request& r) { return cancel_job(r, api); });
}

}  // namespace voxeld::http
