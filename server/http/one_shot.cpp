// POST /v1/voxelize and /v1/render: a mesh in, a grid or a picture out, no job to manage. Behind it
// is a job like any other; it is cancelled when the client leaves.
#include "server/http/api.h"
#include "server/http/body_reader.h"

namespace voxeld::http {
namespace {

// The query without the members that name the input.
OptionPairs option_pairs(const Request& request) {
  OptionPairs pairs;
  for (const auto& pair : request.head.query) {
    if (pair.first != "asset" && pair.first != "grid") pairs.push_back(pair);
  }
  return pairs;
}

Result<JobRequest> parse_request(const Request& request, JobKind kind) {
  JobRequest job;
  job.kind = kind;
  job.asset = request.query("asset").value_or("");
  job.grid = request.query("grid").value_or("");
  if (!job.grid.empty() && (kind == JobKind::kVoxelize || !job.asset.empty())) {
    return Error{
        ErrorCode::kInvalidOption, "grid",
        kind == JobKind::kVoxelize ? "asset, or a mesh as the body" : "either asset or grid",
        "grid"};
  }
  VOXELD_ASSIGN(job.options, parse_options(option_pairs(request), option_scope(job)));
  job.filename = job.options.filename;
  return job;
}

Response run(Request& request, Api& api, JobKind kind) {
  auto job = parse_request(request, kind);
  if (!job) return problem(request, job.error());
  SubmitOptions submit;
  submit.transient = true;
  if (job->asset.empty() && job->grid.empty()) {
    auto upload = receive_upload(request, api);
    if (!upload) return problem(request, upload.error());
    submit.upload_ms = upload->ms;
    job->filename = upload->filename;
    auto asset = api.jobs.put_asset(upload->blob, upload->filename, upload->content_type);
    if (!asset) return problem(request, asset.error());
    job->asset = asset->id;
  }
  auto status = api.jobs.submit(*job, submit);
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
