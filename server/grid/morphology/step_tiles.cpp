#include "server/grid/morphology/step_tiles.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstdlib>
#include <glm/common.hpp>
#include <optional>
#include <utility>

#include "proto/limits.h"
#include "proto/options/morphology_limits.h"
#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/base/pieces.h"
#include "server/grid/morphology/bit_box.h"

namespace voxeld {
namespace {

// Cells beside a tile that its box of bits has in x: whole words, at least limits of steps.
constexpr int kHaloX = BitBox::kWordCells;
static_assert(limits::kMorphologyStepsMax <= kHaloX);
constexpr uint8_t kNoStep = 0xff;

// How far a neighbour lies: the number of axes along which it differs, at most.
int reach_of(Neighbors neighbors) {
  return neighbors == Neighbors::kFaces ? 1 : neighbors == Neighbors::kEdges ? 2 : 3;
}

// Combines the words of a row with `rows`, and with those shifted by a cell to either side if
// `is_wide`. Cells beyond the row are empty.
template <bool kGrow>
void combine(const uint64_t* in, int words, bool is_wide, uint64_t* out) {
  for (int w = 0; w < words; ++w) {
    uint64_t value = in[w];
    if (is_wide) {
      const uint64_t left = in[w] << 1 | (w > 0 ? in[w - 1] >> 63 : 0);
      const uint64_t right = in[w] >> 1 | (w + 1 < words ? in[w + 1] << 63 : 0);
      value = kGrow ? value | left | right : value & left & right;
    }
    out[w] = kGrow ? out[w] | value : out[w] & value;
  }
}

// One step of dilation (kGrow) or erosion. Cells beyond the box are empty.
template <bool kGrow>
void step(const BitBox& in, Neighbors neighbors, BitBox& out) {
  const CellBox& box = in.cells();
  const int reach = reach_of(neighbors), words = in.words();
  for (int z = box.min.z; z < box.max.z; ++z) {
    cancel_point();
    for (int y = box.min.y; y < box.max.y; ++y) {
      uint64_t* to = out.row(y, z);
      std::copy_n(in.row(y, z), words, to);
      for (int dz = -1; dz <= 1; ++dz) {
        for (int dy = -1; dy <= 1; ++dy) {
          const int left = reach - std::abs(dy) - std::abs(dz);
          if (left < 0) continue;
          if (in.has_row(y + dy, z + dz)) {
            combine<kGrow>(in.row(y + dy, z + dz), words, left > 0, to);
          } else if (!kGrow) {
            std::fill_n(to, words, uint64_t{0});
          }
        }
      }
    }
  }
}

// Removes the cells of each row outside [0, end).
void clip_rows(BitBox& bits, int end) {
  std::vector<uint64_t> inside(static_cast<size_t>(bits.words()));
  for (int x = std::max(0, bits.cells().min.x); x < std::min(end, bits.cells().max.x); ++x) {
    const auto at = static_cast<size_t>(x - bits.cells().min.x);
    inside[at / 64] |= uint64_t{1} << (at % 64);
  }
  auto& words = bits.bits();
  for (size_t i = 0; i < words.size(); ++i) words[i] &= inside[i % inside.size()];
}

std::vector<glm::ivec3> ordered_neighbors(Neighbors neighbors) {
  std::vector<glm::ivec3> offsets;
  for (int reach = 1; reach <= reach_of(neighbors); ++reach) {
    for (int z = -1; z <= 1; ++z) {
      for (int y = -1; y <= 1; ++y) {
        for (int x = -1; x <= 1; ++x) {
          if (std::abs(x) + std::abs(y) + std::abs(z) == reach) offsets.emplace_back(x, y, z);
        }
      }
    }
  }
  return offsets;
}

// The step at which each cell of a box became occupied.
class StepMap {
 public:
  explicit StepMap(const BitBox& bits)
      : bits_(bits), steps_(bits.bits().size() * BitBox::kWordCells, kNoStep) {
    note(bits.bits(), {}, 0);
  }

  // `before` may be empty.
  void note(const std::vector<uint64_t>& now, const std::vector<uint64_t>& before, uint8_t number) {
    for (size_t word = 0; word < now.size(); ++word) {
      cancel_point_at(word);
      uint64_t added = before.empty() ? now[word] : now[word] & ~before[word];
      for (; added != 0; added &= added - 1) {
        steps_[word * 64 + static_cast<size_t>(std::countr_zero(added))] = number;
      }
    }
  }

  // The voxel of step 0 whose values a cell has.
  glm::ivec3 origin_of(glm::ivec3 cell, const std::vector<glm::ivec3>& neighbors) const {
    for (uint8_t at = steps_[bits_.number_of(cell)]; at > 0; --at) {
      const auto is_before = [&](const glm::ivec3& offset) {
        const glm::ivec3 next = cell + offset;
        return bits_.has_row(next.y, next.z) && next.x >= bits_.cells().min.x &&
               next.x < bits_.cells().max.x && steps_[bits_.number_of(next)] == at - 1;
      };
      const auto found = std::find_if(neighbors.begin(), neighbors.end(), is_before);
      VOXELD_CHECK(found != neighbors.end(), "a voxel grew from one of the step before");
      cell += *found;
    }
    return cell;
  }

