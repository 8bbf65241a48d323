// /v1/jobs/{id}/result: a job's bytes, or its grid in another format.
#include "server/http/api.h"

namespace voxeld::http {
namespace {

Response export_grid(Request& request, Api& api, const std::string& grid, Format format) {
  JobRequest job;
  job.kind = JobKind::kExport;
  job.grid = grid;
  OptionPairs pairs;
  for (const auto& pair : request.head.query) {
    if (pair.first != "format") pairs.push_back(pair);
  }
  auto options = parse_options(pairs, OptionScope::kExport);
  if (!options) return problem(request, options.error());
  job.options = *options;
  job.options.output.format = format;
  SubmitOptions submit;
  submit.transient = true;
  auto status = api.jobs.submit(job, submit);
  if (!status) return problem(request, status.error());
  return await_result(request, api, *status, /*transient=*/true);
}

Response get_result(Request& request, Api& api) {
  auto status = api.jobs.get(request.path_parameters[0]);
  if (!status) return problem(request, status.error());
  if (status->state != JobState::kDone || !status->result) {
    return job_result_response(request, api, *status);
  }
  auto format = requested_format(request);
  if (!format) return problem(request, format.error());
  const JobResult& result = *status->result;
  const bool other = *format && format_media_type(**format) != result.media_type;
  if (!other && request.head.query.empty()) return job_result_response(request, api, *status);
  if (!*format || (!other && request.head.query.size() == 1)) {
    return job_result_response(request, api, *status);
  }
  const std::string& grid = result.grid.empty() ? status->grid : result.grid;
  if (grid.empty()) {
    return problem(request, {ErrorCode::kNotAcceptable, "this job's result has one form alone",
                             result.media_type, std::string(format_media_type(**format))});
  }
  return export_grid(request, api, grid, **format);
}

}  // namespace

void add_result_routes(Router& router, Api& api) {
  router.add("GET", "/v1/jobs/{id}/result", [&api](Request& r) { return get_result(r, api); });
}

}  // namespace voxeld::http
