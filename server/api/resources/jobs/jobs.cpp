// /v1/jobs: submit, list, poll, cancel.
#include <algorithm>
#include <chrono>
#include <nlohmann/json.hpp>
#include <utility>
#include <variant>

#include "proto/messages/job_text.h"
#include "proto/text/client_texts.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"
#include "server/http/file_response.h"

namespace voxeld::api {
namespace {

using Json = nlohmann::json;

Result<JobRequest> parse_body(const std::string& text) {
  VOXELD_ASSIGN(const Json body, parse_json_bounded(text));
  return parse_job_request(body);
}

// The job as understood, with its estimate, without queueing it.
Response dry_run(Request& request, const JobRequest& job, Api& api) {
  const auto estimated = api.jobs.estimate(request.caller, job);
  if (!estimated) return problem(request, estimated.error());
  const Json options = Json::parse(canonical_json(job.options, option_scope(job)));
  return Response::json(200, Json{{"kind", job_kind_name(job.kind)},
                                  {"asset", job.asset},
                                  {"grid", job.grid},
                                  {"sequence", job.sequence},
                                  {"options", options},
                                  {"cached", estimated->cached},
                                  {"queue_position", estimated->queue_position},
                                  {"estimate", job_estimate_json(*estimated->estimate)},
                                  {"expected_start_ms", estimated->expected_start_ms},
                                  {"expected_end_ms", estimated->expected_end_ms}}
                                 .dump());
}

// Whether an If-None-Match names the ETag of this version.
bool is_known_version(std::string_view if_none_match, const JobStatus& status) {
  return http::etag_matches(if_none_match, "\"" + std::to_string(status.version) + "\"");
}

Response submitted_response(const Request& request, Api& api, const JobStatus& status, int wait) {
  Response response = status_response(request, api, status.ended() ? 200 : 202, status);
  response.headers["Location"] = "/v1/jobs/" + status.id;
  if (wait > 0) response.headers["Preference-Applied"] = "wait=" + std::to_string(wait);
  if (!status.ended()) response.headers["Retry-After"] = "1";
  return response;
}

// Submits the job and, with `Prefer: wait`, waits for its end.
Reply submit_job(Request& request, Api& api, const std::string& text) {
  const auto job = parse_body(text);
  if (!job) return problem(request, job.error());
  const auto is_dry = query_word(request, "dry_run", {"0", "1"});
  if (!is_dry) return problem(request, is_dry.error());
  if (*is_dry == "1") return dry_run(request, *job, api);
  const int wait = preferred_wait_seconds(request);
  WaitPlace place;
  if (wait > 0) {
    auto taken = api.waits.take(request.caller.tenant());
    if (!taken) return problem(request, taken.error());
    place = *std::move(taken);
  }
  SubmitOptions submit;
  submit.idempotency_key = request.head.header("Idempotency-Key");
  submit.request_id = request.request_id;
  submit.trace_id = request.trace.trace_id;
  const auto status = api.jobs.submit(request.caller, *job, submit);
  if (!status) return problem(request, status.error());
  if (wait == 0 || status->ended()) return submitted_response(request, api, *status, wait);
  JobWaitPlan plan;
  plan.job = status->id;
  plan.place = std::move(place);
  plan.deadline = Clock::now() + std::chrono::seconds(wait);
  plan.is_poll = true;
  plan.then = [&api, wait, cached = status->cached](Request& asking, const JobStatus& now) {
    JobStatus told = now;
    told.cached = cached;
    return submitted_response(asking, api, told, wait);
  };
  return wait_for_job(request, api, std::move(plan));
}

// The response to GET: 304 for the version that the client knows.
Response polled_response(const Request& request, Api& api, const JobStatus& status) {
  Response response = status_response(request, api, 200, status);
  if (is_known_version(request.head.header("If-None-Match"), status)) {
    response.status = 304;
    response.body = std::string();
  }
  return response;
}

// Removes the record of an ended job. Long texts of its last state may be read while the response
// is sent; then it goes after them.
Response remove_job(const Request& request, Api& api, const JobStatus& last) {
  Response response = status_response(request, api, 200, last);
  const auto forget = [&api, caller = request.caller, id = last.id] {
    return api.jobs.forget(caller, id);
  };
  if (auto* pieces = std::get_if<PieceBody>(&response.body)) {
    pieces->next = [read = std::move(pieces->next), forget]() -> Result<Piece> {
      VOXELD_ASSIGN(Piece text, read());
      VOXELD_TRY(forget());
      return text;
    };
  } else if (const Status gone = forget(); !gone) {
    return problem(request, gone.error());
  }
  return response;
}

}  // namespace

Reply post_job(Request& request, Api& api) {
  if (const Status known = check_json_type(request); !known) {
    return problem(request, known.error());
  }
  return TextBody{request.body_bytes_max, [&api](Request& asking, const std::string& text) {
                    return submit_job(asking, api, text);
                  }};
}

// Jobs in brief: long texts of a job are left to GET /v1/jobs/{id}.
Reply list_jobs(Request& request, Api& api) {
  auto page = requested_page(request);
  if (!page) return problem(request, page.error());
  JobQuery query;
  if (const auto name = request.query("state")) {
    query.state = job_state_from_name(*name);
    if (!query.state) {
      return problem(request, {ErrorCode::kInvalidOption, "state",
                               "queued | running | done | failed | cancelled", echoed(*name)});
    }
  }
  return list_response("", "jobs", *std::move(page),
                       [&api, caller = request.caller, query](const std::string& after,
                                                              ListRows& rows) mutable -> Status {
                         if (!after.empty()) {
                           VOXELD_ASSIGN(query.after, cursor_number(after));
                         }
                         return api.jobs.list(caller, query, [&](const ListedJob& job) {
                           return rows.add(job_row_text(job.status), std::to_string(job.seq));
                         });
                       });
}

// With `Prefer: wait`, the response waits for the end of the job, or with If-None-Match for the
// next change after the version that the client knows, which may have been already.
Reply get_job(Request& request, Api& api) {
  const std::string& id = request.path_parameters[0];
  const auto status = api.jobs.get(request.caller, id);
  if (!status) return problem(request, status.error());
  const int wait = preferred_wait_seconds(request);
  const std::string known(request.head.header("If-None-Match"));
  const bool is_news = !known.empty() && !is_known_version(known, *status);
  if (wait == 0 || status->ended() || is_news) return polled_response(request, api, *status);
  auto place = api.waits.take(request.caller.tenant());
  if (!place) return problem(request, place.error());
  JobWaitPlan plan;
  plan.job = id;
  plan.place = *std::move(place);
  plan.deadline = Clock::now() + std::chrono::seconds(wait);
  plan.is_poll = true;
  if (!known.empty()) {
    plan.change = JobChange::kAny;
    plan.is_over = [known](const JobStatus& now) { return !is_known_version(known, now); };
  }
  plan.then = [&api](Request& asking, const JobStatus& now) {
    return polled_response(asking, api, now);
  };
  return wait_for_job(request, api, std::move(plan));
}

// Cancels a job. `ended=remove` removes the record of one that had ended before: its last state is
// the response.
Reply delete_job(Request& request, Api& api) {
  const auto of_ended = query_word(request, "ended", {"remove"});
  if (!of_ended) return problem(request, of_ended.error());
  const std::string& id = request.path_parameters[0];
  const auto before = api.jobs.get(request.caller, id);
  if (before && before->ended()) {
    if (!of_ended->empty()) return remove_job(request, api, *before);
    return status_response(request, api, 200, *before);
  }
  auto status = api.jobs.cancel(request.caller, id);
  if (!status) return problem(request, status.error());
  return status_response(request, api, status->ended() ? 200 : 202, *status);
}

}  // namespace voxeld::api
