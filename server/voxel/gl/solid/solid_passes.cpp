#include "server/voxel/gl/solid/solid_passes.h"

#include <algorithm>

#include "server/voxel/tiles/tile_mask.h"

namespace voxeld {
namespace {

constexpr size_t kVolumeBytes = size_t{SOLID_TILE_COLUMNS} * SOLID_COLUMN_WORDS * 4;
constexpr size_t kCarryBytes = size_t{SOLID_CARRY_WORDS} * 4;
constexpr size_t kCountBytes = size_t{SOLID_TILE_COLUMNS} * SOLID_SLAB_CELLS * 4;
constexpr size_t kCountCarryBytes = size_t{SOLID_TILE_COLUMNS} * 4;
constexpr size_t kThresholdBytesMax = size_t{SOLID_SLAB_BRICKS} * (1 + 512) * 4;
constexpr size_t kFlagBytes = size_t{SOLID_FLAG_COUNT} * 4;
constexpr int64_t kColumnGroups = SOLID_TILE_COLUMNS / SOLID_GROUP_SIZE;
constexpr int64_t kRunGroups = static_cast<int64_t>(kTileMaskWords) / 16 / SOLID_GROUP_SIZE;

int64_t groups_of(size_t count) {
  return (static_cast<int64_t>(count) + SOLID_GROUP_SIZE - 1) / SOLID_GROUP_SIZE;
}

void wait_for_storage(const gpu::Context& context) {
  context.gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
}

void read_blocks(const gpu::Buffer& from, uint64_t blocks, std::span<uint32_t> out) {
  for_each_block_run(blocks, [&](size_t first_word, size_t word_count) {
    from.read(first_word * 4, out.subspan(first_word, word_count));
  });
}

}  // namespace

SolidSweeps sweeps_of(Sign sign, const glm::ivec3& tiles) {
  SolidSweeps sweeps;
  sweeps.counts = sign == Sign::kNonzero || sign == Sign::kWinding || sign == Sign::kAuto;
  if (sign == Sign::kParity) sweeps.carry_slots[2] = 1;
  if (sign == Sign::kMajority || sign == Sign::kAuto) {
    const auto y = static_cast<size_t>(tiles.y), z = static_cast<size_t>(tiles.z);
    sweeps.carry_slots = {y * z, z, 1};
  }
  return sweeps;
}

Status SolidPasses::begin_job(const SolidSweeps& sweeps, Pipeline pipeline) {
  end_job();
  sweeps_ = sweeps;
  pipeline_ = pipeline;
  const auto make = [&](gpu::Buffer& buffer, size_t bytes, std::string_view label) -> Status {
    VOXELD_ASSIGN(buffer, gpu::Buffer::create(*context_, bytes, label));
    return {};
  };
  VOXELD_TRY(make(params_, sizeof(shared::SolidParams), "inside parameters"));
  VOXELD_TRY(make(mask_, kTileMaskBytes, "cells inside"));
  VOXELD_TRY(make(flags_, kFlagBytes, "flags of cells inside"));
  for (size_t axis = 0; axis < 3; ++axis) {
    if (sweeps.carry_slots[axis] == 0) continue;
    VOXELD_TRY(make(volumes_[axis], kVolumeBytes, "parity of columns"));
    VOXELD_TRY(make(carries_[axis], sweeps.carry_slots[axis] * kCarryBytes, "parity below"));
  }
  if (sweeps.votes()) VOXELD_TRY(make(disagree_, kTileMaskBytes, "cells in doubt"));
  if (sweeps.counts) {
    VOXELD_TRY(make(count_volume_, kVolumeBytes, "winding of columns"));
    VOXELD_TRY(make(counts_, kCountBytes, "sums of signs"));
    VOXELD_TRY(make(count_carries_, kCountCarryBytes, "sums below"));
    VOXELD_TRY(make(thresholds_, size_t{SOLID_SLAB_BRICKS} * 4, "thresholds"));
  }
  if (pipeline == Pipeline::kRaster && sweeps.carry_slots[2] > 0) {
    VOXELD_ASSIGN(slices_, SliceMap::create(*context_));
  }
  return {};
}

void SolidPasses::end_job() {
  slices_ = SliceMap();
  for (size_t axis = 0; axis < 3; ++axis) {
    volumes_[axis] = gpu::Buffer();
    carries_[axis] = gpu::Buffer();
  }
  for (gpu::Buffer* buffer : {&count_volume_, &counts_, &count_carries_, &thresholds_, &mask_,
                              &disagree_, &flags_, &triangles_, &items_, &params_}) {
    *buffer = gpu::Buffer();
  }
}

int64_t SolidPasses::bytes() const {
  size_t bytes = slices_.size_bytes();
  for (size_t axis = 0; axis < 3; ++axis) {
    bytes += volumes_[axis].size_bytes() + carries_[axis].size_bytes();
  }
  for (const gpu::Buffer* buffer : {&count_volume_, &counts_, &count_carries_, &thresholds_, &mask_,
                                    &disagree_, &flags_, &triangles_, &items_, &params_}) {
    bytes += buffer->size_bytes();
  }
  return static_cast<int64_t>(bytes);
}

int64_t SolidPasses::bytes_max(const SolidSweeps& sweeps) {
  size_t bytes = 2 * kTileMaskBytes + kFlagBytes + sizeof(shared::SolidParams) +
                 kSweepTrianglesMax * 9 * 4 + kSweepItemsMax * sizeof(WorkItemWords) +
                 SliceMap::kBytes;
  for (const size_t slots : sweeps.carry_slots) {
    if (slots > 0) bytes += kVolumeBytes + slots * kCarryBytes;
  }
  if (sweeps.counts) bytes += kVolumeBytes + kCountBytes + kCountCarryBytes + kThresholdBytesMax;
  return static_cast<int64_t>(bytes);
}

void SolidPasses::clear_carries(int axis, size_t slot) {
  wait_for_storage(*context_);
  carries_[static_cast<size_t>(axis)].clear(slot * kCarryBytes, kCarryBytes);
}

void SolidPasses::clear_count_carries() {
  wait_for_storage(*context_);
  count_carries_.clear(0, kCountCarryBytes);
}

void SolidPasses::read_carries(int axis, size_t slot, std::span<uint32_t> out) const {
  wait_for_storage(*context_);
  carries_[static_cast<size_t>(axis)].read(slot * kCarryBytes, out);
}

void SolidPasses::read_count_carries(std::span<int32_t> out) const {
  wait_for_storage(*context_);
  count_carries_.read(0, out);
}

void SolidPasses::bind(const shared::SolidParams& params) {
  params_.upload(0, std::span(&params, 1));
  params_.bind_uniform(SOLID_PARAMS);
}

shared::SolidParams SolidPasses::params_of(const SweepTarget& target) const {
  shared::SolidParams params{};
  params.columns = {target.window.u_count - 1, target.window.v_count - 1, 0, 0};
  params.cell_first = target.cell_first - target.tile_first;
  params.cell_last = target.cell_end - 1 - target.tile_first;
  params.is_lowest = target.cell_first == 0 ? 1 : 0;
  return params;
}

Status SolidPasses::begin_parity(int axis) {
  parity_axis_ = axis;
  wait_for_storage(*context_);
  volumes_[static_cast<size_t>(axis)].clear(0, kVolumeBytes);
  if (pipeline_ == Pipeline::kRaster) slices_.clear();
  return {};
}

Status SolidPasses::mark_parity(const SweepWindow& window, const SweepTarget& target) {
  volumes_[static_cast<size_t>(parity_axis_)].bind_storage(SOLID_VOLUME);
  if (pipeline_ == Pipeline::kRaster) {
    if (window.triangle_count() > 0) {
      const auto corners = std::span<const int32_t>(window.corners);
      VOXELD_TRY(gpu::ensure_size(triangles_, *context_, corners.size_bytes(), "sweep triangles"));
      triangles_.upload(0, corners);
      triangles_.bind_storage(SOLID_TRIANGLES);
      bind(params_of(target));
      VOXELD_TRY(slices_.draw(*shaders_, window.triangle_count()));
    }
  } else {
    VOXELD_TRY(mark_items(window, target, false));
  }
  return mark_given(window, target, false);
}

void SolidPasses::begin_counts(int slab) {
  constexpr size_t kSlabBytes = size_t{SOLID_TILE_COLUMNS} * 4;
  wait_for_storage(*context_);
  count_volume_.clear(static_cast<size_t>(slab) * kSlabBytes, kSlabBytes);
}

Status SolidPasses::mark_counts(const SweepWindow& window, const SweepTarget& target) {
  count_volume_.bind_storage(SOLID_VOLUME);
  counts_.bind_storage(SOLID_COUNTS);
  VOXELD_TRY(mark_items(window, target, true));
  return mark_given(window, target, true);
}

Status SolidPasses::mark_items(const SweepWindow& window, const SweepTarget& target, bool counts) {
  if (window.items.empty()) return {};
  const auto corners = std::span<const int32_t>(window.corners);
  const auto items = std::span<const WorkItemWords>(window.items);
  VOXELD_TRY(gpu::ensure_size(triangles_, *context_, corners.size_bytes(), "sweep triangles"));
  VOXELD_TRY(gpu::ensure_size(items_, *context_, items.size_bytes(), "sweep items"));
  triangles_.upload(0, corners);
  items_.upload(0, items);
  triangles_.bind_storage(SOLID_TRIANGLES);
  items_.bind_storage(SOLID_ITEMS);
  gpu::Defines defines;
  if (counts) defines.emplace_back("SOLID_COUNT", "1");
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"solid_crossings.comp"}}, defines));
  shared::SolidParams params = params_of(target);
  params.item_count = static_cast<uint32_t>(items.size());
  bind(params);
  program->use();
  program->dispatch(groups_of(items.size()));
  wait_for_storage(*context_);
  return context_->check("finding crossings");
}

