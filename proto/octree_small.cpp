#include "proto/octree_small.h"

#include <algorithm>
#include <array>
#include <string>

#include "proto/bit_volume.h"
#include "proto/occupancy_levels.h"
#include "proto/occupancy_model.h"
#include "proto/range_coder.h"

namespace voxeld {
namespace {

constexpr int kTileBricks = limits::kTileSide / limits::kBrickSide;  // to a side
constexpr int kOctantBricks = kTileBricks / 2;
constexpr size_t kHeadLevels = 5;
constexpr size_t kCellLevels = 3;
constexpr size_t kOctants = 8;
constexpr size_t kSplitHeaderBytes = 1 + 4 + 4 * kOctants;
static_assert(kTileBricks == 1 << kHeadLevels);
static_assert(limits::kBrickSide == 1 << kCellLevels);

Error broken(std::string detail) {
  return {ErrorCode::kBadRequest, "grid container, small octree: " + std::move(detail), "", ""};
}

// A cube of bricks of the tile.
struct Region {
  std::array<int, 3> origin{};  // in bricks
  int side = kTileBricks;       // in bricks
  uint32_t morton_begin = 0, morton_end = kTileBricks * kTileBricks * kTileBricks;
};

Region octant_region(uint32_t octant) {
  constexpr uint32_t kBricks = kOctantBricks * kOctantBricks * kOctantBricks;
  return {{static_cast<int>(octant & 1) * kOctantBricks,
           static_cast<int>(octant >> 1 & 1) * kOctantBricks,
           static_cast<int>(octant >> 2) * kOctantBricks},
          kOctantBricks,
          octant * kBricks,
          (octant + 1) * kBricks};
}

std::array<int, 3> brick_position(uint32_t morton, const Region& region) {
  const auto at = morton_decode(morton);
  return {static_cast<int>(at[0]) - region.origin[0], static_cast<int>(at[1]) - region.origin[1],
          static_cast<int>(at[2]) - region.origin[2]};
}

BitVolume cut_out(const BitVolume& whole, const Region& region) {
  BitVolume part(region.side);
  for (int z = 0; z < region.side; ++z) {
    for (int y = 0; y < region.side; ++y) {
      const uint8_t* from =
          whole.row(region.origin[1] + y, region.origin[2] + z) + region.origin[0] / 8;
      std::copy_n(from, part.row_bytes(), part.row(y, z));
    }
  }
  return part;
}

BrickVolumes cut_out(const BrickVolumes& whole, const Region& region) {
  BrickVolumes part(region.side);
  part.occupied = cut_out(whole.occupied, region);
  part.full = cut_out(whole.full, region);
  part.has_full = whole.has_full;
  return part;
}

// Whether some brick of the region has cells that must be told.
bool has_open_bricks(const BrickVolumes& bricks) {
  for (int z = 0; z < bricks.occupied.side(); ++z) {
    for (int y = 0; y < bricks.occupied.side(); ++y) {
      const uint8_t* occupied = bricks.occupied.row(y, z);
      const uint8_t* full = bricks.full.row(y, z);
      for (size_t i = 0; i < bricks.occupied.row_bytes(); ++i) {
        if ((occupied[i] & ~full[i]) != 0) return true;
      }
    }
  }
  return false;
}

// Nodes of 128 down to 8 cells and full bricks. False when the bytes ran out.
template <typename Coder>
bool code_head(Coder& coder, OccupancyModel& model, std::array<BitVolume, kHeadLevels>& levels,
               BrickVolumes& bricks) {
  BitVolume root(1);
  root.set(0, 0, 0);
  const BitVolume* parents = &root;
  for (BitVolume& level : levels) {
    if (!code_level(coder, model, *parents, level, nullptr, 3)) return false;
    parents = &level;
  }
  bricks.occupied = levels.back();
  return code_full_bricks(coder, bricks);
}

// Nodes of 4 and 2 cells and cells of a region. False when the bytes ran out.
template <typename Coder>
bool code_cells(Coder& coder, OccupancyModel& model, const BrickVolumes& bricks,
                std::array<BitVolume, kCellLevels>& levels) {
  const BitVolume* parents = &bricks.occupied;
  for (size_t i = 0; i < kCellLevels; ++i) {
    if (bricks.has_full) fill_full_bricks(bricks, 2 << i, levels[i]);
    const auto level_class = static_cast<uint32_t>(kCellLevels - 1 - i);
    if (!code_level(coder, model, *parents, levels[i], &bricks, level_class)) return false;
    parents = &levels[i];
  }
  return true;
}

std::array<BitVolume, kHeadLevels> empty_head() {
  return {BitVolume(2), BitVolume(4), BitVolume(8), BitVolume(16), BitVolume(32)};
}
std::array<BitVolume, kCellLevels> empty_cells(const Region& region) {
  return {BitVolume(2 * region.side), BitVolume(4 * region.side), BitVolume(8 * region.side)};
}

BrickVolumes bricks_of(const SparseTile& tile) {
  BrickMask full_mask;
  full_mask.words.fill(~uint64_t{0});
  BrickVolumes bricks(kTileBricks);
  for (size_t b = 0; b < tile.masks.size(); ++b) {
    if (tile.masks[b] == BrickMask{}) continue;
    const auto [x, y, z] = brick_position(tile.brick_morton[b], {});
    bricks.occupied.set(x, y, z);
    if (tile.masks[b] != full_mask) continue;
    bricks.full.set(x, y, z);
    bricks.has_full = true;
  }
  return bricks;
}

std::array<BitVolume, kCellLevels> cells_of(const SparseTile& tile, const Region& region) {
  auto levels = empty_cells(region);
  const auto begin = std::ranges::lower_bound(tile.brick_morton, region.morton_begin);
  const auto end = std::ranges::lower_bound(tile.brick_morton, region.morton_end);
  for (auto at = begin; at != end; ++at) {
    set_brick(levels[2], brick_position(*at, region),
              tile.masks[static_cast<size_t>(at - tile.brick_morton.begin())]);
  }
  levels[1] = halved(levels[2]);
  levels[0] = halved(levels[1]);
  return levels;
}

void append_bricks(const BrickVolumes& bricks, const BitVolume& cells, const Region& region,
                   SparseTile& tile) {
  for (uint32_t morton = region.morton_begin; morton < region.morton_end; ++morton) {
    const auto at = brick_position(morton, region);
    if (!bricks.occupied.get(at[0], at[1], at[2])) continue;
    tile.brick_morton.push_back(morton);
    tile.masks.push_back(brick_at(cells, at));
  }
}

void write_u32(std::vector<uint8_t>& bytes, size_t at, size_t value) {
  for (size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<uint8_t>(value >> 8 * i);
}
size_t read_u32(std::span<const uint8_t> bytes, size_t at) {
  size_t value = 0;
  for (size_t i = 0; i < 4; ++i) value |= static_cast<size_t>(bytes[at + i]) << 8 * i;
  return value;
}

Status stream_ended(const RangeDecoder& coder, bool complete, const std::string& name) {
  if (!complete || coder.exhausted()) return broken("the " + name + " is cut off");
  if (!coder.at_end()) return broken("bytes after the " + name);
  return {};
}

Status decode_octant(std::span<const uint8_t> bytes, OccupancyModel model, const BrickVolumes& head,
                     uint32_t octant, SparseTile& tile) {
  const std::string name = "octant " + std::to_string(octant);
  const Region region = octant_region(octant);
  const BrickVolumes bricks = cut_out(head, region);
  auto cells = empty_cells(region);
  if (!has_open_bricks(bricks)) {
    if (!bytes.empty()) return broken("bytes after the " + name);
    if (bricks.has_full) fill_full_bricks(bricks, limits::kBrickSide, cells.back());
  } else {
    RangeDecoder coder(bytes);
    const bool complete = code_cells(coder, model, bricks, cells);
    VOXELD_TRY(stream_ended(coder, complete, name));
  }
  append_bricks(bricks, cells.back(), region, tile);
  return {};
}

Status decode_split(std::span<const uint8_t> bytes, SparseTile& tile) {
  if (bytes.size() < kSplitHeaderBytes) return broken("the lengths are cut off");
  std::array<size_t, 1 + kOctants> sizes{};
  size_t total = kSplitHeaderBytes;
  for (size_t i = 0; i < sizes.size(); ++i) total += sizes[i] = read_u32(bytes, 1 + 4 * i);
  if (total != bytes.size()) {
    return Error{ErrorCode::kBadRequest, "grid container, small octree: its streams",
                 std::to_string(total) + " bytes", std::to_string(bytes.size())};
  }
  bytes = bytes.subspan(kSplitHeaderBytes);
  RangeDecoder coder(bytes.first(sizes[0]));
  OccupancyModel model;
  BrickVolumes bricks(kTileBricks);
  auto levels = empty_head();
  const bool complete = code_head(coder, model, levels, bricks);
  VOXELD_TRY(stream_ended(coder, complete, "head"));
  bytes = bytes.subspan(sizes[0]);
  for (uint32_t octant = 0; octant < kOctants; ++octant) {
    VOXELD_TRY(decode_octant(bytes.first(sizes[1 + octant]), model, bricks, octant, tile));
    bytes = bytes.subspan(sizes[1 + octant]);
  }
  return {};
}

Status decode_whole(std::span<const uint8_t> bytes, SparseTile& tile) {
  RangeDecoder coder(bytes);
  OccupancyModel model;
  BrickVolumes bricks(kTileBricks);
  auto head = empty_head();
  auto cells = empty_cells({});
  const bool complete =
      code_head(coder, model, head, bricks) && code_cells(coder, model, bricks, cells);
  VOXELD_TRY(stream_ended(coder, complete, "stream"));
  append_bricks(bricks, cells.back(), {}, tile);
  return {};
}

}  // namespace

std::vector<uint8_t> encode_octree_small(const SparseTile& tile) {
  const bool is_split = tile.voxel_count() > kSmallVoxelsWhole;
  std::vector<uint8_t> bytes(is_split ? kSplitHeaderBytes : 1);
  bytes[0] = is_split ? 1 : 0;
  BrickVolumes bricks = bricks_of(tile);
  auto head = empty_head();
  head.back() = bricks.occupied;
  for (size_t i = kHeadLevels - 1; i-- > 0;) head[i] = halved(head[i + 1]);
  OccupancyModel model;
  RangeEncoder coder(bytes);
  code_head(coder, model, head, bricks);
  if (!is_split) {
    auto cells = cells_of(tile, {});
    code_cells(coder, model, bricks, cells);
    coder.finish();
    return bytes;
  }
  coder.finish();
  write_u32(bytes, 1, bytes.size() - kSplitHeaderBytes);
  for (uint32_t octant = 0; octant < kOctants; ++octant) {
    const size_t begin = bytes.size();
    const Region region = octant_region(octant);
    const BrickVolumes part = cut_out(bricks, region);
    if (has_open_bricks(part)) {
      OccupancyModel octant_model = model;
      RangeEncoder octant_coder(bytes);
      auto cells = cells_of(tile, region);
      code_cells(octant_coder, octant_model, part, cells);
      octant_coder.finish();
    }
    write_u32(bytes, 5 + 4 * octant, bytes.size() - begin);
  }
  return bytes;
}

Status decode_octree_small(std::span<const uint8_t> bytes, SparseTile& tile) {
  tile.brick_morton.clear();
  tile.masks.clear();
  if (bytes.empty()) return broken("no bytes");
  if (bytes[0] > 1) {
    return Error{ErrorCode::kBadRequest, "grid container, small octree: layout", "0 or 1",
                 std::to_string(bytes[0])};
  }
  return bytes[0] == 0 ? decode_whole(bytes.subspan(1), tile) : decode_split(bytes, tile);
}

}  // namespace voxeld
