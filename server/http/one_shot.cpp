// POST /v1/voxelize and /v1/render: a mesh in, a grid or a picture out, no job to manage. Behind it
// is a job like any other; it is cancelled when the client leaves.
#include <algorithm>
#include <array>
#include <charconv>
#include <optional>

#include "proto/client_texts.h"
#include "server/http/api.h"
#include "server/http/body_reader.h"

namespace voxeld::http {
namespace {

// The query without the members that are the job's, and not its options.
OptionPairs option_pairs(const Request& request) {
  constexpr std::array<std::string_view, 5> kOfJob = {"asset", "grid", "sequence", "priority",
                                                      "deadline_ms"};
  OptionPairs pairs;
  for (const auto& pair : request.head.query) {
    if (std::ranges::find(kOfJob, pair.first) == kOfJob.end()) pairs.push_back(pair);
  }
  return pairs;
}

// A member of the query that is an integer; what is out of the range of T is none.
template <typename T>
Status read_integer(const Request& request, std::string_view name, std::optional<T>& out) {
  const std::optional<std::string> text = request.query(name);
  if (!text) return {};
  T value = 0;
  const auto [end, error] = std::from_chars(text->data(), text->data() + text->size(), value);
  if (error != std::errc() || end != text->data() + text->size()) {
    return Error{ErrorCode::kInvalidOption, std::string(name), "an integer",
                 "\"" + text->substr(0, 40) + "\""};
  }
  out = value;
  return {};
}

Result<JobRequest> parse_request(const Request& request, JobKind kind) {
  JobRequest job;
  job.kind = kind;
  job.asset = request.query("asset").value_or("");
  job.grid = request.query("grid").value_or("");
  job.sequence = request.query("sequence").value_or("");
  const int inputs = int{!job.asset.empty()} + int{!job.grid.empty()} + int{!job.sequence.empty()};
  const char* other = job.sequence.empty() ? "grid" : "sequence";
  const bool has_other = !job.grid.empty() || !job.sequence.empty();
  if (kind == JobKind::kVoxelize && has_other) {
    return Error{ErrorCode::kInvalidOption, other, "asset, or a mesh as the body", other};
  }
  if (inputs > 1) {
    return Error{ErrorCode::kInvalidOption, other, "one of asset, grid and sequence",
                 std::to_string(inputs) + " of them"};
  }
  VOXELD_ASSIGN(job.options, parse_options(option_pairs(request), option_scope(job)));
  job.filename = job.options.filename;
  VOXELD_TRY(read_integer(request, "priority", job.priority));
  VOXELD_TRY(read_integer(request, "deadline_ms", job.deadline_ms));
  VOXELD_TRY(check_texts(job));
  VOXELD_TRY(check_urgency(job));
  return job;
}

Response run(Request& request, Api& api, JobKind kind) {
  auto job = parse_request(request, kind);
  if (!job) return problem(request, job.error());
  SubmitOptions submit;
  submit.transient = true;
  submit.request_id = request.request_id;
  submit.trace_id = request.trace.trace_id;
  if (job->asset.empty() && job->grid.empty() && job->sequence.empty()) {
    auto upload = receive_upload(request, api);
    if (!upload) return problem(request, upload.error());
    submit.upload_ms = upload->ms;
    job->filename = upload->filename;
    auto asset = register_upload(request, api, *upload);
    if (!asset) return problem(request, asset.error());
    job->asset = asset->id;
  }
  auto status = api.jobs.submit(request.caller, *job, submit);
  if (!status) return problem(request, status.error());
  return await_result(request, api, *status, /*transient=*/true);
}

}  // namespace

void add_one_shot_routes(Router& router, Api& api) {
  router.add("POST", "/v1/voxelize",
             [&api](Request& request) { return run(request, api, JobKind::kVoxelize); });
  router.add("POST", "/v1/render",
             [&api](Request& request) { return run(request, api, JobKind::kRender); });
}

}  // namespace voxeld::http
