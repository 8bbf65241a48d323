// /v1/grids/{id}: the native container, its tiles, exports and previews.
#include <charconv>
#include <utility>

#include "proto/grid_directory.h"
#include "proto/json_writer.h"
#include "server/base/file.h"
#include "server/http/api.h"
#include "server/http/exchange.h"
#include "server/http/list_body.h"

namespace voxeld::http {
namespace {

constexpr ListLimits kTileLimits{4096, 65'536};

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

// Calls `use(directory)` on the mapped container, which is not mapped longer: what is touched of a
// mapping counts as the process's memory.
template <typename Use>
auto with_directory(const StoredBlob& blob, Use&& use)
    -> decltype(use(std::declval<const GridDirectory&>())) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(blob.path));
  VOXELD_ASSIGN(const GridDirectory directory, GridDirectory::open(file.bytes()));
  return use(directory);
}

std::string tile_json(size_t index, const GridTileEntry& tile) {
  std::string text;
  JsonWriter(text)
      .begin_object()
      .member("index", index)
      .member("coord", tile.coord)
      .member("offset", tile.offset)
      .member("bytes", tile.bytes)
      .member("voxel_count", tile.voxel_count)
      .end_object();
  return text;
}

Status add_tiles(const GridDirectory& directory, int64_t after, ListRows& rows) {
  for (auto i = static_cast<size_t>(after + 1); i < directory.tile_count(); ++i) {
    VOXELD_ASSIGN(const GridTileEntry tile, directory.tile(i));
    if (!rows.add(tile_json(i, tile), std::to_string(i))) break;
  }
  return {};
}

// What the list of tiles says of the grid as a whole, as members of an object.
Result<std::string> grid_members(const StoredBlob& blob) {
  return with_directory(blob, [&](const GridDirectory& directory) -> Result<std::string> {
    const GridHeader& header = directory.header();
    std::string text;
    JsonWriter(text)
        .member("grid", blob.id)
        .member("dims", header.dims)
        .member("origin", header.origin)
        .member("voxel_size", header.voxel_size)
        .member("voxel_count", directory.voxel_count())
        .member("tile_count", directory.tile_count())
        .member("tile_side", limits::kTileSide);
    return text;
  });
}

Response get_tiles(Request& request, Api& api) {
  auto page = requested_page(request, kTileLimits, {"level", "level_rule", "region"});
  if (!page) return problem(request, page.error());
  std::erase_if(request.head.query, [](const auto& option) {
    return option.first == "limit" || option.first == "after";
  });
  const auto blob = wanted_grid(request, api);
  if (!blob) return problem(request, blob.error());
  auto members = grid_members(*blob);
  if (!members) return problem(request, members.error());
  return list_response(*std::move(members), "tiles", *std::move(page),
                       [blob = *blob](const std::string& after, ListRows& rows) -> Status {
                         VOXELD_ASSIGN(const int64_t last, cursor_number(after));
                         return with_directory(blob, [&](const GridDirectory& directory) {
                           return add_tiles(directory, last, rows);
                         });
                       });
}

// The entry of the tile whose number the path has. Errors: not-found.
Result<GridTileEntry> wanted_tile(const StoredBlob& blob, const std::string& number) {
  return with_directory(blob, [&](const GridDirectory& directory) -> Result<GridTileEntry> {
    size_t index = 0;
    const char* const text_end = number.data() + number.size();
    const auto [end, error] = std::from_chars(number.data(), text_end, index);
    if (error == std::errc() && end == text_end && index < directory.tile_count()) {
      return directory.tile(index);
    }
    return Error{ErrorCode::kNotFound, "there is no such tile",
                 "0 to " + std::to_string(directory.tile_count()) + ", exclusive",
                 "\"" + number.substr(0, 40) + "\""};
  });
}

Response get_tile(Request& request, Api& api) {
  const std::string& number = request.path_parameters[1];
  const auto blob = wanted_grid(request, api);
  if (!blob) return problem(request, blob.error());
  const auto tile = wanted_tile(*blob, number);
  if (!tile) return problem(request, tile.error());
  auto response = file_response(
      request.head,
      {blob->path, static_cast<int64_t>(tile->offset), static_cast<int64_t>(tile->bytes)},
      "\"" + blob->id + "/" + number + "\"");
  if (!response) return problem(request, response.error());
  if (response->status < 300) response->headers["Content-Type"] = "application/octet-stream";
  return std::move(response).value();
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
