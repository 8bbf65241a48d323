#include "server/voxel/solid/flood.h"

#include <algorithm>
#include <array>
#include <memory>

#include "server/voxel/solid/distance/brick_planes.h"
#include "server/voxel/solid/inside/tile_bits.h"

namespace voxeld {
namespace {

constexpr std::array<glm::ivec3, 6> kDirections = {glm::ivec3(-1, 0, 0), glm::ivec3(1, 0, 0),
                                                   glm::ivec3(0, -1, 0), glm::ivec3(0, 1, 0),
                                                   glm::ivec3(0, 0, -1), glm::ivec3(0, 0, 1)};
constexpr uint64_t kColumn0 = 0x0101010101010101ull;  // x = 0
constexpr size_t kVisitsPerProgress = size_t{1} << 16;

// The cells by which a step in `direction` (index of kDirections) leaves a brick. They are moved to
// the side by which it enters the neighbour.
BrickPlanes leave(const BrickPlanes& cells, size_t direction) {
  BrickPlanes entered{};
  for (size_t z = 0; z < 8; ++z) {
    switch (direction) {
      case 0:
        entered[z] = (cells[z] & kColumn0) << 7;
        break;
      case 1:
        entered[z] = (cells[z] >> 7) & kColumn0;
        break;
      case 2:
        entered[z] = cells[z] << 56;
        break;
      case 3:
        entered[z] = cells[z] >> 56;
        break;
      default:
        break;
    }
  }
  if (direction == 4) entered[7] = cells[0];
  if (direction == 5) entered[0] = cells[7];
  return entered;
}

bool none(const BrickPlanes& cells) {
  return std::ranges::all_of(cells, [](uint64_t word) { return word == 0; });
}

// Extends `reached` to all cells of `free` that face neighbours join to it.
void spread(const BrickPlanes& free, BrickPlanes& reached) {
  for (bool changed = true; changed;) {
    changed = false;
    for (size_t z = 0; z < 8; ++z) {
      uint64_t word = reached[z];
      if (z > 0) word |= reached[z - 1];
      if (z < 7) word |= reached[z + 1];
      word &= free[z];
      word |= (word & ~(kColumn0 << 7)) << 1 | (word & ~kColumn0) >> 1 | word << 8 | word >> 8;
      word = (word & free[z]) | reached[z];
      changed = changed || word != reached[z];
      reached[z] = word;
    }
  }
}

class Flood {
 public:
  Flood(std::span<const SparseTile> touched, const glm::ivec3& dims)
      : tile_dims_((dims + limits::kTileSide - 1) / limits::kTileSide),
        bricks_(tile_dims_ * kTileBricks) {
    tiles_.resize(tile_number(tile_dims_ - 1) + 1);
    for (const SparseTile& tile : touched) add_tile(tile);
  }

  Status run(const ColumnProgress& progress) {
    enter_from_outside();
    for (size_t visits = 1; !queue_.empty(); ++visits) {
      const Item item = queue_.back();
      queue_.pop_back();
      visit(item);
      if (visits % kVisitsPerProgress == 0 && progress) VOXELD_TRY(progress(0));
    }
    return {};
  }

  void finish(std::vector<SparseTile>& out) const {
    const glm::ivec3 size = tile_dims_;
    for (int z = 0; z < size.z; ++z) {
      for (int y = 0; y < size.y; ++y) {
        for (int x = 0; x < size.x; ++x) {
          SparseTile tile;
          tile.coord = {x, y, z};
          finish_tile(tiles_[tile_number({x, y, z})], tile);
          if (!tile.empty()) out.push_back(std::move(tile));
        }
      }
    }
  }

 private:
  // A brick with touched cells. Bits outside the grid are free and connect to the outside.
  struct Mixed {
    BrickPlanes free{}, reached{};
    bool queued = false;
  };
  // A tile of the flood. Without touched cells it is reached as a whole and has no parts.
  struct Tile {
    bool reached = false;
    // One per brick: kFree, kReached, or an index into mixed.
    std::unique_ptr<std::vector<int32_t>> places;
    std::vector<Mixed> mixed;
  };
  static constexpr int32_t kFree = -1, kReached = -2;
  // A unit of work: one tile without parts, or one brick.
  struct Item {
    glm::ivec3 tile;
    int32_t brick;  // Morton index in the tile; kFree: the whole tile
  };

  size_t tile_number(const glm::ivec3& tile) const {
    return static_cast<size_t>(tile.z * tile_dims_.y + tile.y) * static_cast<size_t>(tile_dims_.x) +
           static_cast<size_t>(tile.x);
  }

  void add_tile(const SparseTile& from) {
    if (from.empty()) return;
    Tile& tile = tiles_[tile_number({from.coord[0], from.coord[1], from.coord[2]})];
    tile.places = std::make_unique<std::vector<int32_t>>(kTileBrickCount, kFree);
    for_each_brick(from, [&](uint32_t morton, const BrickMask& mask, size_t) {
      (*tile.places)[morton] = static_cast<int32_t>(tile.mixed.size());
      Mixed mixed;
      mixed.free = planes_of_brick(mask);
      for (uint64_t& word : mixed.free) word = ~word;
      tile.mixed.push_back(mixed);
    });
  }

