#include "tests/gpu/render/ray_oracle.h"

#include <algorithm>
#include <cmath>
#include <glm/geometric.hpp>
#include <glm/matrix.hpp>
#include <glm/vector_relational.hpp>
#include <limits>

namespace voxeld {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

// [enter, leave] of the ray in the box; empty when enter > leave.
struct Interval {
  double enter = -kInfinity, leave = kInfinity;
  int enter_axis = -1;
};

Interval slab(const OracleRay& ray, const glm::dvec3& low, const glm::dvec3& high) {
  Interval result;
  for (int axis = 0; axis < 3; ++axis) {
    if (std::abs(ray.direction[axis]) < 1e-12 * glm::length(ray.direction)) {
      if (ray.origin[axis] < low[axis] || ray.origin[axis] >= high[axis]) result.enter = kInfinity;
      continue;
    }
    double first = (low[axis] - ray.origin[axis]) / ray.direction[axis];
    double last = (high[axis] - ray.origin[axis]) / ray.direction[axis];
    if (first > last) std::swap(first, last);
    if (first > result.enter) {
      result.enter = first;
      result.enter_axis = axis;
    }
    result.leave = std::min(result.leave, last);
  }
  return result;
}

// The key of the aligned cube of `side` cells around the cell; dims are below 2^20.
uint64_t cube_key(const glm::ivec3& cell, int side) {
  const auto part = [side](int v) { return static_cast<uint64_t>(v / side); };
  return part(cell.x) | part(cell.y) << 20 | part(cell.z) << 40;
}

size_t cell_in_brick(const glm::ivec3& cell) {
  return static_cast<size_t>(cell.x % 8 + 8 * (cell.y % 8) + 64 * (cell.z % 8));
}

}  // namespace

OracleRay oracle_ray(const RenderOptions& options, const glm::dmat4& clip_from_world,
                     const GridSpec& spec, int x, int y) {
  const glm::dmat4 world_from_clip = glm::inverse(clip_from_world);
  const double clip_x = (x + 0.5) / options.width * 2.0 - 1.0;
  const double clip_y = 1.0 - (y + 0.5) / options.height * 2.0;
  const auto grid_at = [&](double z) {
    const glm::dvec4 world = world_from_clip * glm::dvec4(clip_x, clip_y, z, 1.0);
    return spec.grid_from_world(glm::dvec3(world) / world.w);
  };
  OracleRay ray;
  ray.origin = grid_at(-1.0);
  ray.direction = grid_at(1.0) - ray.origin;
  if (options.section) {
    const auto& s = *options.section;
    // The plane is moved to the kept side by 1/256 of a voxel on each axis.
    const glm::dvec3 margin = spec.voxel_size / 256.0;
    const auto side = [&](double t) {
      const glm::dvec3 p = spec.world_from_grid(ray.origin + t * ray.direction);
      return s[0] * p.x + s[1] * p.y + s[2] * p.z + s[3] + std::abs(s[0]) * margin.x +
             std::abs(s[1]) * margin.y + std::abs(s[2]) * margin.z;
    };
    const double at_0 = side(0.0), at_1 = side(1.0);
    const double crossing = at_0 / (at_0 - at_1);
    if (at_0 > 0.0) ray.t_min = at_1 < 0.0 ? crossing : kInfinity;
    if (at_0 <= 0.0 && at_1 > 0.0) ray.t_max = crossing;
  }
  return ray;
}

OracleGrid::OracleGrid(const Grid& grid) : dims_(grid.spec.dims) {
  for (const SparseTile& tile : grid.tiles) add_tile(tile);
}

void OracleGrid::add_box(const glm::ivec3& low, const glm::ivec3& high) {
  low_ = glm::min(low_, low);
  high_ = glm::max(high_, high);
}

