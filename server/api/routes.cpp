#include "server/api/routes.h"

#include "server/api/resources/resources.h"

namespace voxeld::api {

std::vector<Route> public_routes(Api& api, int64_t upload_bytes_max) {
  const auto on = [&api](Reply (*handler)(Request&, Api&)) {
    return [&api, handler](Request& request) { return handler(request, api); };
  };
  const BodyRule no_body;
  const BodyRule json{BodyKind::kJson, limits::kJsonBodyBytesMax};
  const BodyRule upload{BodyKind::kUpload, upload_bytes_max};
  constexpr auto kMayStart = Work::kMayStart;
  constexpr auto kNew = Work::kNew;
  constexpr auto kAnyone = Audience::kAnyone;
  // clang-format off
  return {
      {"GET", "/", on(get_index), Work::kNone, no_body, kAnyone},
      {"GET", "/openapi.json", on(get_openapi), Work::kNone, no_body, kAnyone},
      {"POST", "/v1/voxelize", on(voxelize), kNew, upload},
      {"POST", "/v1/render", on(render), kNew, upload},
      {"POST", "/v1/assets", on(post_asset), kNew, upload},
      {"GET", "/v1/assets", on(list_assets)},
      {"GET", "/v1/assets/{id}", on(get_asset), kMayStart},
      {"DELETE", "/v1/assets/{id}", on(delete_asset)},
      {"POST", "/v1/jobs", on(post_job), kNew, json},
      {"GET", "/v1/jobs", on(list_jobs)},
      {"GET", "/v1/jobs/{id}", on(get_job)},
      {"DELETE", "/v1/jobs/{id}", on(cancel_job)},
      {"GET", "/v1/jobs/{id}/events", on(get_events)},
      {"GET", "/v1/jobs/{id}/result", on(get_result), kMayStart},
      {"DELETE", "/v1/jobs/{id}/result", on(delete_result)},
      {"POST", "/v1/jobs/{id}/share", on(share_job), kNew},
      {"GET", "/v1/jobs/{id}/frames", on(list_frames_of_job)},
      {"GET", "/v1/jobs/{id}/frames/{index}", on(get_frame_of_job), kMayStart},
      {"GET", "/v1/jobs/{id}/frames/{index}/render.png", on(render_frame_of_job), kMayStart},
      {"GET", "/v1/queue", on(get_queue)},
      {"GET", "/v1/results", on(list_results)},
      {"GET", "/v1/grids", on(list_grids)},
      {"GET", "/v1/grids/{id}", on(get_grid), kMayStart},
      {"DELETE", "/v1/grids/{id}", on(delete_grid)},
      {"GET", "/v1/grids/{id}/tiles", on(get_tiles), kMayStart},
      {"GET", "/v1/grids/{id}/tiles/{index}", on(get_tile), kMayStart},
      {"GET", "/v1/grids/{id}/render.png", on(render_grid_png), kMayStart},
      {"GET", "/v1/grids/{id}/render", on(render_grid), kMayStart},
      {"POST", "/v1/grids/{id}/share", on(share_grid), kNew},
      {"GET", "/v1/sequences", on(list_sequences)},
      {"GET", "/v1/sequences/{id}", on(get_sequence), kMayStart},
      {"DELETE", "/v1/sequences/{id}", on(delete_sequence)},
      {"GET", "/v1/sequences/{id}/frames", on(list_frames_of_sequence)},
      {"GET", "/v1/sequences/{id}/frames/{index}", on(get_frame_of_sequence), kMayStart},
      {"GET", "/v1/sequences/{id}/frames/{index}/render.png", on(render_frame_of_sequence),
       kMayStart},
      {"GET", "/v1/sequences/{id}/render", on(render_sequence), kMayStart},
      {"GET", "/v1/me", on(get_me)},
  };
  // clang-format on
}

}  // namespace voxeld::api
