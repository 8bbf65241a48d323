#include "server/voxel/solid/distance/distance_field.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <cmath>
#include <cstddef>
#include <utility>

#include <glm/common.hpp>
#include <glm/geometric.hpp>
#include <glm/vector_relational.hpp>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"

namespace voxeld {
namespace {

constexpr int kUnit = 512;  // a voxel in the tree's units

constexpr int kBlockSide = 64;    // cells; a block is one unit of a tile's work
constexpr uint32_t kBlocks = 64;  // blocks of a tile

glm::ivec3 centre_of(const glm::ivec3& first_cell, int side) {
  return first_cell * kUnit + side * (kUnit / 2);
}

// The distance in 1/128 of its unit, rounded to the nearest and clamped to 16 bits. Inside it is
// never 0, because 0 has no sign.
int16_t steps_of(double squared, bool is_inside) {
  const double steps = std::floor(std::sqrt(squared) * kDistanceSteps / kUnit + 0.5);
  const auto limited = static_cast<int>(std::min(steps, 32767.0));
  return static_cast<int16_t>(is_inside ? -std::max(limited, 1) : limited);
}

// Farther than anything: corners are within 2^31, and a scale is at most kDistanceAspectMax.
constexpr double kNoLimit = 1e13;

struct Bricks {
  std::vector<uint32_t> morton;
  std::vector<BrickMask> masks;
  std::vector<int16_t> distance;
};

// Distance from the middle of a cube to the centres of its outermost cells.
double radius_of(int side, const TriangleTree& tree) {
  return (side - 1) * (glm::length(tree.scale()) / 2) * kUnit;
}

// Measures distances of cells, node by node of 2x2x2. Not thread-safe.
class NodeDistances {
 public:
  NodeDistances(const DistanceJob& job, double limit)
      : job_(job), limit_(limit), radius_(radius_of(2, job.triangles)) {}

  // Appends the distances of the node's cells that are in `wanted` and within the limit; returns
  // their bits. inside: bits of the cells that are inside. near: a triangle that is likely near, or
  // kNone.
  uint8_t add(const glm::ivec3& first, uint8_t wanted, uint8_t inside, uint32_t near,
              std::vector<int16_t>& out) {
    const auto middle =
        job_.triangles.gather(centre_of(first, 2), radius_, limit_, near, candidates_);
    near_ = middle.triangle;
    uint8_t found = 0;
    if (near_ == TriangleTree::kNone) return found;
    for (uint32_t i = 0; i < 8; ++i) {
      if ((wanted >> i & 1) == 0) continue;
      const glm::ivec3 cell = first + glm::ivec3(i & 1, i >> 1 & 1, i >> 2);
      const auto nearest =
          job_.triangles.find_among(candidates_, centre_of(cell, 1), limit_, near_);
      if (nearest.triangle == TriangleTree::kNone) continue;
      near_ = nearest.triangle;
      found |= static_cast<uint8_t>(1u << i);
      out.push_back(steps_of(nearest.squared, (inside >> i & 1) != 0));
    }
    return found;
  }
  uint32_t near() const { return near_; }

 private:
  const DistanceJob& job_;
  double limit_, radius_;  // 1/512 of the unit
  TriangleTree::Candidates candidates_;
  uint32_t near_ = TriangleTree::kNone;
};

// The cells of a node, which are one byte of its brick.
uint8_t node_of(const BrickMask& mask, uint32_t node) {
  return static_cast<uint8_t>(mask.words[node / 8] >> (node % 8 * 8));
}

// Collects the band's cells in a cube, brick by brick in Morton order.
class BandWalk {
 public:
  BandWalk(const DistanceJob& job, double thickness, const glm::ivec3& tile_cell, Bricks& out)
      : job_(job),
        limit_(thickness * kUnit),
        nodes_(job, limit_),
        tile_cell_(tile_cell),
        out_(out) {}

  // first: a cell of the tile. near: a triangle that is likely near.
  void walk(const glm::ivec3& first, int side, uint32_t near) {
    cancel_point();
    if (glm::any(glm::greaterThanEqual(tile_cell_ + first, job_.dims))) return;
    if (side == 2) {
      add_node(first, near);
      return;
    }
    const auto nearest = job_.triangles.find(centre_of(tile_cell_ + first, side),
                                             limit_ + radius_of(side, job_.triangles) + 1.0, near);
    if (nearest.triangle == TriangleTree::kNone) return;
    if (side == limits::kBrickSide) begin_brick(first);
    for (uint32_t child = 0; child < 8; ++child) {
      const auto at = morton_decode(child);
      walk(first + glm::ivec3(at[0], at[1], at[2]) * (side / 2), side / 2, nearest.triangle);
    }
    if (side == limits::kBrickSide) end_brick(first);
  }

