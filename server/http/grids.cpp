// /v1/grids/{id}: the native container, its tiles, exports and previews.
#include <charconv>
#include <nlohmann/json.hpp>

#include "proto/grid_format.h"
#include "server/base/file.h"
#include "server/http/api.h"
#include "server/http/exchange.h"

namespace voxeld::http {
namespace {

using Json = nlohmann::json;

Result<JobRequest> request_on_grid(const Request& request, const std::string& grid, JobKind kind) {
  JobRequest job;
  job.kind = kind;
  job.grid = grid;
  VOXELD_ASSIGN(job.options, parse_options(request.head.query, option_scope(job)));
  return job;
}

Response run_on_grid(Request& request, Api& api, const std::string& grid, JobKind kind) {
  const auto job = request_on_grid(request, grid, kind);
  if (!job) return problem(request, job.error());
  return run_transient(request, api, *job);
}

// The grid that the path names, or the level or region of it that the query asks for: a grid of its
// own, which is made once.
Result<StoredBlob> wanted_grid(Request& request, Api& api) {
  if (request.head.query.empty()) {
    return api.jobs.get_grid(request.caller, request.path_parameters[0]);
  }
  for (const auto& [name, value] : request.head.query) {
    if (name == "level" || name == "level_rule" || name == "region") continue;
    return Error{ErrorCode::kUnknownOption, "tiles are of native grids",
                 "level, level_rule and region", "\"" + name.substr(0, 40) + "\""};
  }
  VOXELD_ASSIGN(const JobRequest job,
                request_on_grid(request, request.path_parameters[0], JobKind::kExport));
  SubmitOptions submit;
  submit.transient = true;
  submit.request_id = request.request_id;
  submit.trace_id = request.trace.trace_id;
  VOXELD_ASSIGN(const JobStatus submitted, api.jobs.submit(request.caller, job, submit));
  const auto deadline = JobService::Clock::now() + std::chrono::seconds(kOneShotSecondsMax);
  VOXELD_ASSIGN(const JobStatus status,
                api.jobs.wait_end(request.caller, submitted.id, deadline,
                                  [&] { return is_abandoned(request, api); }));
  if (!api.access.still_admits(request.key_id)) return no_valid_key();
  if (!status.ended()) {
    (void)api.jobs.cancel(request.caller, submitted.id);
    return Error{ErrorCode::kDeadlineExceeded, "the job " + submitted.id + " did not end in time",
                 "", std::string(job_state_name(status.state))};
  }
  if (status.error) return *status.error;
  if (!status.result) {
    return Error{ErrorCode::kInternal, "the job " + submitted.id + " has no result", "", ""};
  }
  // All cells at level 0 are the grid itself, under whatever name its bytes have.
  return api.jobs.get_result(request.caller, submitted.id);
}

// Calls `use(reader)` on the mapped container.
template <typename Use>
Response with_grid(Request& request, Api& api, Use&& use) {
  auto blob = wanted_grid(request, api);
  if (!blob) return problem(request, blob.error());
  const auto file = MappedFile::open(blob->path);
  if (!file) return problem(request, file.error());
  const auto reader = GridReader::open(file->bytes());
  if (!reader) return problem(request, reader.error());
  return use(*blob, *reader);
}

Response get_tiles(Request& request, Api& api) {
  return with_grid(request, api, [](const StoredBlob& blob, const GridReader& reader) {
    Json tiles = Json::array();
    for (size_t i = 0; i < reader.tile_count(); ++i) {
      const auto [offset, bytes] = reader.tile_byte_range(i);
      tiles.push_back({{"index", i},
                       {"coord", reader.tile_coord(i)},
                       {"offset", offset},
                       {"bytes", bytes},
                       {"voxel_count", reader.tile_voxel_count(i)}});
    }
    const GridHeader& header = reader.header();
    return Response::json(200, Json{{"grid", blob.id},
                                    {"dims", header.dims},
                                    {"origin", header.origin},
                                    {"voxel_size", header.voxel_size},
                                    {"voxel_count", reader.voxel_count()},
                                    {"tile_side", limits::kTileSide},
                                    {"tiles", tiles}}
                                   .dump());
  });
}

Response get_tile(Request& request, Api& api) {
  const std::string& text = request.path_parameters[1];
  return with_grid(request, api, [&](const StoredBlob& blob, const GridReader& reader) {
    size_t index = 0;
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), index);
    if (error != std::errc() || end != text.data() + text.size() || index >= reader.tile_count()) {
      return problem(request, {ErrorCode::kNotFound, "there is no such tile",
                               "0 to " + std::to_string(reader.tile_count()) + ", exclusive",
                               "\"" + text.substr(0, 40) + "\""});
    }
    const auto [offset, bytes] = reader.tile_byte_range(index);
    auto response = file_response(
        request.head, {blob.path, static_cast<int64_t>(offset), static_cast<int64_t>(bytes)},
        "\"" + blob.id + "/" + std::to_string(index) + "\"");
    if (!response) return problem(request, response.error());
    if (response->status < 300) response->headers["Content-Type"] = "application/octet-stream";
    return std::move(response).value();
  });
}

}  // namespace

Response grid_response(Request& request, Api& api, const std::string& grid) {
  auto blob = api.jobs.get_grid(request.caller, grid);
  if (!blob) return problem(request, blob.error());
  auto format = requested_format(request);
  if (!format) return problem(request, format.error());
  if (!request.head.query.empty() || (*format && **format != Format::kNative)) {
    if (*format && !request.query("format")) {
      request.head.query.emplace_back("format", format_name(**format));
    }
    return run_on_grid(request, api, grid, JobKind::kExport);
  }
  auto response = file_response(request.head, {blob->path, 0, blob->bytes}, "\"" + blob->id + "\"");
  if (!response) return problem(request, response.error());
  if (response->status < 300) {
    response->headers["Content-Type"] = std::string(format_media_type(Format::kNative));
    response->headers["Content-Disposition"] = "inline; filename=\"grid.voxg\"";
  }
  return std::move(response).value();
}

Response grid_picture(Request& request, Api& api, const std::string& grid) {
  const std::string picture = request.query("picture").value_or("png");
  if (picture != "png") {
    return problem(request, {ErrorCode::kInvalidOption, "picture",
                             "png here; others from /v1/grids/{id}/render",
                             "\"" + picture.substr(0, 40) + "\""});
  }
  return run_on_grid(request, api, grid, JobKind::kRender);
}

void add_grid_routes(Router& router, Api& api) {
  router.add("GET", "/v1/grids/{id}",
             [&api](Request& r) { return grid_response(r, api, r.path_parameters[0]); });
  router.add("GET", "/v1/grids/{id}/tiles", [&api](Request& r) { return get_tiles(r, api); });
  router.add("GET", "/v1/grids/{id}/tiles/{index}",
             [&api](Request& r) { return get_tile(r, api); });
  router.add("GET", "/v1/grids/{id}/render.png",
             [&api](Request& r) { return grid_picture(r, api, r.path_parameters[0]); });
  router.add("GET", "/v1/grids/{id}/render", [&api](Request& r) {
    return run_on_grid(r, api, r.path_parameters[0], JobKind::kRender);
  });
}

}  // namespace voxeld::http
