#include "server/worker/grids/tile_parts.h"

#include <algorithm>
#include <cmath>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <utility>

#include "proto/messages/json_fields.h"
#include "proto/messages/task_api.h"
#include "server/base/algorithm_version.h"
#include "server/base/disk/file.h"
#include "server/base/log.h"
#include "server/grid/tile_source.h"

namespace voxeld {
namespace {

using nlohmann::json;

// After this many parts, and again after as many, parts are made half as often. Even the longest
// jobs then have fewer than kPartsMax.
constexpr int64_t kPartsBeforeDoubling = 512;
// The first part comes after a fifth of the interval, the second after two more fifths, and so on:
// clients see the first tiles of a grid soon.
constexpr int64_t kPartsBeforeInterval = 5;

// The meta of a part: how far the job is with it.
struct PartSteps {
  int algorithm_version = 0;
  uint64_t steps_done = 0;  // that this part and those before it cover
  uint64_t steps = 0;       // of the whole job
};
void visit_fields(IsA<PartSteps> auto& part, auto& visit) {
  visit.name("part");
  visit(kRequired, "algorithm_version", part.algorithm_version);
  visit(kRequired, "steps_done", part.steps_done);
  visit(kRequired, "steps", part.steps);
}

// The steps that all parts up to this one cover; 0 if it does not belong to this work.
size_t steps_of(const GridHeader& part, size_t steps, const GridHeader& header) {
  PartSteps made;
  if (!read_fields(json::parse(part.meta_json, nullptr, false), made) ||
      made.algorithm_version != kAlgorithmVersion || made.steps != steps) {
    return 0;
  }
  const bool is_same = part.dims == header.dims && part.origin == header.origin &&
                       part.voxel_size == header.voxel_size && part.channels == header.channels &&
                       part.codecs == header.codecs;
  return is_same && made.steps_done <= steps ? made.steps_done : 0;
}

}  // namespace

// Checks all parts before the first tile is passed on.
bool TileParts::fits(size_t steps, const GridHeader& header, size_t& steps_done) const {
  steps_done = 0;
  for (const std::string& path : run_.task.part_paths) {
    const auto file = MappedFile::open(path);
    const auto reader = file ? GridReader::open(file->bytes()) : file.error();
    const size_t done = reader ? steps_of(reader->header(), steps, header) : 0;
    if (done <= steps_done) return false;
    steps_done = done;
  }
  return true;
}

Result<size_t> TileParts::load(size_t steps, const GridHeader& header, const Take& take) {
  steps_ = steps;
  since_last_.lap();
  size_t steps_done = 0;
  if (run_.task.part_paths.empty()) return size_t{0};
  if (!fits(steps, header, steps_done)) {
    log::warn("parts of an earlier attempt are of other work", {{"job", run_.task.id}});
    return size_t{0};
  }
  // Loading does not need the device.
  run_.slice.end();
  for (const std::string& path : run_.task.part_paths) VOXELD_TRY(load_part(path, take));
  VOXELD_TRY(run_.slice.begin());
  position_ = static_cast<int64_t>(run_.task.part_paths.size());
  log::info("goes on after an earlier attempt",
            {{"job", run_.task.id}, {"steps_done", steps_done}, {"steps", steps}});
  since_last_.lap();
  return steps_done;
}

Status TileParts::load_part(const std::string& path, const Take& take) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  VOXELD_ASSIGN(const GridReader reader, GridReader::open(file.bytes()));
  const ContainerTiles tiles(reader, [this] { return run_.monitor.check(); });
  const size_t count = reader.tile_count(), step = tiles.batch();
  for (size_t at = 0; at < count; at += step) {
    const size_t end = std::min(count, at + step);
    VOXELD_ASSIGN(std::vector<SparseTile> decoded, read_tiles(tiles, at, end));
    std::vector<EncodedTile> encoded;
    for (size_t i = at; i < end; ++i) encoded.push_back(encoded_tile(file.bytes(), reader, i));
    VOXELD_TRY(take(encoded, std::move(decoded)));
  }
  return {};
}

bool TileParts::is_time() const {
  const auto doublings = static_cast<int>(position_ / kPartsBeforeDoubling);
  const double share = static_cast<double>(std::min(position_ + 1, kPartsBeforeInterval)) /
                       static_cast<double>(kPartsBeforeInterval);
  return since_last_.ms() >=
         std::ldexp(share * static_cast<double>(run_.engine.part_interval.count()), doublings);
}

Status TileParts::reached(GridFile& file, size_t steps_done) {
  const bool has_room = steps_done < steps_ && position_ < kPartsMax;
  run_.monitor.set_preemptible(has_room);
  const bool preempts = run_.monitor.is_asked_to_preempt();
  if (!has_room || !(preempts || is_time())) return {};
  const std::filesystem::path path =
      run_.scratch / (run_.task.id + "-part-" + std::to_string(position_));
  const PartSteps meta = {kAlgorithmVersion, steps_done, steps_};
  Status kept = file.write_part(path, fields_json<json>(meta).dump());
  if (kept) kept = run_.monitor.report_part(position_, path);
  since_last_.lap();
  if (kept) {
    ++position_;
    return preempts ? Status(voxeld::preempt(run_)) : Status();
  }
  // Without this part, later ones would not follow the earlier ones, so no more are made.
  position_ = kPartsMax;
  if (kept.error().code == ErrorCode::kCancelled) return kept;
  log::warn("a part cannot be kept", {{"job", run_.task.id}, {"error", kept.error().message()}});
  std::error_code ignored;
  std::filesystem::remove(path, ignored);
  return {};
}

}  // namespace voxeld