 private:
  void begin_brick(const glm::ivec3& first) {
    mask_ = {};
    const BrickMask* inside = job_.inside.find((tile_cell_ + first) / limits::kBrickSide);
    inside_ = inside != nullptr ? *inside : BrickMask{};
  }

  void end_brick(const glm::ivec3& first) {
    if (mask_ == BrickMask{}) return;
    const glm::uvec3 at(first / limits::kBrickSide);
    out_.morton.push_back(morton_encode(at.x, at.y, at.z));
    out_.masks.push_back(mask_);
  }

  void add_node(const glm::ivec3& first, uint32_t near) {
    const glm::uvec3 at = glm::uvec3(first & (limits::kBrickSide - 1)) / 2u;
    const uint32_t node = morton_encode(at.x, at.y, at.z);
    const glm::ivec3 cell = tile_cell_ + first;
    uint8_t wanted = 0;  // cells inside the grid
    for (uint32_t i = 0; i < 8; ++i) {
      const glm::ivec3 one = cell + glm::ivec3(i & 1, i >> 1 & 1, i >> 2);
      if (glm::all(glm::lessThan(one, job_.dims))) wanted |= static_cast<uint8_t>(1u << i);
    }
    const uint8_t found = nodes_.add(cell, wanted, node_of(inside_, node), near, out_.distance);
    mask_.words[node / 8] |= uint64_t{found} << (node % 8 * 8);
  }

