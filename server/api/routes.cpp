#include "server/api/routes.h"

#include <algorithm>
#include <initializer_list>

#include "proto/options/table.h"
#include "server/api/resources/resources.h"

namespace voxeld::api {
namespace {

QueryNames joined(std::initializer_list<QueryNames> parts) {
  QueryNames all;
  for (const QueryNames& part : parts) all.insert(all.end(), part.begin(), part.end());
  return all;
}

// The options that requests of any of these kinds take. `filename` names the file of a mesh, or
// the response's file where there is no mesh.
QueryNames options_of(std::initializer_list<OptionScope> scopes) {
  QueryNames names;
  for (const Option& option : option_table()) {
    const bool is_taken =
        std::ranges::any_of(scopes, [&](OptionScope scope) { return option.applies_to(scope); });
    if (is_taken) names.push_back(option.name);
  }
  return names;
}

QueryNames without(QueryNames names, std::initializer_list<std::string_view> excluded) {
  std::erase_if(names, [&](std::string_view name) {
    return std::ranges::find(excluded, name) != excluded.end();
  });
  return names;
}

}  // namespace

std::vector<Route> public_routes(Api& api, int64_t upload_bytes_max) {
  const auto on = [&api](Reply (*handler)(Request&, Api&)) {
    return [&api, handler](Request& request) { return handler(request, api); };
  };
  const BodyRule no_body;
  const BodyRule json{BodyKind::kJson, limits::kJsonBodyBytesMax};
  const BodyRule upload{BodyKind::kUpload, upload_bytes_max};
  constexpr auto kNone = Work::kNone;
  constexpr auto kMayStart = Work::kMayStart;
  constexpr auto kNew = Work::kNew;
  constexpr auto kAnyone = Audience::kAnyone;
  const QueryNames none;
  const QueryNames page = {"limit", "after"};
  const QueryNames page_of_jobs = joined({page, {"state"}});
  const QueryNames urgency = {"priority", "deadline_ms"};
  const QueryNames of_voxelize = joined({{"asset"}, urgency, options_of({OptionScope::kVoxelize})});
  const QueryNames of_render =
      joined({{"asset", "grid", "sequence"},
              urgency,
              options_of({OptionScope::kRenderMesh, OptionScope::kRenderGrid})});
  const QueryNames of_sequence = options_of({OptionScope::kExport});
  const QueryNames of_grid = without(of_sequence, {"frames"});
  const QueryNames views = options_of({OptionScope::kRenderGrid});
  const QueryNames views_of_sequence = without(views, {"turntable"});
  const QueryNames views_of_grid = without(views, {"frames", "frame"});
  const QueryNames one_view = without(views_of_grid, {"turntable", "rate", "columns"});
  const QueryNames selection = {"level", "level_rule", "region"};
  const QueryNames page_of_tiles = joined({page, selection});
  const QueryNames share_result = joined({{"seconds", "view"}, of_sequence});
  const QueryNames share_grid_view = joined({{"seconds", "view"}, of_grid, views_of_grid});
  // clang-format off
  return {
      {"GET", "/", on(get_index), none, kNone, no_body, kAnyone},
      {"GET", "/admin", on(get_page), none, kNone, no_body, kAnyone},
      {"GET", "/web/{name}", on(get_web_file), none, kNone, no_body, kAnyone},
      {"GET", "/openapi.json", on(get_openapi), none, kNone, no_body, kAnyone},
      {"POST", "/v1/voxelize", on(voxelize), of_voxelize, kNew, upload},
      {"POST", "/v1/render", on(render), of_render, kNew, upload},
      {"POST", "/v1/assets", on(post_asset), {"filename"}, kNew, upload},
      {"GET", "/v1/assets", on(list_assets), page},
      {"GET", "/v1/assets/{id}", on(get_asset), {"brief"}, kMayStart},
      {"DELETE", "/v1/assets/{id}", on(delete_asset)},
      {"POST", "/v1/jobs", on(post_job), {"dry_run"}, kNew, json},
      {"GET", "/v1/jobs", on(list_jobs), page_of_jobs},
      {"GET", "/v1/jobs/{id}", on(get_job)},
      {"DELETE", "/v1/jobs/{id}", on(delete_job), {"ended"}},
      {"GET", "/v1/jobs/{id}/events", on(get_events)},
      {"GET", "/v1/jobs/{id}/result", on(get_result), of_sequence, kMayStart},
      {"DELETE", "/v1/jobs/{id}/result", on(delete_result)},
      {"POST", "/v1/jobs/{id}/share", on(share_job), share_result, kNew},
      {"GET", "/v1/jobs/{id}/frames", on(list_frames_of_job), page},
      {"GET", "/v1/jobs/{id}/frames/{index}", on(get_frame_of_job), of_grid, kMayStart},
      {"GET", "/v1/jobs/{id}/frames/{index}/render.png", on(render_frame_of_job), one_view,
       kMayStart},
      {"GET", "/v1/jobs/{id}/tiles", on(get_tiles_of_job), {"after"}},
      {"GET", "/v1/queue", on(get_queue), page},
      {"GET", "/v1/results", on(list_results), page},
      {"GET", "/v1/grids", on(list_grids), page},
      {"GET", "/v1/grids/{id}", on(get_grid), of_grid, kMayStart},
      {"DELETE", "/v1/grids/{id}", on(delete_grid)},
      {"GET", "/v1/grids/{id}/tiles", on(get_tiles), page_of_tiles, kMayStart},
      {"GET", "/v1/grids/{id}/tiles/{index}", on(get_tile), selection, kMayStart},
      {"GET", "/v1/grids/{id}/zarr/{key}", on(get_zarr), none, kMayStart},
      {"GET", "/v1/grids/{id}/zarr2/{key}", on(get_zarr2), none, kMayStart},
      {"GET", "/v1/grids/{id}/render.png", on(render_grid_png), one_view, kMayStart},
      {"GET", "/v1/grids/{id}/render", on(render_grid), views_of_grid, kMayStart},
      {"POST", "/v1/grids/{id}/share", on(share_grid), share_grid_view, kNew},
      {"GET", "/v1/sequences", on(list_sequences), page},
      {"GET", "/v1/sequences/{id}", on(get_sequence), of_sequence, kMayStart},
      {"DELETE", "/v1/sequences/{id}", on(delete_sequence)},
      {"GET", "/v1/sequences/{id}/frames", on(list_frames_of_sequence), page},
      {"GET", "/v1/sequences/{id}/frames/{index}", on(get_frame_of_sequence), of_grid, kMayStart},
      {"GET", "/v1/sequences/{id}/frames/{index}/render.png", on(render_frame_of_sequence),
       one_view, kMayStart},
      {"GET", "/v1/sequences/{id}/render", on(render_sequence), views_of_sequence, kMayStart},
      {"GET", "/v1/me", on(get_me)},
      {"GET", "/v1/keys", on(list_keys), page},
      {"POST", "/v1/keys", on(post_key), none, kNew, json},
      {"PATCH", "/v1/keys/{id}", on(patch_key), none, kNone, json},
      {"DELETE", "/v1/keys/{id}", on(delete_key)},
  };
  // clang-format on
}

}  // namespace voxeld::api
