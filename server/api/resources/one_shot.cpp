// POST /v1/voxelize and /v1/render: a mesh in, a grid or an image out, without a job to manage. The
// job behind it is like any other, but is cancelled when the client leaves.
#include <algorithm>
#include <array>
#include <optional>

#include "proto/messages/job.h"
#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/resources.h"
#include "server/api/resources/upload.h"

namespace voxeld::api {
namespace {

// The query without the members that belong to the job itself, not to its options.
OptionPairs option_pairs(const Request& request) {
  constexpr std::array<std::string_view, 5> kOfJob = {"asset", "grid", "sequence", "priority",
                                                      "deadline_ms"};
  OptionPairs pairs;
  for (const auto& pair : request.head.query) {
    if (std::ranges::find(kOfJob, pair.first) == kOfJob.end()) pairs.push_back(pair);
  }
  return pairs;
}

// An integer of the query, within the range of T.
template <typename T>
Status read_integer(const Request& request, std::string_view name, std::optional<T>& out) {
  const std::optional<std::string> text = request.query(name);
  if (!text) return {};
  out = parse_number<T>(*text);
  if (!out) {
    return Error{ErrorCode::kInvalidOption, std::string(name), "an integer", echoed(*text)};
  }
  return {};
}

// Chooses the format by Accept if the query names none.
Status choose_format(Request& request, RequestOptions& options) {
  const MediaTypeOf media_type =
      options.animation.is_sequence() ? sequence_media_type : format_media_type;
  VOXELD_ASSIGN(const std::optional<Format> format,
                requested_format(request, media_type, media_type(options.output.format)));
  if (format) options.output.format = *format;
  return {};
}

// The options of a voxelization, whose format Accept may name. Some options depend on the
// format, and the format's media types on whether there are frames.
Result<RequestOptions> voxelize_options(Request& request, OptionScope scope) {
  OptionPairs pairs = option_pairs(request), others = pairs;
  static constexpr std::string_view kOfFormats[] = {"layout",  "mesh",          "compress",
                                                    "channel", "palette",       "blocks",
                                                    "dither",  "schem_version", "zarr_version"};
  std::erase_if(others,
                [](const auto& pair) { return std::ranges::count(kOfFormats, pair.first) != 0; });
  VOXELD_ASSIGN(RequestOptions options, parse_options(others, scope));
  VOXELD_TRY(choose_format(request, options));
  if (others.size() == pairs.size()) return options;
  std::erase_if(pairs, [](const auto& pair) { return pair.first == "format"; });
  pairs.emplace_back("format", format_name(options.output.format));
  return parse_options(pairs, scope);
}

Result<JobRequest> parse_request(Request& request, JobKind kind) {
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
  if (kind == JobKind::kVoxelize) {
    VOXELD_ASSIGN(job.options, voxelize_options(request, option_scope(job)));
  } else {
    VOXELD_ASSIGN(job.options, parse_options(option_pairs(request), option_scope(job)));
  }
  job.filename = job.options.filename;
  VOXELD_TRY(read_integer(request, "priority", job.priority));
  VOXELD_TRY(read_integer(request, "deadline_ms", job.deadline_ms));
  VOXELD_TRY(check_texts(job));
  VOXELD_TRY(check_urgency(job));
  return job;
}

Reply run(Request& request, Api& api, JobKind kind) {
  auto job = parse_request(request, kind);
  if (!job) return problem(request, job.error());
  const auto respond = [&api](Request& asking, const JobStatus& status) {
    return job_result_response(asking, api, status);
  };
  if (!job->asset.empty() || !job->grid.empty() || !job->sequence.empty()) {
    return run_transient(request, api, *job, respond);
  }
  return receive_upload(request, api, Durability::kSoon,
                        [&api, job = *std::move(job), respond](Request& asking, Upload upload) {
                          JobRequest on_upload = job;
                          on_upload.asset = upload.asset.id;
                          on_upload.filename = std::move(upload.filename);
                          return run_transient(asking, api, on_upload, std::move(upload.place),
                                               upload.ms, respond);
                        });
}

}  // namespace

Reply voxelize(Request& request, Api& api) {
  return run(request, api, JobKind::kVoxelize);
}

Reply render(Request& request, Api& api) {
  return run(request, api, JobKind::kRender);
}

}  // namespace voxeld::api
