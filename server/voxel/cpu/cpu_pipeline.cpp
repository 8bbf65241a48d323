#include "server/voxel/cpu/cpu_pipeline.h"

#include <utility>

#include "server/base/clock.h"
#include "server/voxel/tiles/compact.h"
#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {

CpuPipeline::CpuPipeline(int threads, CpuIsa isa)
    : touch_(threads, isa), attributes_(touch_.team(), isa) {}

Status CpuPipeline::begin_job(const VoxelizePlan& plan, VoxelizeStats& stats) {
  plan_ = &plan;
  stats_ = &stats;
  touch_.set_rule(plan.options.rule);
  if (!plan.records) return {};
  Stopwatch watch;
  attributes_.begin_job(plan);
  add_stage(stats.passes, "textures", watch.lap());
  mask_.resize(kTileMaskWords);
  word_offsets_.resize(kTileMaskWords);
  return {};
}

void CpuPipeline::end_job() {
  attributes_.end_job();
  plan_ = nullptr;
  stats_ = nullptr;
}

// Without attributes each thread takes whole tiles. A batch needs several tiles per thread to
// balance them.
size_t CpuPipeline::batch_tiles() const {
  const bool one_by_one = plan_ != nullptr && plan_->records.has_value();
  return one_by_one ? 1 : 4 * static_cast<size_t>(touch_.threads());
}

Status CpuPipeline::run_tiles(std::span<const TileBin> bins, const Pause& /*pause*/,
                              std::vector<SparseTile>& tiles) {
  std::vector<SparseTile> made(bins.size());
  for (size_t i = 0; i < bins.size(); ++i) {
    made[i].coord = {bins[i].coord.x, bins[i].coord.y, bins[i].coord.z};
  }
  if (plan_->records) {
    for (size_t i = 0; i < bins.size(); ++i) run_attributes(bins[i], made[i]);
  } else {
    Stopwatch watch;
    touch_.run(plan_->mesh, plan_->spec, bins, made);
    add_stage(stats_->passes, "occupancy", watch.lap());
  }
  stats_->tiles += static_cast<int64_t>(bins.size());
  for (SparseTile& tile : made) {
    if (!tile.masks.empty()) tiles.push_back(std::move(tile));
  }
  return {};
}

void CpuPipeline::finish_tiles(std::span<const TileBin> bins, std::span<SparseTile> tiles) {
  Stopwatch watch;
  auto bin = bins.begin();
  for (SparseTile& tile : tiles) {
    const glm::ivec3 coord(tile.coord[0], tile.coord[1], tile.coord[2]);
    while (bin->coord != coord) ++bin;
    expand_mask(tile, mask_);
    uint64_t blocks = 0;
    number_words(tile, word_offsets_, blocks);
    attributes_.finish(*bin, mask_, word_offsets_, tile);
  }
  add_stage(stats_->passes, "finish", watch.lap());
}

std::vector<SparseTile> CpuPipeline::touch_tiles(const SnappedMesh& mesh, const GridSpec& spec,
                                                 std::span<const TileBin> bins) {
  touch_.set_rule(Rule::kTouch);
  std::vector<SparseTile> tiles(bins.size());
  for (size_t i = 0; i < bins.size(); ++i) {
    tiles[i].coord = {bins[i].coord.x, bins[i].coord.y, bins[i].coord.z};
  }
  touch_.run(mesh, spec, bins, tiles);
  std::erase_if(tiles, [](const SparseTile& tile) { return tile.empty(); });
  return tiles;
}

void CpuPipeline::run_attributes(const TileBin& bin, SparseTile& tile) {
  Stopwatch watch;
  const uint64_t blocks = touch_.run(plan_->mesh, plan_->spec, bin, mask_);
  add_stage(stats_->passes, "occupancy", watch.lap());
  compact_mask(mask_, blocks, tile, word_offsets_);
  add_stage(stats_->passes, "compact", watch.lap());
  attributes_.run(bin, mask_, word_offsets_, tile);
  add_stage(stats_->passes, "attributes", watch.lap());
}

}  // namespace voxeld
