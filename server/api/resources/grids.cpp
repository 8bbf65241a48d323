// /v1/grids/{id}: the native container, its tiles, exports, previews and Zarr stores.
#include <algorithm>
#include <functional>
#include <utility>

#include "proto/container/grid_directory.h"
#include "proto/messages/json_writer.h"
#include "proto/text/client_texts.h"
#include "proto/text/number_text.h"
#include "server/api/resources/jobs/job_responses.h"
#include "server/api/resources/jobs/job_wait.h"
#include "server/api/resources/list_body.h"
#include "server/api/resources/resources.h"
#include "server/api/resources/zarr_member.h"
#include "server/base/disk/file.h"
#include "server/http/file_response.h"

namespace voxeld::api {
namespace {

constexpr ListLimits kTileLimits{4096, 65'536};

Result<JobRequest> request_on_grid(const Request& request, const std::string& grid, JobKind kind) {
  JobRequest job;
  job.kind = kind;
  job.grid = grid;
  VOXELD_ASSIGN(job.options, parse_options(request.head.query, option_scope(job)));
  return job;
}

Reply run_on_grid(Request& request, Api& api, const std::string& grid, JobKind kind) {
  const auto job = request_on_grid(request, grid, kind);
  if (!job) return problem(request, job.error());
  return run_transient(request, api, *job, [&api](Request& asking, const JobStatus& status) {
    return job_result_response(asking, api, status);
  });
}

using OnGrid = std::function<Response(Request&, const StoredBlob&)>;

// The response to a job that made a level or region of a grid. All cells at level 0 are the grid
// itself, under whatever name its bytes have.
Response with_result(Request& request, Api& api, const JobStatus& status, const OnGrid& then) {
  if (!status.result) {
    return problem(request, {ErrorCode::kInternal, "the job " + status.id + " has no result", "",
                             std::string(job_state_name(status.state))});
  }
  const auto blob = api.jobs.get_result(request.caller, status.id);
  return blob ? then(request, *blob) : problem(request, blob.error());
}

// Responds with `then` on the grid that the path names, or on the level or region of it that the
// query asks for: a grid of its own, which is made once.
Reply with_grid(Request& request, Api& api, OnGrid then) {
  const std::string& grid = request.path_parameters[0];
  if (request.head.query.empty()) {
    const auto blob = api.jobs.get_grid(request.caller, grid);
    return blob ? then(request, *blob) : problem(request, blob.error());
  }
  const auto job = request_on_grid(request, grid, JobKind::kExport);
  if (!job) return problem(request, job.error());
  return run_transient(request, api, *job,
                       [&api, then = std::move(then)](Request& asking, const JobStatus& status) {
                         return with_result(asking, api, status, then);
                       });
}

// Calls `use(directory)` on the container, which is mapped for the call only: touched pages of a
// mapping count as memory of the process.
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

// Members of the list of tiles that describe the whole grid.
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

// The entry of the tile whose number the path has. Errors: not-found.
Result<GridTileEntry> wanted_tile(const StoredBlob& blob, const std::string& number) {
  return with_directory(blob, [&](const GridDirectory& directory) -> Result<GridTileEntry> {
    const auto index = parse_number<size_t>(number);
    if (index && *index < directory.tile_count()) return directory.tile(*index);
    return Error{ErrorCode::kNotFound, "there is no such tile",
                 "0 to " + std::to_string(directory.tile_count()) + ", exclusive", echoed(number)};
  });
}

Response tiles_response(const Request& request, const StoredBlob& blob, ListPage page) {
  auto members = grid_members(blob);
  if (!members) return problem(request, members.error());
  return list_response(*std::move(members), "tiles", std::move(page),
                       [blob](const std::string& after, ListRows& rows) -> Status {
                         VOXELD_ASSIGN(const int64_t last, cursor_number(after));
                         return with_directory(blob, [&](const GridDirectory& directory) {
                           return add_tiles(directory, last, rows);
                         });
                       });
}

Response tile_response(const Request& request, const StoredBlob& blob) {
  const std::string& number = request.path_parameters[1];
  const auto tile = wanted_tile(blob, number);
  if (!tile) return problem(request, tile.error());
  auto response = http::file_response(
      request.head,
      {blob.path, static_cast<int64_t>(tile->offset), static_cast<int64_t>(tile->bytes)},
      "\"" + blob.id + "/" + number + "\"");
  if (!response) return problem(request, response.error());
  if (response->status < 300) response->headers["Content-Type"] = "application/octet-stream";
  return std::move(response).value();
}

// Keys of a store: the longest is "labels/material/13/c/16383/255/255/255/0".
constexpr size_t kZarrKeyBytesMax = 64;

bool may_be_zarr_key(std::string_view key) {
  const auto is_known = [](char c) {
    return (c >= 'a' && c <= 'z') || (c >= '0' && c <= '9') || c == '.' || c == '/';
  };
  return key.size() <= kZarrKeyBytesMax && std::ranges::all_of(key, is_known);
}

Response zarr_response(const Request& request, const StoredBlob& store) {
  const std::string& key = request.path_parameters[1];
  const auto find = [&]() -> Result<ZipMember> {
    VOXELD_ASSIGN(const MappedFile file, MappedFile::open(store.path));
    return find_zip_member(file.bytes(), key);
  };
  const auto member = find();
  if (!member) return problem(request, member.error());
  auto response = http::file_response(
      request.head,
      {store.path, static_cast<int64_t>(member->offset), static_cast<int64_t>(member->bytes)},
      "\"" + store.id + "/" + key + "\"");
  if (!response) return problem(request, response.error());
  if (response->status < 300) {
    const size_t name = key.rfind('/') + 1;  // 0 if there is none
    const bool is_document = key.compare(name, 2, ".z") == 0 || key.substr(name) == "zarr.json";
    response->headers["Content-Type"] =
        is_document ? "application/json" : "application/octet-stream";
  }
  return std::move(response).value();
}

// A key of the grid's Zarr store, which a worker makes once, as any export of the grid.
Reply zarr_reply(Request& request, Api& api, std::string_view version) {
  const std::string& grid = request.path_parameters[0];
  if (const auto blob = api.jobs.get_grid(request.caller, grid); !blob) {
    return problem(request, blob.error());
  }
  const std::string& key = request.path_parameters[1];
  if (!may_be_zarr_key(key)) {
    return problem(
        request, {ErrorCode::kNotFound, "no key of a Zarr store",
                  "at most " + std::to_string(kZarrKeyBytesMax) + " of a to z, 0 to 9, '.' and '/'",
                  echoed(key)});
  }
  request.head.query = {{"format", "zarr"}, {"zarr_version", std::string(version)}};
  const auto job = request_on_grid(request, grid, JobKind::kExport);
  if (!job) return problem(request, job.error());
  return run_transient(request, api, *job, [&api](Request& asking, const JobStatus& status) {
    return with_result(asking, api, status, zarr_response);
  });
}

}  // namespace

Reply get_zarr(Request& request, Api& api) {
  return zarr_reply(request, api, "3");
}

Reply get_zarr2(Request& request, Api& api) {
  return zarr_reply(request, api, "2");
}

Reply get_tiles(Request& request, Api& api) {
  auto page = requested_page(request, kTileLimits);
  if (!page) return problem(request, page.error());
  std::erase_if(request.head.query, [](const auto& option) {
    return option.first == "limit" || option.first == "after";
  });
  return with_grid(request, api, [page = *page](Request& asking, const StoredBlob& blob) {
    return tiles_response(asking, blob, page);
  });
}

Reply get_tile(Request& request, Api& api) {
  return with_grid(request, api, [](Request& asking, const StoredBlob& blob) {
    return tile_response(asking, blob);
  });
}

Reply grid_response(Request& request, Api& api, const std::string& grid) {
  auto blob = api.jobs.get_grid(request.caller, grid);
  if (!blob) return problem(request, blob.error());
  auto format = requested_format(request, format_media_type, format_media_type(Format::kNative));
  if (!format) return problem(request, format.error());
  const bool has_options = std::ranges::any_of(
      request.head.query, [](const auto& pair) { return pair.first != "filename"; });
  if (has_options || (*format && **format != Format::kNative)) {
    if (*format && !request.query("format")) {
      request.head.query.emplace_back("format", format_name(**format));
    }
    return run_on_grid(request, api, grid, JobKind::kExport);
  }
  auto response =
      http::file_response(request.head, {blob->path, 0, blob->bytes}, "\"" + blob->id + "\"");
  if (!response) return problem(request, response.error());
  if (response->status < 300) {
    response->headers["Content-Type"] = std::string(format_media_type(Format::kNative));
    const auto name = download_name(request, "", "grid.voxg");
    if (!name) return problem(request, name.error());
    response->headers["Content-Disposition"] = content_disposition(*name);
  }
  return std::move(response).value();
}

Reply grid_image(Request& request, Api& api, const std::string& grid) {
  const std::string image = request.query("image").value_or("png");
  if (image != "png") {
    return problem(request, {ErrorCode::kInvalidOption, "image",
                             "png here; others from /v1/grids/{id}/render", echoed(image)});
  }
  return run_on_grid(request, api, grid, JobKind::kRender);
}

Reply get_grid(Request& request, Api& api) {
  return grid_response(request, api, request.path_parameters[0]);
}

Reply render_grid_png(Request& request, Api& api) {
  return grid_image(request, api, request.path_parameters[0]);
}

Reply render_grid(Request& request, Api& api) {
  return run_on_grid(request, api, request.path_parameters[0], JobKind::kRender);
}

}  // namespace voxeld::api
