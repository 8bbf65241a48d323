#include "server/voxel/gl/solid/gl_flood.h"

#include <algorithm>
#include <array>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/clock.h"
#include "server/voxel/solid/distance/brick_planes.h"
#include "server/voxel/solid/inside/tile_bits.h"
#include "shaders/shared/solid.h"

namespace voxeld {
namespace {

constexpr int kWordCells = 32;

}  // namespace

// Bits of the grid in the words of solid_flood.comp.
struct GlFlood::Grid {
  explicit Grid(const glm::ivec3& of_dims)
      : dims(of_dims),
        words_x(static_cast<size_t>((of_dims.x + kWordCells - 1) / kWordCells)),
        plane_words(words_x * static_cast<size_t>(of_dims.y)) {}

  size_t bytes() const { return plane_words * static_cast<size_t>(dims.z) * 4; }
  // Index of the first word of a row. z counts from the layer's first plane.
  size_t word_of(int y, int z) const {
    return static_cast<size_t>(z) * plane_words + static_cast<size_t>(y) * words_x;
  }
  // Number of planes of a layer of tiles.
  int layer_planes(int tile_z) const {
    return std::min(limits::kTileSide, dims.z - tile_z * limits::kTileSide);
  }
  glm::ivec3 tile_dims() const { return (dims + limits::kTileSide - 1) / limits::kTileSide; }

  void cover(const SparseTile& tile, std::vector<uint32_t>& free) const;
  void rows_of(const glm::ivec3& brick, std::span<const uint32_t> reached, BrickRow& rows) const;

  glm::ivec3 dims;
  size_t words_x, plane_words;
  gpu::Buffer free, reached, changed, params;
};

// Removes the tile's cells from the free cells of its layer.
void GlFlood::Grid::cover(const SparseTile& tile, std::vector<uint32_t>& free_cells) const {
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t) {
    cancel_point();
    const auto at = morton_decode(morton);
    const BrickPlanes planes = planes_of_brick(mask);
    const int x = tile.coord[0] * limits::kTileSide + static_cast<int>(at[0]) * limits::kBrickSide;
    for (int row = 0; row < limits::kBrickSide * limits::kBrickSide; ++row) {
      const int in_y = row % limits::kBrickSide, in_z = row / limits::kBrickSide;
      const int y =
          tile.coord[1] * limits::kTileSide + static_cast<int>(at[1]) * limits::kBrickSide + in_y;
      const int z = static_cast<int>(at[2]) * limits::kBrickSide + in_z;
      const auto cells =
          static_cast<uint32_t>(planes[static_cast<size_t>(in_z)] >> (8 * in_y) & 0xff);
      if (cells == 0 || y >= dims.y || z >= layer_planes(tile.coord[2])) continue;
      free_cells[word_of(y, z) + static_cast<size_t>(x / kWordCells)] &=
          ~(cells << (x % kWordCells));
    }
  });
}

// The unreached cells of a row of bricks. brick: x is 0, y counts in the grid, z in the layer.
void GlFlood::Grid::rows_of(const glm::ivec3& brick, std::span<const uint32_t> reached_cells,
                            BrickRow& rows) const {
  rows.fill(0);
  const size_t first_word = static_cast<size_t>(brick.x) * limits::kBrickSide / kWordCells;
  const size_t words =
      std::min(words_x - first_word, size_t{limits::kTileSide} / size_t{kWordCells});
  for (int row = 0; row < limits::kBrickSide * limits::kBrickSide; ++row) {
    const int y = brick.y * limits::kBrickSide + row % limits::kBrickSide;
    const int z = brick.z * limits::kBrickSide + row / limits::kBrickSide;
    const size_t from = word_of(y, z) + first_word;
    if (y >= dims.y || from + words > reached_cells.size()) continue;
    for (size_t w = 0; w < words; ++w) {
      rows[static_cast<size_t>(row) * kBlockRowWords + w / 2] |= uint64_t{~reached_cells[from + w]}
                                                                 << (w % 2 * kWordCells);
    }
  }
}

int64_t GlFlood::bytes(const glm::ivec3& dims) const {
  const Grid grid(dims);
  const auto bytes = static_cast<int64_t>(grid.bytes());
  if (bytes > std::min(kFloodBytesMax, context_->info().ssbo_bytes_max)) return 0;
  return 2 * bytes + 4 + static_cast<int64_t>(sizeof(shared::FloodParams));
}

Result<bool> GlFlood::run(std::span<const SparseTile> touched, const glm::ivec3& dims,
                          const ColumnProgress& progress, int64_t other_bytes,
                          std::vector<SparseTile>& tiles, VoxelizeStats& stats) {
  if (bytes(dims) == 0) return false;
  Stopwatch watch;
  Grid grid(dims);
  VOXELD_TRY(upload(grid, touched));
  stats.device_bytes_peak = std::max(stats.device_bytes_peak, other_bytes + bytes(dims));
  add_stage(stats.passes, "inside_upload", watch.lap());
  gpu::PassTimer timer(*context_);
  Result<bool> ended = [&] {
    const gpu::PassTimer::Pass pass = timer.measure("inside_flood");
    return spread(grid, progress);
  }();
  if (!ended) return ended;
  for (const auto& [pass, ms] : timer.results()) add_stage(stats.passes, pass, ms);
  if (!*ended) return false;
  watch.lap();
  take_tiles(grid, tiles);
  add_stage(stats.passes, "inside_read", watch.lap());
  return true;
}

