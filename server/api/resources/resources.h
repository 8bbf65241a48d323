// The handlers of all routes, by resource; routes.cpp has the table of them.
#pragma once

#include <string>

#include "server/api/resources/api.h"

namespace voxeld::api {

// --- index.cpp
Reply get_index(Request& request, Api& api);
Reply get_openapi(Request& request, Api& api);
// --- web.cpp
Reply get_page(Request& request, Api& api);
Reply get_web_file(Request& request, Api& api);
// Whether this daemon has a page for browsers.
bool has_page(const Api& api);
// --- one_shot.cpp
Reply voxelize(Request& request, Api& api);
Reply render(Request& request, Api& api);
// --- assets.cpp
Reply post_asset(Request& request, Api& api);
Reply list_assets(Request& request, Api& api);
Reply get_asset(Request& request, Api& api);
Reply delete_asset(Request& request, Api& api);
// --- jobs.cpp
Reply post_job(Request& request, Api& api);
Reply list_jobs(Request& request, Api& api);
Reply get_job(Request& request, Api& api);
Reply delete_job(Request& request, Api& api);
// --- job_tiles.cpp
Reply get_tiles_of_job(Request& request, Api& api);
// --- queue.cpp
Reply get_queue(Request& request, Api& api);
// --- events.cpp
Reply get_events(Request& request, Api& api);
// --- results.cpp
Reply get_result(Request& request, Api& api);
// Whether get_result() takes the options of this query. Errors: invalid-option.
Status check_result_query(const JobStatus& status, OptionPairs query);
// --- stored_results.cpp
Reply list_results(Request& request, Api& api);
Reply list_grids(Request& request, Api& api);
Reply list_sequences(Request& request, Api& api);
Reply delete_result(Request& request, Api& api);
Reply delete_grid(Request& request, Api& api);
Reply delete_sequence(Request& request, Api& api);
// --- grids.cpp
Reply get_grid(Request& request, Api& api);
Reply get_tiles(Request& request, Api& api);
Reply get_tile(Request& request, Api& api);
Reply get_zarr(Request& request, Api& api);
Reply get_zarr2(Request& request, Api& api);
Reply render_grid(Request& request, Api& api);
Reply render_grid_png(Request& request, Api& api);
// The responses of /v1/grids/{id} and its render.png, of any grid.
Reply grid_response(Request& request, Api& api, const std::string& grid);
Reply grid_image(Request& request, Api& api, const std::string& grid);
// --- sequences.cpp
Reply list_frames_of_job(Request& request, Api& api);
Reply get_frame_of_job(Request& request, Api& api);
Reply render_frame_of_job(Request& request, Api& api);
Reply get_sequence(Request& request, Api& api);
Reply list_frames_of_sequence(Request& request, Api& api);
Reply get_frame_of_sequence(Request& request, Api& api);
Reply render_frame_of_sequence(Request& request, Api& api);
Reply render_sequence(Request& request, Api& api);
// --- share.cpp
Reply share_job(Request& request, Api& api);
Reply share_grid(Request& request, Api& api);
// --- keys.cpp
Reply list_keys(Request& request, Api& api);
Reply post_key(Request& request, Api& api);
Reply patch_key(Request& request, Api& api);
Reply delete_key(Request& request, Api& api);
// --- me.cpp
Reply get_me(Request& request, Api& api);

}  // namespace voxeld::api