  const DistanceJob& job_;
  double limit_;  // 1/512 voxel
  NodeDistances nodes_;
  glm::ivec3 tile_cell_;
  Bricks& out_;
  BrickMask mask_, inside_;
};

glm::ivec3 cell_of(const glm::ivec3& tile, uint32_t block) {
  const auto at = morton_decode(block);
  return tile * limits::kTileSide + glm::ivec3(at[0], at[1], at[2]) * kBlockSide;
}

// The coords of the tiles that the band reaches.
std::vector<glm::ivec3> reached_tiles(const DistanceJob& job, double thickness) {
  const glm::ivec3 tiles = (job.dims + limits::kTileSide - 1) / limits::kTileSide;
  const double reach = thickness * kUnit + radius_of(limits::kTileSide, job.triangles) + 1.0;
  std::vector<glm::ivec3> reached;
  uint32_t near = TriangleTree::kNone;
  for (int z = 0; z < tiles.z; ++z) {
    for (int y = 0; y < tiles.y; ++y) {
      for (int x = 0; x < tiles.x; ++x) {
        cancel_point();
        const glm::ivec3 tile(x, y, z);
        const auto nearest =
            job.triangles.find(centre_of(tile * limits::kTileSide, limits::kTileSide), reach, near);
        if (nearest.triangle == TriangleTree::kNone) continue;
        near = nearest.triangle;
        reached.push_back(tile);
      }
    }
  }
  return reached;
}

DistanceTile joined(const glm::ivec3& coord, std::span<Bricks> blocks) {
  DistanceTile out;
  out.tile.coord = {coord.x, coord.y, coord.z};
  for (uint32_t b = 0; b < blocks.size(); ++b) {
    for (const uint32_t morton : blocks[b].morton) out.tile.brick_morton.push_back(morton);
    const auto append = [](auto& to, const auto& from) {
      to.insert(to.end(), from.begin(), from.end());
    };
    append(out.tile.masks, blocks[b].masks);
    append(out.distance, blocks[b].distance);
    blocks[b] = {};
  }
  return out;
}

// Distances of the voxels of bricks [begin, end) of a tile.
std::vector<int16_t> distances_of_bricks(const DistanceJob& job, const SparseTile& tile,
                                         size_t begin, size_t end) {
  std::vector<int16_t> out;
  NodeDistances nodes(job, kNoLimit);
  const glm::ivec3 tile_cell =
      glm::ivec3(tile.coord[0], tile.coord[1], tile.coord[2]) * limits::kTileSide;
  for (size_t b = begin; b < end; ++b) {
    cancel_point();
    const auto at = morton_decode(tile.brick_morton[b]);
    const glm::ivec3 first = tile_cell + glm::ivec3(at[0], at[1], at[2]) * limits::kBrickSide;
    const BrickMask* inside = job.inside.find(first / limits::kBrickSide);
    for (uint32_t node = 0; node < 64; ++node) {
      const uint8_t wanted = node_of(tile.masks[b], node);
      if (wanted == 0) continue;
      const auto in_brick = morton_decode(node);
      nodes.add(first + glm::ivec3(in_brick[0], in_brick[1], in_brick[2]) * 2, wanted,
                inside != nullptr ? node_of(*inside, node) : uint8_t{0}, nodes.near(), out);
    }
  }
  return out;
}

glm::i64vec3 cubes_of(const glm::ivec3& dims, int bits) {
  return glm::i64vec3((dims - 1) >> bits) + int64_t{1};
}
int64_t count_of(const glm::i64vec3& cubes) {
  return cubes.x * cubes.y * cubes.z;
}

// Calls visit(number) for every cube from `first` to `last`.
template <typename Visit>
void for_each_cube(const glm::i64vec3& first, const glm::i64vec3& last, const glm::i64vec3& cubes,
                   const Visit& visit) {
  for (int64_t z = first.z; z <= last.z; ++z) {
    for (int64_t y = first.y; y <= last.y; ++y) {
      cancel_point();
      for (int64_t x = first.x; x <= last.x; ++x) {
        visit(static_cast<size_t>((z * cubes.y + y) * cubes.x + x));
      }
    }
  }
}

}  // namespace

Status find_band(const DistanceJob& job, double thickness, ThreadTeam& team,
                 const ColumnProgress& progress, std::vector<DistanceTile>& tiles) {
  std::vector<Bricks> blocks(kBlocks);
  for (const glm::ivec3& tile : reached_tiles(job, thickness)) {
    std::atomic<uint32_t> next = 0;
    team.run(team.threads(), [&](int) {
      for (uint32_t b = next++; b < kBlocks; b = next++) {
        cancel_point();
        const glm::ivec3 tile_cell = tile * limits::kTileSide;
        BandWalk(job, thickness, tile_cell, blocks[b])
            .walk(cell_of(tile, b) - tile_cell, kBlockSide, TriangleTree::kNone);
      }
    });
    tiles.push_back(joined(tile, blocks));
    if (tiles.back().tile.empty()) tiles.pop_back();
    if (progress) VOXELD_TRY(progress(0));
  }
  return {};
}

std::vector<int16_t> distances_of_tile(const DistanceJob& job, const SparseTile& tile,
                                       ThreadTeam& team) {
  constexpr size_t kBricks = 64;  // bricks per task
  std::vector<std::vector<int16_t>> parts((tile.masks.size() + kBricks - 1) / kBricks);
  std::atomic<size_t> next = 0;
  team.run(team.threads(), [&](int) {
    for (size_t part = next++; part < parts.size(); part = next++) {
      cancel_point();
      parts[part] = distances_of_bricks(job, tile, part * kBricks,
                                        std::min((part + 1) * kBricks, tile.masks.size()));
    }
  });
  std::vector<int16_t> distance;
  for (const auto& part : parts) distance.insert(distance.end(), part.begin(), part.end());
  return distance;
}

int64_t band_cells_max(const FillMesh& mesh, const glm::ivec3& dims, double thickness) {
  // Cubes of 8 cells a side, or as much larger as keeps them below 2^24 for the grid.
  int bits = 3;
  while (count_of(cubes_of(dims, bits)) > int64_t{1} << 24) ++bits;
  const glm::i64vec3 cubes = cubes_of(dims, bits);
  std::vector<bool> reached(static_cast<size_t>(count_of(cubes)));
  const auto reach = static_cast<int>(std::ceil(thickness)) + 1;
  const int shift = mesh.sub_voxel_bits();
  const int64_t all = count_of(cubes);
  int64_t count = 0;
  for (size_t t = 0; t < mesh.triangle_count() && count < all; ++t) {
    const auto v = mesh.corners(t);
    const glm::ivec3 low = (glm::min(v[0], glm::min(v[1], v[2])) >> shift) - reach;
    const glm::ivec3 high = (glm::max(v[0], glm::max(v[1], v[2])) >> shift) + reach;
    for_each_cube(glm::max(low, 0) >> bits, glm::min(high, dims - 1) >> bits, cubes,
                  [&](size_t at) {
                    count += reached[at] ? 0 : 1;
                    reached[at] = true;
                  });
  }
  const int64_t cells = int64_t{dims.x} * dims.y * dims.z;
  return std::min(cells, count << (3 * bits));
}

}  // namespace voxeld