Status SolidPasses::mark_given(const SweepWindow& window, const SweepTarget& target, bool counts) {
  if (window.given.empty()) return {};
  const auto given = std::span<const Crossing>(window.given);
  VOXELD_TRY(gpu::ensure_size(items_, *context_, given.size_bytes(), "sweep items"));
  items_.upload(0, given);
  items_.bind_storage(SOLID_ITEMS);
  gpu::Defines defines;
  if (counts) defines.emplace_back("SOLID_COUNT", "1");
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"solid_given.comp"}}, defines));
  shared::SolidParams params = params_of(target);
  params.item_count = static_cast<uint32_t>(given.size());
  bind(params);
  program->use();
  program->dispatch(groups_of(given.size()));
  wait_for_storage(*context_);
  return context_->check("marking crossings");
}

Status SolidPasses::scan_parity(int axis, size_t slot) {
  const auto index = static_cast<size_t>(axis);
  gpu::Defines defines;
  if (pipeline_ == Pipeline::kRaster) {
    defines.emplace_back("SOLID_SLICES", "1");
    slices_.bind_textures();
  }
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"solid_scan.comp"}}, defines));
  shared::SolidParams params{};
  params.carry_slot = static_cast<uint32_t>(slot);
  bind(params);
  volumes_[index].bind_storage(SOLID_VOLUME);
  carries_[index].bind_storage(SOLID_CARRIES);
  program->use();
  program->dispatch(kColumnGroups);
  wait_for_storage(*context_);
  return context_->check("sweeping parity");
}

