// Tiles of a job's grid, from its parts while it runs and from its stored grid afterwards.
#include <nlohmann/json.hpp>
#include <string>

#include "proto/messages/job.h"
#include "server/jobs/service/service.h"

namespace voxeld {
namespace {

// Describes what the job makes in place of one whole grid of a mesh; empty if it makes one.
std::string made_instead(const JobStatus& status) {
  const bool is_of_mesh = status.kind == JobKind::kVoxelize || status.kind == JobKind::kRender;
  if (!is_of_mesh) return "kind " + std::string(job_kind_name(status.kind));
  if (status.asset.empty()) return "an image of a stored grid or sequence";
  JobRequest request;
  request.kind = status.kind;
  request.asset = status.asset;
  const auto object = nlohmann::json::parse(status.options_json, nullptr, false);
  const auto options =
      object.is_object() ? parse_options(object, option_scope(request)) : RequestOptions();
  // Options that the status leaves out are long by the times of their frames.
  const bool makes_frames = status.frames_total > 0 || !object.is_object() ||
                            (options && options->animation.is_sequence());
  if (makes_frames) return "an animation: its frames are at /frames";
  if (options && selects(options->output)) return "a level or region of a grid, or changed voxels";
  return "";
}

Status check_makes_grid(const JobStatus& status) {
  std::string got = made_instead(status);
  if (got.empty()) return {};
  return Error{ErrorCode::kConflict, "the job " + status.id + " does not make one whole grid",
               "a voxelize job of a single grid, or a render job of an asset", std::move(got)};
}

}  // namespace

Result<std::optional<TileFile>> Service::tiles_of(const JobStatus& status, int64_t tile) {
  VOXELD_TRY(check_makes_grid(status));
  if (!status.ended()) {
    auto part = parts_.with_tile(status.id, tile);
    if (!part) return std::optional<TileFile>();
    return std::optional(TileFile{std::move(part->path), part->first_tile});
  }
  if (!status.result || status.result->grid.empty()) {
    return Error{ErrorCode::kConflict, "the job " + status.id + " has no grid", "done",
                 std::string(job_state_name(status.state))};
  }
  VOXELD_TRY(jobs_.check_result(status.id));
  VOXELD_ASSIGN(StoredBlob grid, stored(status.result->grid, "the grid of the job " + status.id));
  return std::optional(TileFile{std::move(grid.path), 0});
}

}  // namespace voxeld
