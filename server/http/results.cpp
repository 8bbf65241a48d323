// /v1/jobs/{id}/result: a job's bytes, or its grid or sequence in another format.
#include "proto/sequence_format.h"
#include "server/http/api.h"

namespace voxeld::http {
namespace {

// What an export of the job's result starts from: its own grid or sequence, or the one that it drew
// or wrote. Both empty: it has none.
JobRequest export_of(const JobStatus& status) {
  const JobResult& result = *status.result;
  JobRequest job;
  job.kind = JobKind::kExport;
  job.sequence = result.sequence;
  job.grid = result.grid;
  if (job.sequence.empty() && job.grid.empty()) {
    job.sequence = status.sequence;
    job.grid = status.grid;
  }
  if (!job.sequence.empty()) job.grid.clear();
  return job;
}

Response export_as(Request& request, Api& api, JobRequest job, Format format) {
  OptionPairs pairs;
  for (const auto& pair : request.head.query) {
    if (pair.first != "format") pairs.push_back(pair);
  }
  auto options = parse_options(pairs, OptionScope::kExport);
  if (!options) return problem(request, options.error());
  job.options = *options;
  job.options.output.format = format;
  return run_transient(request, api, job);
}

Response get_result(Request& request, Api& api) {
  auto status = api.jobs.get(request.caller, request.path_parameters[0]);
  if (!status) return problem(request, status.error());
  if (status->state != JobState::kDone || !status->result) {
    return job_result_response(request, api, *status);
  }
  const JobRequest job = export_of(*status);
  const MediaTypeOf media_type = job.sequence.empty() ? format_media_type : sequence_media_type;
  auto format = requested_format(request, media_type);
  if (!format) return problem(request, format.error());
  const JobResult& result = *status->result;
  const bool other = *format && media_type(**format) != result.media_type;
  if (!other && request.head.query.empty()) return job_result_response(request, api, *status);
  if (!*format || (!other && request.head.query.size() == 1)) {
    return job_result_response(request, api, *status);
  }
  if (job.grid.empty() && job.sequence.empty()) {
    return problem(request, {ErrorCode::kNotAcceptable, "this job's result has one form alone",
                             result.media_type, std::string(media_type(**format))});
  }
  return export_as(request, api, job, **format);
}

}  // namespace

void add_result_routes(Router& router, Api& api) {
  router.add("GET", "/v1/jobs/{id}/result", [&api](Request& r) { return get_result(r, api); });
}

}  // namespace voxeld::http