void OracleGrid::add_tile(const SparseTile& source) {
  const glm::ivec3 base = glm::ivec3(source.coord[0], source.coord[1], source.coord[2]) * 256;
  Tile& tile = tiles_[cube_key(base, 256)];
  const auto decoded = [](uint32_t morton) {
    const auto p = morton_decode(morton);
    return glm::ivec3(p[0], p[1], p[2]);
  };
  for (const FullNode& node : source.full) {
    const glm::ivec3 low = base + 8 * decoded(node.brick_morton);
    tile.full.push_back({low, low + (8 << node.level)});
    add_box(low, low + (8 << node.level));
  }
  for (size_t i = 0; i < source.masks.size(); ++i) {
    const glm::ivec3 brick = base + 8 * decoded(source.brick_morton[i]);
    auto& cells = tile.bricks[cube_key(brick, 8)];
    for (uint32_t bit = 0; bit < 512; ++bit) {
      if ((source.masks[i].words[bit / 64] >> (bit % 64) & 1) == 0) continue;
      const glm::ivec3 cell = brick + decoded(bit);
      cells.set(cell_in_brick(cell));
      add_box(cell, cell + 1);
    }
  }
}

const OracleGrid::Tile* OracleGrid::find_tile(const glm::ivec3& cell) const {
  const auto found = tiles_.find(cube_key(cell, 256));
  return found == tiles_.end() ? nullptr : &found->second;
}

bool OracleGrid::occupied(const Tile& tile, const glm::ivec3& cell) {
  for (const Box& box : tile.full) {
    if (glm::all(glm::greaterThanEqual(cell, box.low)) && glm::all(glm::lessThan(cell, box.high))) {
      return true;
    }
  }
  const auto found = tile.bricks.find(cube_key(cell, 8));
  return found != tile.bricks.end() && found->second.test(cell_in_brick(cell));
}

Hit OracleGrid::march(const OracleRay& ray) const {
  const Interval box = slab(ray, glm::dvec3(0.0), glm::dvec3(dims_));
  const double start = std::max(ray.t_min, box.enter);
  if (!(start <= box.leave) || start > ray.t_max) return {};
  const glm::dvec3 size = glm::abs(ray.direction);
  int axis = size.x >= size.y && size.x >= size.z ? 0 : (size.y >= size.z ? 1 : 2);
  glm::ivec3 cell(glm::floor(ray.origin + start * ray.direction));
  cell = glm::clamp(cell, glm::ivec3(0), dims_ - 1);
  if (box.enter >= ray.t_min) axis = box.enter_axis;
  const Tile* tile = find_tile(cell);
  const double parallel = 1e-12 * glm::length(ray.direction);
  while (tile == nullptr || !occupied(*tile, cell)) {
    double next = kInfinity;
    for (int i = 0; i < 3; ++i) {
      if (size[i] < parallel) continue;
      const double plane = cell[i] + (ray.direction[i] > 0 ? 1 : 0);
      const double t = (plane - ray.origin[i]) / ray.direction[i];
      if (t < next) {
        next = t;
        axis = i;
      }
    }
    if (next > ray.t_max) return {};
    cell[axis] += ray.direction[axis] > 0 ? 1 : -1;
    if (cell[axis] < 0 || cell[axis] >= dims_[axis]) return {};
    const bool enters_tile = cell[axis] % 256 == (ray.direction[axis] > 0 ? 0 : 255);
    if (enters_tile) tile = find_tile(cell);
  }
  return {cell, 2 * axis + (ray.direction[axis] > 0 ? 0 : 1)};
}

double chord(const OracleRay& ray, const glm::ivec3& cell, double margin) {
  const Interval inside = slab(ray, glm::dvec3(cell) - margin, glm::dvec3(cell) + 1.0 + margin);
  const double enter = std::max(inside.enter, ray.t_min);
  const double leave = std::min(inside.leave, ray.t_max);
  return (leave - enter) * glm::length(ray.direction);
}

}  // namespace voxeld
