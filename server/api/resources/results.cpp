// /v1/jobs/{id}/result: a job's bytes, or its grid or sequence in another format.
#include <algorithm>

#include "proto/container/sequence_format.h"
#include "proto/text/client_texts.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

// An export of the job's result: of its own grid or sequence, or of the one that it rendered or
// exported. Both are empty if it has none.
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

// The format of a result of this media type; nullopt for an image or a description.
std::optional<Format> format_of(std::string_view type, MediaTypeOf media_type) {
  for (const FormatInfo& info : output_formats()) {
    if (media_type(info.format) == type) return info.format;
  }
  return std::nullopt;
}

// `mesh`: the name of the job's mesh, after which the response's file is named.
Reply export_as(Request& request, Api& api, JobRequest job, Format format,
                const std::string& mesh) {
  OptionPairs pairs;
  for (const auto& pair : request.head.query) {
    if (pair.first != "format") pairs.push_back(pair);
  }
  // Accept may name it, and other options depend on it.
  pairs.emplace_back("format", format_name(format));
  auto options = parse_options(pairs, OptionScope::kExport);
  if (!options) return problem(request, options.error());
  job.options = *options;
  return run_transient(request, api, job, [&api, mesh](Request& asking, const JobStatus& status) {
    return job_result_response(asking, api, status, mesh);
  });
}

bool is_exportable(const JobRequest& job) {
  return !job.grid.empty() || !job.sequence.empty();
}

MediaTypeOf media_types_of(const JobRequest& job) {
  return job.sequence.empty() ? format_media_type : sequence_media_type;
}

Error image_has_no_options(const JobResult& result) {
  return {ErrorCode::kInvalidOption, "format",
          "a format with other options, as the result is " + result.media_type, "none"};
}

}  // namespace

Status check_result_query(const JobStatus& status, OptionPairs query) {
  for (const auto& [name, value] : query) {
    if (name == "filename") VOXELD_TRY(check_filename(value));
  }
  const auto has_other_than = [&](std::string_view name) {
    return std::ranges::any_of(query, [&](const auto& pair) { return pair.first != name; });
  };
  if (!has_other_than("filename")) return {};
  const auto named =
      std::ranges::find_if(query, [](const auto& pair) { return pair.first == "format"; });
  if (named != query.end()) {
    if (status.result && !is_exportable(export_of(status))) {
      return Error{ErrorCode::kInvalidOption, "format",
                   "none, as the result is " + status.result->media_type, echoed(named->second)};
    }
  } else {
    if (!status.result) return {};  // its format is not known yet, and the options depend on it
    const auto own = format_of(status.result->media_type, media_types_of(export_of(status)));
    if (!own) return image_has_no_options(*status.result);
    query.emplace_back("format", format_name(*own));
  }
  const auto options = parse_options(query, OptionScope::kExport);
  return options ? Status() : options.error();
}

Reply get_result(Request& request, Api& api) {
  const auto found = api.jobs.get_with_result(request.caller, request.path_parameters[0]);
  if (!found) return problem(request, found.error());
  const JobStatus* const status = &found->status;
  if (status->state != JobState::kDone || !status->result) {
    return job_result_response(request, api, *found);
  }
  const JobRequest job = export_of(*status);
  const MediaTypeOf media_type = media_types_of(job);
  const JobResult& result = *status->result;
  const bool has_formats = is_exportable(job);
  const auto requested =
      requested_format(request, has_formats ? media_type : nullptr, result.media_type);
  if (!requested) return problem(request, requested.error());
  const std::optional<Format> own = format_of(result.media_type, media_type);
  const std::optional<Format> format = *requested ? *requested : own;
  const bool has_options = std::ranges::any_of(request.head.query, [](const auto& pair) {
    return pair.first != "format" && pair.first != "filename";
  });
  if (!has_options && (!*requested || format == own)) {
    return job_result_response(request, api, *found);
  }
  if (has_formats && format) return export_as(request, api, job, *format, status->filename);
  if (format) {
    return problem(request, {ErrorCode::kNotAcceptable, "this job's result has one form alone",
                             result.media_type, std::string(media_type(*format))});
  }
  return problem(request, image_has_no_options(result));
}

}  // namespace voxeld::api
