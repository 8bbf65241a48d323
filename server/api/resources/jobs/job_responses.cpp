#include "server/api/resources/jobs/job_responses.h"

#include <algorithm>
#include <array>
#include <charconv>
#include <cstdio>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <span>
#include <vector>

#include "proto/messages/bundle_manifest.h"
#include "proto/messages/job_text.h"
#include "proto/output_format.h"
#include "proto/text/client_texts.h"
#include "server/api/accept.h"
#include "server/http/file_response.h"

namespace voxeld::api {
namespace {

using Json = nlohmann::json;

constexpr size_t kMetaHeaderBytesMax = 4096;
// Memory of a response with a job's long texts: the row, and the text that is sent.
constexpr int64_t kWholeStatusBytesMax = int64_t{4} << 20;

std::string text_member(const Json& object, const char* name) {
  const auto it = object.find(name);
  return it != object.end() && it->is_string() ? it->get<std::string>() : std::string();
}

// Members of meta that go into headers: where the grid lies, and facts about its contents.
constexpr std::array<std::string_view, 26> kBriefMembers = {
    "dims",           "origin", "voxel_size", "voxel_count",     "triangles",
    "units",          "frames", "fps",        "animation",       "mesh",
    "solid",          "level",  "level_rule", "region",          "mirror",
    "keep",           "dilate", "erode",      "hollow",          "neighbors",
    "palette_colors", "of",     "drawn",      "host_bytes_peak", "host_bytes_estimate",
    "band_voxels"};
constexpr std::array<std::string_view, 3> kOwnHeaders = {"content_hash", "pipeline", "device"};

// Parses these members of meta; it may have megabytes of others.
Json header_members(const std::string& meta_json) {
  const auto is_kept = [](const std::string& name) {
    return std::ranges::find(kBriefMembers, name) != kBriefMembers.end() ||
           std::ranges::find(kOwnHeaders, name) != kOwnHeaders.end();
  };
  const Json::parser_callback_t keep = [&](int depth, Json::parse_event_t event, Json& parsed) {
    const bool is_member = depth == 1 && event == Json::parse_event_t::key;
    return !is_member || is_kept(parsed.get_ref<const std::string&>());
  };
  return Json::parse(meta_json, keep, /*allow_exceptions=*/false);
}

std::string meta_header(const Json& meta) {
  Json brief = meta;
  for (const std::string_view name : kOwnHeaders) brief.erase(std::string(name));
  std::string text = brief.dump(-1, ' ', true);
  return text.size() <= kMetaHeaderBytesMax ? text : "{}";
}

struct MetaHeaders {
  std::string content_hash, pipeline, device, brief;
};

// The meta of this thread's last job is cached: a client that fetches a result in ranges requests
// it repeatedly, and parsing takes longer than finding the job. The key is the job, so that
// response times reveal nothing about other tenants. The meta of a job that has ended is final.
Result<const MetaHeaders*> meta_headers(const Request& request, Api& api, const JobStatus& status) {
  thread_local std::string last_job;
  thread_local MetaHeaders headers;
  if (last_job == status.id) return &headers;
  last_job.clear();  // should the rest throw
  headers = {};
  std::string meta_json = status.result->meta_json;
  if (meta_json.empty()) {
    VOXELD_ASSIGN(JobStatus whole, api.jobs.get_whole(request.caller, status.id));
    if (whole.result) meta_json = std::move(whole.result->meta_json);
  }
  if (const Json meta = header_members(meta_json); meta.is_object()) {
    headers = {text_member(meta, "content_hash"), text_member(meta, "pipeline"),
               text_member(meta, "device"), meta_header(meta)};
  }
  last_job = status.id;
  return &headers;
}

void add_result_headers(Response& response, const JobStatus& status, const MetaHeaders& meta) {
  const JobResult& result = *status.result;
  auto& headers = response.headers;
  headers["X-Voxeld-Job"] = status.id;
  if (!result.grid.empty()) headers["X-Voxeld-Grid"] = result.grid;
  if (!result.sequence.empty()) headers["X-Voxeld-Sequence"] = result.sequence;
  headers["X-Voxeld-Content-Hash"] = meta.content_hash;
  headers["X-Voxeld-Pipeline"] = meta.pipeline;
  headers["X-Voxeld-Device"] = meta.device;
  headers["X-Voxeld-Meta"] = meta.brief;
  std::string warnings;
  for (const Warning& warning : result.warnings) {
    warnings += (warnings.empty() ? "" : ", ") + warning.code;
  }
  if (!warnings.empty()) headers["X-Voxeld-Warnings"] = warnings;
  headers["Server-Timing"] = server_timing(status);
  headers["Cache-Status"] = status.cached ? "voxeld; hit" : "voxeld; fwd=miss";
  std::erase_if(headers, [](const auto& entry) { return entry.second.empty(); });
}

// "one of application/x-npy, …": each type once.
Error not_acceptable(std::string_view accept, const std::vector<std::string_view>& offered) {
  std::string types;
  for (size_t i = 0; i < offered.size(); ++i) {
    const auto before = std::span(offered).first(i);
    if (std::ranges::find(before, offered[i]) != before.end()) continue;
    types += (types.empty() ? "" : ", ") + std::string(offered[i]);
  }
  return {ErrorCode::kNotAcceptable, "Accept names no type that there is",
          (offered.size() > 1 ? "one of " : "") + types,
          "\"" + header_safe(accept.substr(0, 120)) + "\""};
}

Error ended_error(const JobStatus& status) {
  if (status.error) return *status.error;
  return {status.state == JobState::kCancelled ? ErrorCode::kCancelled : ErrorCode::kInternal,
          "the job " + status.id + " has no result", "", std::string(job_state_name(status.state))};
}

// The extension of a result's file name: that of its format, as in "grid.nii.gz", else what
// follows the last dot.
std::string_view known_extension(std::string_view name) {
  for (const FormatInfo& info : output_formats()) {
    for (const std::string_view extension : {info.extension, info.sequence_extension}) {
      if (name.ends_with(extension)) return name.substr(name.size() - extension.size());
    }
  }
  const size_t dot = name.rfind('.');
  return dot == std::string_view::npos ? std::string_view() : name.substr(dot);
}

// "models/bunny.ply" -> "bunny"; "bundle.zip!a/spot.obj" -> "spot"; "walk.bundle.json" -> "walk".
std::string stem_of(std::string_view name, std::string_view extension) {
  constexpr std::string_view kInZip = ".zip!";
  if (const size_t zip = name.rfind(kInZip); zip != std::string_view::npos) {
    name = name.substr(zip + kInZip.size());
  }
  name = name.substr(name.rfind('/') + 1);
  for (const std::string_view end : {extension, kBundleExtension}) {
    if (!end.empty() && name.ends_with(end))
      return std::string(name.substr(0, name.size() - end.size()));
  }
  return std::filesystem::path(name).stem().string();
}

// As job_result_response(); `mesh` is the name of the mesh that the result comes from, or empty.
Response result_response(const Request& request, Api& api, const JobAndResult& found,
                         std::string_view mesh) {
  const JobStatus& status = found.status;
  const Result<StoredBlob>& blob = found.file;
  if (!status.ended()) {
    return problem(request, {ErrorCode::kConflict, "the job " + status.id + " has not ended",
                             "done", std::string(job_state_name(status.state))});
  }
  if (status.state != JobState::kDone || !status.result) {
    Response failed = problem(request, ended_error(status));
    // A failed job stays failed, however often its result is asked for.
    failed.headers.erase("Retry-After");
    return failed;
  }
  if (!blob) return problem(request, blob.error());
  const FileBody file{blob->path, 0, blob->bytes};
  auto response = http::file_response(request.head, file, "\"" + blob->id + "\"");
  if (!response) return problem(request, response.error());
  const auto meta = meta_headers(request, api, status);
  if (!meta) return problem(request, meta.error());
  add_result_headers(*response, status, **meta);
  if (response->status == 200 || response->status == 206) {
    response->headers["Content-Type"] = status.result->media_type;
    const auto name = download_name(request, mesh, status.result->filename);
    if (!name) return problem(request, name.error());
    if (!name->empty()) response->headers["Content-Disposition"] = content_disposition(*name);
  }
  return std::move(response).value();
}

}  // namespace

Response problem(const Request& request, const Error& error) {
  return Response::problem(error, request.head.path, request.trace.trace_id);
}

Status check_json_type(const Request& request) {
  constexpr std::string_view kMediaType = "application/json";
  if (request.head.media_type() == kMediaType) return {};
  return Error{ErrorCode::kUnsupportedMedia, "Content-Type of the body", std::string(kMediaType),
               "\"" + header_safe(request.head.header("Content-Type").substr(0, 80)) + "\""};
}

Result<std::string> query_word(const Request& request, std::string_view name,
                               std::initializer_list<std::string_view> words) {
  const auto value = request.query(name);
  if (!value) return std::string();
  std::string expected;
  for (const std::string_view word : words) {
    if (*value == word) return *value;
    if (!expected.empty()) expected += " | ";
    expected += word;
  }
  return Error{ErrorCode::kInvalidOption, std::string(name), expected, echoed(*value)};
}

std::string server_timing(const JobStatus& status) {
  std::string text = status.cached ? "cache;desc=hit" : "";
  for (const auto& [stage, ms] : status.timings) {
    char number[32];
    std::snprintf(number, sizeof number, "%.3f", ms);
    text += (text.empty() ? "" : ", ") + stage + ";dur=" + number;
  }
  return text;
}

int preferred_wait_seconds(const Request& request) {
  const std::string_view prefer = request.head.header("Prefer");
  const size_t at = prefer.find("wait=");
  if (at == std::string_view::npos) return 0;
  int seconds = 0;
  const auto [end, error] =
      std::from_chars(prefer.data() + at + 5, prefer.data() + prefer.size(), seconds);
  if (error == std::errc::result_out_of_range && prefer[at + 5] != '-') {
    return limits::kPreferWaitSecondsMax;
  }
  return std::clamp(seconds, 0, limits::kPreferWaitSecondsMax);
}

Response status_response(const Request& request, Api& api, int http_status,
                         const JobStatus& status) {
  Response response = Response::json(http_status, "");
  // Weak: expected times and the place in the queue change without a new version.
  response.headers["ETag"] = "W/\"" + std::to_string(status.version) + "\"";
  if (std::string timing = server_timing(status); !timing.empty()) {
    response.headers["Server-Timing"] = std::move(timing);
  }
  std::string text = job_status_text(status);
  if (!is_brief(status) && text.size() <= static_cast<size_t>(kTextBytesMax)) {
    response.body = std::move(text);
    return response;
  }
  response.body = PieceBody{
      [&api, caller = request.caller, id = status.id, cached = status.cached]() -> Result<Piece> {
        VOXELD_ASSIGN(JobStatus whole, api.jobs.get_whole(caller, id));
        whole.cached = cached;
        return Piece{job_status_text(whole), true};
      },
      kWholeStatusBytesMax};
  return response;
}

Result<std::optional<Format>> requested_format(Request& request, MediaTypeOf media_type,
                                               std::string_view own_type) {
  if (const auto name = request.query("format")) {
    const auto format = format_from_name(*name);
    if (format) return format;
    return Error{ErrorCode::kInvalidOption, "format", format_names(", "), echoed(*name)};
  }
  request.is_negotiated = true;
  std::vector<std::string_view> offered = {own_type};
  if (media_type != nullptr) {
    for (const FormatInfo& info : output_formats()) offered.push_back(media_type(info.format));
  }
  const std::string_view accept = request.head.header("Accept");
  const auto chosen = preferred_type(accept, offered);
  if (!chosen) return not_acceptable(accept, offered);
  if (*chosen == 0) return std::optional<Format>();
  return std::optional(output_formats()[*chosen - 1].format);
}

Result<std::string> download_name(const Request& request, std::string_view mesh,
                                  std::string_view own) {
  const std::string_view extension = known_extension(own);
  // `filename` of a POST names its mesh; the worker has named the result after it.
  const bool is_read = request.head.method == "GET" || request.head.method == "HEAD";
  const auto wanted = is_read ? request.query("filename") : std::nullopt;
  if (wanted) VOXELD_TRY(check_filename(*wanted));
  for (const std::string& name : {stem_of(wanted.value_or(""), extension), stem_of(mesh, "")}) {
    if (!name.empty()) return name + std::string(extension);
  }
  return std::string(own);
}

Response job_result_response(const Request& request, Api& api, const JobStatus& status) {
  return job_result_response(request, api, status, "");
}

Response job_result_response(const Request& request, Api& api, const JobStatus& status,
                             std::string_view mesh) {
  return result_response(request, api, JobAndResult{status, api.jobs.result_of(status)}, mesh);
}

Response job_result_response(const Request& request, Api& api, const JobAndResult& found) {
  return result_response(request, api, found, "");
}

}  // namespace voxeld::api
