// The decoder in C: rows of voxels, filled tile by tile on all cores.
#include "client/include/voxeld/decode.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>
#include <exception>
#include <memory>
#include <string_view>
#include <type_traits>
#include <vector>

#include "client/c_error.h"
#include "proto/codec/tile_runs.h"
#include "proto/container/distance_unit.h"
#include "proto/container/grid_format.h"
#include "proto/thread_pool.h"

struct voxeld_grid {
  voxeld::GridHeader header;
  std::vector<voxeld::SparseTile> tiles;  // in Morton order of coord
  std::vector<uint64_t> rows_before;      // of each tile
  uint64_t voxel_count = 0;
  double distance_unit = 1;
};

namespace voxeld {
namespace {

static_assert(VOXELD_COVERAGE + 1 == kChannelCount);

constexpr size_t kAxes = 3;
using Cell = std::array<int32_t, kAxes>;
static_assert(sizeof(Cell) == kAxes * sizeof(int32_t));

// The cells of a word of a mask: 4x4x4 voxels in Morton order.
constexpr std::array<Cell, 64> kWordCells = [] {
  std::array<Cell, 64> cells{};
  for (uint32_t i = 0; i < cells.size(); ++i) {
    const auto at = morton_decode(i);
    for (size_t c = 0; c < kAxes; ++c) cells[i][c] = static_cast<int32_t>(at[c]);
  }
  return cells;
}();

size_t count_of(const BrickMask& mask) {
  size_t count = 0;
  for (const uint64_t word : mask.words) count += static_cast<size_t>(std::popcount(word));
  return count;
}

void fill_coords(const SparseTile& tile, int32_t* out) {
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t) {
    const Cell brick = brick_cell(tile, morton);
    for (uint32_t w = 0; w < mask.words.size(); ++w) {
      const auto word = morton_decode(w);
      Cell base{};
      for (size_t c = 0; c < kAxes; ++c) base[c] = brick[c] + static_cast<int32_t>(4 * word[c]);
      for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
        const Cell& cell = kWordCells[static_cast<size_t>(std::countr_zero(bits))];
        const Cell row = {base[0] + cell[0], base[1] + cell[1], base[2] + cell[2]};
        std::memcpy(out, row.data(), sizeof row);
        out += kAxes;
      }
    }
  });
}

// Copies the samples of a tile; voxels without attributes get `inside`.
template <size_t components, typename Sample>
void fill_rows(const SparseTile& tile, const std::vector<Sample>& samples, Sample inside,
               Sample* out) {
  for_each_brick(tile, [&](uint32_t, const BrickMask& mask, size_t voxel) {
    const size_t count = components * count_of(mask);
    if (voxel == kNoAttributes) {
      std::fill_n(out, count, inside);
    } else {
      std::copy_n(samples.data() + components * voxel, count, out);
    }
    out += count;
  });
}

// The largest distance of the grid, in steps: the value of voxels far inside.
int farthest_steps(const voxeld_grid& grid) {
  int steps = 1;
  for (const SparseTile& tile : grid.tiles) {
    for (const int16_t distance : tile.distance) steps = std::max(steps, std::abs(distance));
  }
  return steps;
}

void fill_distances(const voxeld_grid& grid, size_t t, int inside_steps, float* out) {
  const SparseTile& tile = grid.tiles[t];
  for_each_brick(tile, [&](uint32_t, const BrickMask& mask, size_t voxel) {
    const size_t count = count_of(mask);
    for (size_t i = 0; i < count; ++i) {
      const int steps = voxel == kNoAttributes ? inside_steps : tile.distance[voxel + i];
      *out++ = static_cast<float>(steps * grid.distance_unit / kDistanceSteps);
    }
  });
}