Status SolidPasses::scan_counts(int slab, Sign sign, std::span<const int32_t> thresholds) {
  gpu::Defines defines = {{"SOLID_COUNT", "1"}};
  if (sign == Sign::kNonzero) defines.emplace_back("SOLID_NONZERO", "1");
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"solid_scan.comp"}}, defines));
  shared::SolidParams params{};
  params.slab = static_cast<uint32_t>(slab);
  if (!thresholds.empty()) {
    params.has_thresholds = 1;
    VOXELD_TRY(gpu::ensure_size(thresholds_, *context_, thresholds.size_bytes(), "thresholds"));
    thresholds_.upload(0, thresholds);
  }
  bind(params);
  count_volume_.bind_storage(SOLID_VOLUME);
  count_carries_.bind_storage(SOLID_CARRIES);
  counts_.bind_storage(SOLID_COUNTS);
  thresholds_.bind_storage(SOLID_THRESHOLDS);
  program->use();
  program->dispatch(kColumnGroups);
  wait_for_storage(*context_);
  return context_->check("sweeping sums of signs");
}

Status SolidPasses::make_cells(CellsOf what, const glm::ivec3& cells) {
  gpu::Defines defines;
  if (what == CellsOf::kVote) defines.emplace_back("SOLID_VOTE", "1");
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"solid_cells.comp"}}, defines));
  shared::SolidParams params{};
  params.cells = {cells.x, cells.y, cells.z, 0};
  bind(params);
  flags_.clear(0, kFlagBytes);
  (what == CellsOf::kCounts ? count_volume_ : volumes_[2]).bind_storage(SOLID_VOLUME_Z);
  if (what == CellsOf::kVote) {
    volumes_[0].bind_storage(SOLID_VOLUME_X);
    volumes_[1].bind_storage(SOLID_VOLUME_Y);
  }
  if (sweeps_.votes()) disagree_.bind_storage(SOLID_DISAGREE);
  mask_.bind_storage(SOLID_MASK);
  flags_.bind_storage(SOLID_FLAGS);
  program->use();
  program->dispatch(kRunGroups);
  wait_for_storage(*context_);
  return context_->check("making cells inside");
}

void SolidPasses::read_flags(std::span<uint32_t> out) const {
  flags_.read(0, out);
}

void SolidPasses::read_cells(uint64_t blocks, std::span<uint32_t> out) const {
  read_blocks(mask_, blocks, out);
}

void SolidPasses::read_disagreement(uint64_t blocks, std::span<uint32_t> out) const {
  read_blocks(disagree_, blocks, out);
}

}  // namespace voxeld