  // Starts the flood through every face of the grid's cube of tiles.
  void enter_from_outside() {
    const glm::ivec3 size = tile_dims_;
    for (size_t d = 0; d < kDirections.size(); ++d) {
      const auto axis = static_cast<int>(d / 2), u = (axis + 1) % 3, v = (axis + 2) % 3;
      glm::ivec3 tile;
      tile[axis] = d % 2 == 1 ? 0 : size[axis] - 1;
      for (tile[u] = 0; tile[u] < size[u]; ++tile[u]) {
        for (tile[v] = 0; tile[v] < size[v]; ++tile[v]) enter_tile(tile, d);
      }
    }
  }

  // Steps into the tile in `direction`, over its whole side.
  void enter_tile(const glm::ivec3& tile, size_t direction) {
    if (tiles_[tile_number(tile)].places == nullptr) {
      reach_tile(tile);
      return;
    }
    const auto axis = static_cast<int>(direction / 2), u = (axis + 1) % 3, v = (axis + 2) % 3;
    BrickPlanes all;
    all.fill(~uint64_t{0});
    const BrickPlanes entered = leave(all, direction);
    glm::ivec3 brick = tile * kTileBricks;
    if (direction % 2 == 0) brick[axis] += kTileBricks - 1;
    for (int i = 0; i < kTileBricks * kTileBricks; ++i) {
      glm::ivec3 at = brick;
      at[u] += i % kTileBricks;
      at[v] += i / kTileBricks;
      enter_brick(at, entered);
    }
  }

  void reach_tile(const glm::ivec3& coord) {
    Tile& tile = tiles_[tile_number(coord)];
    if (tile.reached) return;
    tile.reached = true;
    queue_.push_back({coord, kFree});
  }

  void enter_brick(const glm::ivec3& brick, const BrickPlanes& entered) {
    const glm::ivec3 coord = brick / kTileBricks, at = brick - coord * kTileBricks;
    Tile& tile = tiles_[tile_number(coord)];
    if (tile.places == nullptr) {
      reach_tile(coord);
      return;
    }
    const auto morton = static_cast<int32_t>(morton_encode(
        static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y), static_cast<uint32_t>(at.z)));
    int32_t& place = (*tile.places)[static_cast<size_t>(morton)];
    if (place == kReached) return;
    if (place == kFree) {
      place = kReached;
      queue_.push_back({coord, morton});
      return;
    }
    Mixed& mixed = tile.mixed[static_cast<size_t>(place)];
    uint64_t fresh = 0;
    for (size_t z = 0; z < 8; ++z) {
      const uint64_t added = entered[z] & mixed.free[z] & ~mixed.reached[z];
      mixed.reached[z] |= added;
      fresh |= added;
    }
    if (fresh == 0 || mixed.queued) return;
    mixed.queued = true;
    queue_.push_back({coord, morton});
  }

  void visit(const Item& item) {
    if (item.brick == kFree) {
      for (size_t d = 0; d < kDirections.size(); ++d) {
        const glm::ivec3 next = item.tile + kDirections[d];
        if (is_inside(next, tile_dims_)) enter_tile(next, d);
      }
      return;
    }
    Tile& tile = tiles_[tile_number(item.tile)];
    const int32_t place = (*tile.places)[static_cast<size_t>(item.brick)];
    BrickPlanes reached;
    reached.fill(~uint64_t{0});
    if (place != kReached) {
      Mixed& mixed = tile.mixed[static_cast<size_t>(place)];
      mixed.queued = false;
      spread(mixed.free, mixed.reached);
      reached = mixed.reached;
    }
    const auto at = morton_decode(static_cast<uint32_t>(item.brick));
    const glm::ivec3 brick = item.tile * kTileBricks + glm::ivec3(at[0], at[1], at[2]);
    for (size_t d = 0; d < kDirections.size(); ++d) {
      const glm::ivec3 next = brick + kDirections[d];
      if (!is_inside(next, bricks_)) continue;
      const BrickPlanes entered = leave(reached, d);
      if (!none(entered)) enter_brick(next, entered);
    }
  }

  static bool is_inside(const glm::ivec3& at, const glm::ivec3& size) {
    return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < size.x && at.y < size.y && at.z < size.z;
  }

  static void finish_tile(const Tile& tile, SparseTile& out) {
    if (tile.places == nullptr) {
      if (!tile.reached) out.full.push_back({0, kTileLevels});
      return;
    }
    for (uint32_t morton = 0; morton < kTileBrickCount; ++morton) {
      const int32_t place = (*tile.places)[morton];
      if (place == kReached) continue;
      if (place == kFree) {
        out.full.push_back({morton, 0});
        continue;
      }
      BrickPlanes planes = tile.mixed[static_cast<size_t>(place)].reached;
      for (uint64_t& word : planes) word = ~word;
      if (none(planes)) continue;
      out.brick_morton.push_back(morton);
      out.masks.push_back(brick_of_planes(planes));
    }
    canonicalize(out);
  }

  glm::ivec3 tile_dims_, bricks_;
  std::vector<Tile> tiles_;
  std::vector<Item> queue_;
};

}  // namespace

Status flood_inside(std::span<const SparseTile> touched, const glm::ivec3& dims,
                    const ColumnProgress& progress, std::vector<SparseTile>& tiles) {
  Flood flood(touched, dims);
  VOXELD_TRY(flood.run(progress));
  flood.finish(tiles);
  return {};
}

}  // namespace voxeld