Status GlFlood::upload(Grid& grid, std::span<const SparseTile> touched) {
  VOXELD_ASSIGN(grid.free, gpu::Buffer::create(*context_, grid.bytes(), "free cells"));
  VOXELD_ASSIGN(grid.reached, gpu::Buffer::create(*context_, grid.bytes(), "reached cells"));
  VOXELD_ASSIGN(grid.changed, gpu::Buffer::create(*context_, 4, "change of a flood"));
  VOXELD_ASSIGN(grid.params, gpu::Buffer::create(*context_, sizeof(shared::FloodParams),
                                                 "parameters of a flood"));
  for (int z = 0; z < grid.tile_dims().z; ++z) {
    std::vector<uint32_t> free_cells(grid.word_of(0, grid.layer_planes(z)), ~0u);
    for (const SparseTile& tile : touched) {
      if (tile.coord[2] == z) grid.cover(tile, free_cells);
    }
    grid.free.upload(grid.word_of(0, z * limits::kTileSide) * 4,
                     std::span<const uint32_t>(free_cells));
  }
  return context_->check("uploading free cells");
}

Status GlFlood::step(Grid& grid, const gpu::Program& program, int axis) {
  shared::FloodParams params{};
  params.cells = {grid.dims.x, grid.dims.y, grid.dims.z, 0};
  params.axis = axis;
  params.words_x = static_cast<int>(grid.words_x);
  const auto y = static_cast<size_t>(grid.dims.y), z = static_cast<size_t>(grid.dims.z);
  const size_t lines = axis == 0 ? y * z : axis == 1 ? grid.words_x * z : grid.words_x * y;
  params.lines = static_cast<uint32_t>(lines);
  grid.params.upload(0, std::span<const shared::FloodParams>(&params, 1));
  grid.params.bind_uniform(SOLID_PARAMS);
  grid.free.bind_storage(SOLID_FREE);
  grid.reached.bind_storage(SOLID_REACHED);
  grid.changed.bind_storage(SOLID_CHANGED);
  program.use();
  program.dispatch((static_cast<int64_t>(lines) + SOLID_GROUP_SIZE - 1) / SOLID_GROUP_SIZE);
  context_->gl().MemoryBarrier(GL_SHADER_STORAGE_BARRIER_BIT | GL_BUFFER_UPDATE_BARRIER_BIT);
  return context_->check("flooding");
}

Result<bool> GlFlood::spread(Grid& grid, const ColumnProgress& progress) {
  VOXELD_ASSIGN(const gpu::Program* program, shaders_->get({{"solid_flood.comp"}}));
  for (int round = 0; round < kFloodRoundsMax; ++round) {
    grid.changed.clear(0, 4);
    for (int axis = 0; axis < 3; ++axis) VOXELD_TRY(step(grid, *program, axis));
    std::array<uint32_t, 1> changed{};
    grid.changed.read(0, std::span<uint32_t>(changed));
    if (changed[0] == 0) return true;
    if (progress) VOXELD_TRY(progress(0));
  }
  return false;
}

void GlFlood::take_tiles(const Grid& grid, std::vector<SparseTile>& tiles) {
  TileBits bits;
  BrickRow rows;
  const glm::ivec3 count = grid.tile_dims();
  for (int tile_z = 0; tile_z < count.z; ++tile_z) {
    const int planes = grid.layer_planes(tile_z);
    std::vector<uint32_t> reached(grid.word_of(0, planes));
    grid.reached.read(grid.word_of(0, tile_z * limits::kTileSide) * 4,
                      std::span<uint32_t>(reached));
    for (int column = 0; column < count.x * count.y; ++column) {
      const int x = column % count.x, y = column / count.x;
      for (int row = 0; row < kTileBricks * kTileBricks; ++row) {
        const int brick_y = row % kTileBricks, brick_z = row / kTileBricks;
        const glm::ivec3 brick(x * kTileBricks, y * kTileBricks + brick_y, brick_z);
        if (brick_z * limits::kBrickSide >= planes) break;
        if (brick.y * limits::kBrickSide >= grid.dims.y) continue;
        cancel_point();
        grid.rows_of(brick, reached, rows);
        bits.add_row(0, brick_y, brick_z, rows);
      }
      SparseTile tile;
      tile.coord = {x, y, tile_z};
      bits.move_to(tile);
      if (!tile.empty()) tiles.push_back(std::move(tile));
    }
  }
}

}  // namespace voxeld
