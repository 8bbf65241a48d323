#include "proto/codec/octree_small.h"

#include <algorithm>
#include <array>
#include <string>

#include "proto/codec/bit_volume.h"
#include "proto/codec/canonical_tile.h"
#include "proto/codec/occupancy_levels.h"
#include "proto/codec/occupancy_model.h"
#include "proto/codec/range_coder.h"

namespace voxeld {
namespace {

constexpr int kTileSideBricks = limits::kTileSide / limits::kBrickSide;
constexpr int kOctantBricks = kTileSideBricks / 2;
constexpr size_t kHeadLevels = 5;
constexpr size_t kCellLevels = 3;
constexpr size_t kOctants = 8;
constexpr uint8_t kOneStream = 0, kOctantStreams = 1, kFullTile = 2;  // layouts
constexpr size_t kSplitHeaderBytes = 1 + 4 + 4 * kOctants;
static_assert(kTileSideBricks == 1 << kHeadLevels);
static_assert(limits::kBrickSide == 1 << kCellLevels);

Error broken_small_octree(std::string detail) {
  return {ErrorCode::kBadRequest, "grid container, small octree: " + std::move(detail), "", ""};
}

// A cube of bricks of the tile.
struct Region {
  std::array<int, 3> origin{};  // in bricks
  int side = kTileSideBricks;   // in bricks
  uint32_t morton_begin = 0, morton_end = kTileSideBricks * kTileSideBricks * kTileSideBricks;
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

// Occupied and full bricks of a region.
struct Bricks {
  BitVolume occupied, full;
};

Bricks cut_out(const Bricks& whole, const Region& region) {
  return {cut_out(whole.occupied, region), cut_out(whole.full, region)};
}

// Whether some brick has cells that must be coded.
bool has_open_bricks(const Bricks& bricks) {
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

using HeadLevels = std::array<BitVolume, kHeadLevels>;  // nodes of 128, 64, ... 8 cells
HeadLevels empty_head_levels() {
  return {BitVolume(2), BitVolume(4), BitVolume(8), BitVolume(16), BitVolume(32)};
}

struct Head {
  HeadLevels occupied = empty_head_levels();
  HeadLevels full = empty_head_levels();  // includes everything inside a larger full node
  bool has_full = false;

  Bricks bricks() const { return {occupied.back(), full.back()}; }
};

// Codes the head. Returns false if the bytes ran out.
template <typename Coder>
bool code_head(Coder& coder, OccupancyModel& model, Head& head) {
  head.has_full = coder.code(head.has_full, 1u << (kProbabilityBits - 1));
  BitVolume root(1);
  root.set(0, 0, 0);
  const BitVolume* parents = &root;
  const BitVolume* parents_full = nullptr;
  for (size_t i = 0; i < kHeadLevels; ++i) {
    if (parents_full != nullptr) {
      fill_full(*parents_full, 2, head.occupied[i]);
      fill_full(*parents_full, 2, head.full[i]);
    }
    if (!code_level(coder, model, *parents, head.occupied[i], parents_full, 3)) return false;
    parents = &head.occupied[i];
    if (!head.has_full) continue;
    if (!code_full_nodes(coder, head.occupied[i], parents_full, head.full[i])) return false;
    parents_full = &head.full[i];
  }
  return true;
}

using CellLevels = std::array<BitVolume, kCellLevels>;  // nodes of 4 and 2 cells, and cells
CellLevels empty_cells(const Region& region) {
  return {BitVolume(2 * region.side), BitVolume(4 * region.side), BitVolume(8 * region.side)};
}

// Codes the cells of a region. Returns false if the bytes ran out.
template <typename Coder>
bool code_cells(Coder& coder, OccupancyModel& model, const Bricks& bricks, bool has_full,
                CellLevels& levels) {
  const BitVolume* parents = &bricks.occupied;
  const BitVolume* full = has_full ? &bricks.full : nullptr;
  for (size_t i = 0; i < kCellLevels; ++i) {
    if (has_full) fill_full(bricks.full, 2 << i, levels[i]);
    const auto level_class = static_cast<uint32_t>(kCellLevels - 1 - i);
    if (!code_level(coder, model, *parents, levels[i], full, level_class)) return false;
    parents = &levels[i];
  }
  return true;
}

Head head_of(const SparseTile& tile) {
  Head head;
  head.has_full = !tile.full.empty();
  for (const uint32_t morton : tile.brick_morton) {
    const auto [x, y, z] = brick_position(morton, {});
    head.occupied.back().set(x, y, z);
  }
  for (const FullNode& node : tile.full) {
    for (uint32_t i = 0; i < node.brick_count(); ++i) {
      const auto [x, y, z] = brick_position(node.brick_morton + i, {});
      head.occupied.back().set(x, y, z);
      head.full.back().set(x, y, z);
    }
    for (uint32_t level = 1; level <= node.level; ++level) {
      const size_t i = kHeadLevels - 1 - level;
      for (uint32_t n = 0; n < node.brick_count() >> 3 * level; ++n) {
        const auto [x, y, z] = brick_position((node.brick_morton >> 3 * level) + n, {});
        head.full[i].set(x, y, z);
      }
    }
  }
  for (size_t i = kHeadLevels - 1; i-- > 0;) head.occupied[i] = halved(head.occupied[i + 1]);
  return head;
}

CellLevels cells_of(const SparseTile& tile, const Region& region) {
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

// Appends the largest full nodes in Morton order.
void append_full(const Head& head, SparseTile& tile) {
  if (!head.has_full) return;
  for (uint32_t morton = 0; morton < kTileSideBricks * kTileSideBricks * kTileSideBricks;) {
    uint32_t level = kHeadLevels;  // of the largest full node that begins here
    for (size_t i = 0; i < kHeadLevels && level == kHeadLevels; ++i) {
      const auto bricks_log2 = static_cast<uint32_t>(3 * (kHeadLevels - 1 - i));
      if ((morton & ((1u << bricks_log2) - 1)) != 0) continue;
      const auto [x, y, z] = brick_position(morton >> bricks_log2, {});
      if (head.full[i].get(x, y, z)) level = static_cast<uint32_t>(kHeadLevels - 1 - i);
    }
    if (level == kHeadLevels) {
      ++morton;
      continue;
    }
    tile.full.push_back({morton, level});
    morton += tile.full.back().brick_count();
  }
}

void append_bricks(const Bricks& bricks, const BitVolume& cells, const Region& region,
                   SparseTile& tile) {
  for (uint32_t morton = region.morton_begin; morton < region.morton_end; ++morton) {
    const auto at = brick_position(morton, region);
    if (!bricks.occupied.get(at[0], at[1], at[2]) || bricks.full.get(at[0], at[1], at[2])) continue;
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
  if (!complete || coder.exhausted()) return broken_small_octree("the " + name + " is cut off");
  if (!coder.at_end()) return broken_small_octree("bytes after the " + name);
  return {};
}

Status decode_octant(std::span<const uint8_t> bytes, OccupancyModel model, const Head& head,
                     uint32_t octant, SparseTile& tile) {
  const std::string name = "octant " + std::to_string(octant);
  const Region region = octant_region(octant);
  const Bricks bricks = cut_out(head.bricks(), region);
  if (!has_open_bricks(bricks)) {
    if (!bytes.empty()) return broken_small_octree("bytes after the " + name);
    return {};
  }
  auto cells = empty_cells(region);
  RangeDecoder coder(bytes);
  const bool complete = code_cells(coder, model, bricks, head.has_full, cells);
  VOXELD_TRY(stream_ended(coder, complete, name));
  append_bricks(bricks, cells.back(), region, tile);
  return {};
}

Status decode_split(std::span<const uint8_t> bytes, SparseTile& tile) {
  if (bytes.size() < kSplitHeaderBytes) return broken_small_octree("the lengths are cut off");
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
  Head head;
  const bool complete = code_head(coder, model, head);
  VOXELD_TRY(stream_ended(coder, complete, "head"));
  append_full(head, tile);
  bytes = bytes.subspan(sizes[0]);
  for (uint32_t octant = 0; octant < kOctants; ++octant) {
    VOXELD_TRY(decode_octant(bytes.first(sizes[1 + octant]), model, head, octant, tile));
    bytes = bytes.subspan(sizes[1 + octant]);
  }
  return {};
}

Status decode_whole(std::span<const uint8_t> bytes, SparseTile& tile) {
  RangeDecoder coder(bytes);
  OccupancyModel model;
  Head head;
  if (!code_head(coder, model, head)) return broken_small_octree("the stream is cut off");
  const Bricks bricks = head.bricks();
  auto cells = empty_cells({});
  const bool complete = code_cells(coder, model, bricks, head.has_full, cells);
  VOXELD_TRY(stream_ended(coder, complete, "stream"));
  append_full(head, tile);
  append_bricks(bricks, cells.back(), {}, tile);
  return {};
}

Status decode_full(std::span<const uint8_t> bytes, SparseTile& tile) {
  if (bytes.size() != 1) return broken_small_octree("bytes after a full tile");
  tile.full = {{0, kTileLevels}};
  return {};
}

void encode_octants(const SparseTile& tile, const Head& head, const OccupancyModel& model,
                    std::vector<uint8_t>& bytes) {
  for (uint32_t octant = 0; octant < kOctants; ++octant) {
    const size_t begin = bytes.size();
    const Region region = octant_region(octant);
    const Bricks part = cut_out(head.bricks(), region);
    if (has_open_bricks(part)) {
      OccupancyModel octant_model = model;
      RangeEncoder octant_coder(bytes);
      auto cells = cells_of(tile, region);
      code_cells(octant_coder, octant_model, part, head.has_full, cells);
      octant_coder.finish();
    }
    write_u32(bytes, 5 + 4 * octant, bytes.size() - begin);
  }
}

}  // namespace

std::vector<uint8_t> encode_octree_small(const SparseTile& tile) {
  if (tile.masks.empty() && tile.full == std::vector<FullNode>{{0, kTileLevels}}) {
    return {kFullTile};
  }
  const bool is_split = tile.attribute_count() > kSmallVoxelsWhole;
  std::vector<uint8_t> bytes(is_split ? kSplitHeaderBytes : 1);
  bytes[0] = is_split ? kOctantStreams : kOneStream;
  Head head = head_of(tile);
  OccupancyModel model;
  RangeEncoder coder(bytes);
  code_head(coder, model, head);
  if (is_split) {
    coder.finish();
    write_u32(bytes, 1, bytes.size() - kSplitHeaderBytes);
    encode_octants(tile, head, model, bytes);
    return bytes;
  }
  auto cells = cells_of(tile, {});
  code_cells(coder, model, head.bricks(), head.has_full, cells);
  coder.finish();
  return bytes;
}

Status decode_octree_small(std::span<const uint8_t> bytes, bool has_attributes, SparseTile& tile) {
  tile.brick_morton.clear();
  tile.masks.clear();
  tile.full.clear();
  if (bytes.empty()) return broken_small_octree("no bytes");
  if (bytes[0] > kFullTile) {
    return Error{ErrorCode::kBadRequest, "grid container, small octree: layout", "0, 1 or 2",
                 std::to_string(bytes[0])};
  }
  VOXELD_TRY(bytes[0] == kFullTile        ? decode_full(bytes, tile)
             : bytes[0] == kOctantStreams ? decode_split(bytes, tile)
                                          : decode_whole(bytes.subspan(1), tile));
  if (!is_canonical(tile, has_attributes)) return broken_small_octree("a full node is spelled out");
  return {};
}

}  // namespace voxeld
