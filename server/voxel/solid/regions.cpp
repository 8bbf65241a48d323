#include "server/voxel/solid/regions.h"

#include <algorithm>
#include <bit>

#include "server/base/cancel_point.h"

namespace voxeld {
namespace {

constexpr std::array<glm::ivec3, 6> kDirections = {glm::ivec3(-1, 0, 0), glm::ivec3(1, 0, 0),
                                                   glm::ivec3(0, -1, 0), glm::ivec3(0, 1, 0),
                                                   glm::ivec3(0, 0, -1), glm::ivec3(0, 0, 1)};
constexpr uint64_t kColumn0 = 0x0101010101010101ull;  // x = 0
constexpr size_t kVisitsPerProgress = size_t{1} << 16;

constexpr BrickPlanes all_cells() {
  BrickPlanes all{};
  all.fill(~uint64_t{0});
  return all;
}

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

bool is_in(const glm::ivec3& at, const glm::ivec3& size) {
  return at.x >= 0 && at.y >= 0 && at.z >= 0 && at.x < size.x && at.y < size.y && at.z < size.z;
}

}  // namespace

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

Regions::Regions(std::span<const SparseTile> touched, const glm::ivec3& dims)
    : tile_dims_((dims + limits::kTileSide - 1) / limits::kTileSide),
      bricks_(tile_dims_ * kTileBricks) {
  tiles_.resize(tile_number(tile_dims_ - 1) + 1);
  for (const SparseTile& tile : touched) {
    cancel_point();
    add_tile(tile);
  }
}

int64_t Regions::bytes_for(const glm::ivec3& dims, int64_t surface_bytes) {
  const glm::ivec3 tiles = (dims + limits::kTileSide - 1) / limits::kTileSide;
  constexpr int64_t kMaskBytes = sizeof(BrickMask) + sizeof(uint32_t);
  // Bricks count twice, because their list is copied as it grows.
  return int64_t{tiles.x} * tiles.y * tiles.z *
             static_cast<int64_t>(kTileBrickCount * sizeof(int32_t)) +
         2 * (surface_bytes / kMaskBytes + 1) * static_cast<int64_t>(sizeof(Mixed));
}

glm::ivec3 Regions::tile_at(size_t number) const {
  const auto x = static_cast<size_t>(tile_dims_.x), y = static_cast<size_t>(tile_dims_.y);
  return {static_cast<int>(number % x), static_cast<int>(number / x % y),
          static_cast<int>(number / x / y)};
}

void Regions::add_tile(const SparseTile& from) {
  if (from.empty()) return;
  Tile& tile = tiles_[tile_number({from.coord[0], from.coord[1], from.coord[2]})];
  tile.places = std::make_unique<std::vector<int32_t>>(kTileBrickCount, kFree);
  for_each_brick(from, [&](uint32_t morton, const BrickMask& mask, size_t) {
    (*tile.places)[morton] = static_cast<int32_t>(tile.mixed.size());
    Mixed& mixed = tile.mixed.emplace_back();
    mixed.free = planes_of_brick(mask);
    for (uint64_t& word : mixed.free) word = ~word;
  });
}

Status Regions::flood_outside(const ColumnProgress& progress) {
  turn_ = 0;
  visit_ = nullptr;
  enter_from_outside();
  return run(progress);
}

Status Regions::flood(const Piece& start, Turn turn, const Visit& visit,
                      const ColumnProgress& progress) {
  turn_ = static_cast<uint8_t>(turn);
  visit_ = &visit;
  if (start.brick == kWholeTile) {
    reach_tile(start.tile);
  } else {
    const auto at = morton_decode(static_cast<uint32_t>(start.brick));
    enter_brick(start.tile * kTileBricks + glm::ivec3(at[0], at[1], at[2]), start.cells);
  }
  Status done = run(progress);
  visit_ = nullptr;
  return done;
}

std::optional<Regions::Piece> Regions::next() {
  for (; next_tile_ < tiles_.size(); ++next_tile_, next_brick_ = 0) {
    cancel_point();
    const Tile& tile = tiles_[next_tile_];
    if (tile.places == nullptr) {
      if (tile.turns == 0) return Piece{tile_at(next_tile_), kWholeTile, all_cells()};
      continue;
    }
    for (; next_brick_ < kTileBrickCount; ++next_brick_) {
      const int32_t place = (*tile.places)[next_brick_];
      Piece piece{tile_at(next_tile_), static_cast<int32_t>(next_brick_), {}};
      if (place < kFree) continue;
      if (place == kFree) {
        piece.cells = all_cells();
        return piece;
      }
      const Mixed& mixed = tile.mixed[static_cast<size_t>(place)];
      for (size_t z = 0; z < 8; ++z) {
        const uint64_t left = mixed.free[z] & ~mixed.reached[0][z];
        if (left == 0) continue;
        piece.cells[z] = left & (~left + 1);
        return piece;
      }
    }
  }
  return std::nullopt;
}

BrickPlanes Regions::reached(size_t number, uint32_t brick) const {
  const Tile& tile = tiles_[number];
  if (tile.places == nullptr) return tile.turns > 0 ? all_cells() : BrickPlanes{};
  const int32_t place = (*tile.places)[brick];
  if (place < 0) return place < kFree ? all_cells() : BrickPlanes{};
  return tile.mixed[static_cast<size_t>(place)].reached[0];
}

BrickPlanes Regions::touched(size_t number, uint32_t brick) const {
  const Tile& tile = tiles_[number];
  if (tile.places == nullptr) return {};
  const int32_t place = (*tile.places)[brick];
  if (place < 0) return {};
  BrickPlanes cells = tile.mixed[static_cast<size_t>(place)].free;
  for (uint64_t& word : cells) word = ~word;
  return cells;
}

Status Regions::run(const ColumnProgress& progress) {
  for (size_t visits = 1; !queue_.empty(); ++visits) {
    cancel_point();
    const Item item = queue_.back();
    queue_.pop_back();
    visit(item);
    if (visits % kVisitsPerProgress == 0 && progress) VOXELD_TRY(progress(0));
  }
  return {};
}

// Starts the flood through every face of the grid's cube of tiles.
void Regions::enter_from_outside() {
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

void Regions::enter_tile(const glm::ivec3& tile, size_t direction) {
  if (!is_divided(tile_number(tile))) {
    reach_tile(tile);
    return;
  }
  const auto axis = static_cast<int>(direction / 2), u = (axis + 1) % 3, v = (axis + 2) % 3;
  const BrickPlanes entered = leave(all_cells(), direction);
  glm::ivec3 brick = tile * kTileBricks;
  if (direction % 2 == 0) brick[axis] += kTileBricks - 1;
  for (int i = 0; i < kTileBricks * kTileBricks; ++i) {
    glm::ivec3 at = brick;
    at[u] += i % kTileBricks;
    at[v] += i / kTileBricks;
    enter_brick(at, entered);
  }
}

void Regions::reach_tile(const glm::ivec3& coord) {
  Tile& tile = tiles_[tile_number(coord)];
  if (tile.turns > turn_) return;
  tile.turns = static_cast<uint8_t>(turn_ + 1);
  queue_.push_back({coord, kWholeTile});
}

void Regions::enter_brick(const glm::ivec3& brick, const BrickPlanes& entered) {
  const glm::ivec3 coord = brick / kTileBricks, at = brick - coord * kTileBricks;
  Tile& tile = tiles_[tile_number(coord)];
  if (tile.places == nullptr) {
    reach_tile(coord);
    return;
  }
  const auto morton = static_cast<int32_t>(morton_encode(
      static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y), static_cast<uint32_t>(at.z)));
  int32_t& place = (*tile.places)[static_cast<size_t>(morton)];
  if (place < 0) {
    if (place < kFree - turn_) return;
    place = kFree - turn_ - 1;
    queue_.push_back({coord, morton});
    return;
  }
  Mixed& mixed = tile.mixed[static_cast<size_t>(place)];
  uint64_t fresh = 0;
  for (size_t z = 0; z < 8; ++z) {
    const uint64_t added = entered[z] & mixed.free[z] & ~mixed.reached[turn_][z];
    mixed.entered[z] |= added;
    fresh |= added;
  }
  if (fresh == 0 || mixed.is_queued) return;
  mixed.is_queued = true;
  queue_.push_back({coord, morton});
}

void Regions::visit(const Item& item) {
  Piece piece{item.tile, item.brick, all_cells()};
  if (item.brick == kWholeTile) {
    if (visit_ != nullptr) (*visit_)(piece);
    for (size_t d = 0; d < kDirections.size(); ++d) {
      const glm::ivec3 next = item.tile + kDirections[d];
      if (is_in(next, tile_dims_)) enter_tile(next, d);
    }
    return;
  }
  Tile& tile = tiles_[tile_number(item.tile)];
  const int32_t place = (*tile.places)[static_cast<size_t>(item.brick)];
  if (place >= 0) {
    Mixed& mixed = tile.mixed[static_cast<size_t>(place)];
    mixed.is_queued = false;
    piece.cells = mixed.entered;
    mixed.entered = {};
    spread(mixed.free, piece.cells);
    for (size_t z = 0; z < 8; ++z) mixed.reached[turn_][z] |= piece.cells[z];
  }
  if (visit_ != nullptr) (*visit_)(piece);
  const auto at = morton_decode(static_cast<uint32_t>(item.brick));
  const glm::ivec3 brick = item.tile * kTileBricks + glm::ivec3(at[0], at[1], at[2]);
  for (size_t d = 0; d < kDirections.size(); ++d) {
    const glm::ivec3 next = brick + kDirections[d];
    if (!is_in(next, bricks_)) continue;
    const BrickPlanes entered = leave(piece.cells, d);
    if (!none(entered)) enter_brick(next, entered);
  }
}

}  // namespace voxeld