 private:
  const BitBox& bits_;
  std::vector<uint8_t> steps_;
};

uint32_t code_in_tile(const glm::ivec3& cell) {
  const glm::ivec3 at = cell % limits::kTileSide;
  return morton_encode(static_cast<uint32_t>(at.x), static_cast<uint32_t>(at.y),
                       static_cast<uint32_t>(at.z));
}

glm::ivec3 cell_of_code(const glm::ivec3& first, uint32_t code) {
  const auto at = morton_decode(code & 0x1ff);
  const auto brick = morton_decode(code >> 9);
  return first + limits::kBrickSide * glm::ivec3(brick[0], brick[1], brick[2]) +
         glm::ivec3(at[0], at[1], at[2]);
}

// The values of any cell that is occupied in some tiles.
class TileValues {
 public:
  explicit TileValues(const std::vector<SparseTile>& tiles) {
    lookups_.reserve(tiles.size());
    for (const SparseTile& tile : tiles) {
      cancel_point();
      lookups_.emplace_back(tile);
    }
  }
  VoxelValues at(const glm::ivec3& cell) const {
    const glm::ivec3 coord = cell / limits::kTileSide;
    for (const VoxelLookup& lookup : lookups_) {
      const TileCoord& own = lookup.tile().coord;
      if (own == TileCoord{coord.x, coord.y, coord.z}) return lookup.at(code_in_tile(cell));
    }
    return {};
  }

 private:
  std::vector<VoxelLookup> lookups_;
};

}  // namespace

StepTiles::StepTiles(const TileSource& source, StepKind kind, int steps, Neighbors neighbors)
    : cached_(source), kind_(kind), steps_(steps), neighbors_(neighbors) {
  VOXELD_CHECK(steps >= 1 && steps <= limits::kMorphologyStepsMax, "steps are in their range");
  VOXELD_CHECK(kind != StepKind::kDilate || !source.grid().channels.distance,
               "distances are not known where voxels are added");
  grid_ = source.grid();
  coords_ = source.coords();
  if (grid_.meta.is_band()) grid_.meta = grid_.meta.with_band_voxels(0);
  if (kind != StepKind::kDilate) return;
  const glm::ivec3 end = (grid_.spec.dims - 1) / limits::kTileSide;
  for (const TileCoord& coord : source.coords()) {
    for (int z = std::max(0, coord[2] - 1); z <= std::min(end.z, coord[2] + 1); ++z) {
      for (int y = std::max(0, coord[1] - 1); y <= std::min(end.y, coord[1] + 1); ++y) {
        for (int x = std::max(0, coord[0] - 1); x <= std::min(end.x, coord[0] + 1); ++x) {
          coords_.push_back({x, y, z});
        }
      }
    }
  }
  std::ranges::sort(coords_, {}, [](const TileCoord& coord) { return coord_order(coord); });
  coords_.erase(std::unique(coords_.begin(), coords_.end()), coords_.end());
}

Result<SparseTile> StepTiles::tile(size_t index) const {
  const TileCoord& coord = coords_[index];
  const glm::ivec3 first = first_cell_of(coord);
  CellBox near{glm::max(first - steps_, glm::ivec3(0)),
               glm::min(first + limits::kTileSide + steps_, grid_.spec.dims)};
  VOXELD_ASSIGN(const std::vector<SparseTile> tiles, cached_.tiles_in(near));
  SparseTile none;
  none.coord = coord;
  if (tiles.empty()) return none;
  near.min.x = first.x - kHaloX;
  near.max.x = first.x + limits::kTileSide + kHaloX;
  BitBox now(near);
  for (const SparseTile& tile : tiles) now.mark(tile);
  const BitBox whole = now;
  const bool grows = kind_ == StepKind::kDilate;
  std::optional<StepMap> map;
  if (grows && grid_.channels.any()) map.emplace(whole);
  BitBox next(near);
  for (int number = 1; number <= steps_; ++number) {
    if (grows) {
      step<true>(now, neighbors_, next);
      clip_rows(next, grid_.spec.dims.x);
      if (map) map->note(next.bits(), now.bits(), static_cast<uint8_t>(number));
    } else {
      step<false>(now, neighbors_, next);
    }
    std::swap(now, next);
  }
  if (kind_ == StepKind::kHollow) {
    for (size_t i = 0; i < now.bits().size(); ++i) now.bits()[i] = whole.bits()[i] & ~now.bits()[i];
  }
  const TileValues values(tiles);
  const std::vector<glm::ivec3> neighbors = ordered_neighbors(neighbors_);
  return tile_of_bits(coord, now, grid_.channels, [&](uint32_t code) {
    const glm::ivec3 cell = cell_of_code(first, code);
    const glm::ivec3 origin = map ? map->origin_of(cell, neighbors) : cell;
    VoxelValues own = values.at(origin);
    if (origin != cell) own.coverage = VoxelValues{}.coverage;
    return own;
  });
}

int64_t step_tile_bytes(int steps, const ChannelSet& channels) {
  const int64_t side = limits::kTileSide + int64_t{2} * steps;
  const int64_t cells = side * side * (limits::kTileSide + int64_t{2} * kHaloX);
  // Bits before, after and at the beginning, and the step of each cell.
  return 3 * cells / 8 + (channels.any() ? cells : 0);
}

}  // namespace voxeld