void fill_channel(const voxeld_grid& grid, Channel channel, void* rows) {
  const int inside_steps = channel == Channel::kDistance ? -farthest_steps(grid) : 0;
  ThreadPool::shared().for_each(grid.tiles.size(), [&](size_t t) {
    with_channel_member(channel, [&](auto which, auto member) {
      constexpr const ChannelInfo& kInfo = channel_info(which);
      const size_t row = grid.rows_before[t];
      if constexpr (kInfo.kind == ChannelKind::kDistance) {
        fill_distances(grid, t, inside_steps, static_cast<float*>(rows) + row);
      } else {
        using Sample = SampleOf<decltype(member)>;
        const auto inside = static_cast<Sample>(kInfo.kind == ChannelKind::kFraction ? 255 : 0);
        fill_rows<kInfo.components>(grid.tiles[t], grid.tiles[t].*member, inside,
                                    static_cast<Sample*>(rows) + kInfo.components * row);
      }
    });
  });
}

void mark_occupied(const voxeld_grid& grid, uint8_t* cells) {
  const auto nx = static_cast<size_t>(grid.header.dims[0]);
  const auto ny = static_cast<size_t>(grid.header.dims[1]);
  ThreadPool::shared().for_each(grid.tiles.size(), [&](size_t t) {
    const auto at = [&](int x, int y, int z) {
      return cells + static_cast<size_t>(x) +
             nx * (static_cast<size_t>(y) + ny * static_cast<size_t>(z));
    };
    for_each_mask_voxel(grid.tiles[t], [&](int x, int y, int z, size_t) { *at(x, y, z) = 1; });
    for_each_full_run(grid.tiles[t], [&](int x, int y, int z, int length) {
      std::fill_n(at(x, y, z), length, uint8_t{1});
    });
  });
}

Result<std::unique_ptr<voxeld_grid>> decode(std::span<const uint8_t> bytes) {
  auto reader = GridReader::open(bytes);
  if (!reader) return reader.error();
  auto tiles = reader->decode_tiles();
  if (!tiles) return tiles.error();
  auto grid = std::make_unique<voxeld_grid>();
  grid->header = reader->header();
  grid->tiles = *std::move(tiles);
  grid->distance_unit = distance_unit(grid->header);
  for (const SparseTile& tile : grid->tiles) {
    grid->rows_before.push_back(grid->voxel_count);
    grid->voxel_count += tile.voxel_count();
  }
  return grid;
}

}  // namespace
}  // namespace voxeld

voxeld_grid* voxeld_grid_decode(const void* bytes, size_t size, char* error, size_t error_size) {
  try {
    auto grid = voxeld::decode({static_cast<const uint8_t*>(bytes), size});
    if (grid) return grid.value().release();
    voxeld::set_error(grid.error().message(), error, error_size);
  } catch (const std::exception& exception) {  // no memory; C knows no exceptions
    voxeld::set_error(exception.what(), error, error_size);
  }
  return nullptr;
}

void voxeld_grid_free(voxeld_grid* grid) {
  delete grid;
}

void voxeld_grid_get_info(const voxeld_grid* grid, voxeld_grid_info* info) {
  const voxeld::GridHeader& header = grid->header;
  std::ranges::copy(header.origin, info->origin);
  std::ranges::copy(header.voxel_size, info->voxel_size);
  std::ranges::copy(header.dims, info->dims);
  info->voxel_count = grid->voxel_count;
  info->meta_json = header.meta_json.c_str();
  info->channels = voxeld::channel_bits(header.channels);
}

void voxeld_grid_get_coords(const voxeld_grid* grid, int32_t* coords) {
  voxeld::ThreadPool::shared().for_each(grid->tiles.size(), [&](size_t t) {
    voxeld::fill_coords(grid->tiles[t], coords + voxeld::kAxes * grid->rows_before[t]);
  });
}

int voxeld_grid_get_channel(const voxeld_grid* grid, int channel, void* rows) {
  if (channel < 0 || channel >= static_cast<int>(voxeld::kChannelCount)) return 0;
  const auto which = static_cast<voxeld::Channel>(channel);
  if (!grid->header.channels.has(which)) return 0;
  voxeld::fill_channel(*grid, which, rows);
  return 1;
}

void voxeld_grid_mark_occupied(const voxeld_grid* grid, uint8_t* cells) {
  voxeld::mark_occupied(*grid, cells);
}
