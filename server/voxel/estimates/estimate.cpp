#include "server/voxel/estimates/estimate.h"

#include <unistd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <numeric>

#include "proto/codec/sparse_tile.h"
#include "server/base/parallel.h"

namespace voxeld {
namespace {

constexpr size_t kSumGrain = 1 << 15;

constexpr int kBrickBits = limits::kSubVoxelBits + std::countr_zero(unsigned{limits::kBrickSide});

// The most cubes of 2^bits q a side that one triangle can touch.
int64_t touched_max(const glm::ivec3& extent_q, int bits) {
  const int64_t x = (extent_q.x >> bits) + 2, y = (extent_q.y >> bits) + 2,
                z = (extent_q.z >> bits) + 2;
  const int64_t least = std::min(x, std::min(y, z)), most = std::max(x, std::max(y, z));
  return most * (x + y + z - least - most) * std::min<int64_t>(least, 4);
}

constexpr int64_t kBytesPerBrick = sizeof(BrickMask) + sizeof(uint32_t);

int64_t brick_count(const GridSpec& spec) {
  const glm::ivec3 bricks = (spec.dims + limits::kBrickSide - 1) / limits::kBrickSide;
  return int64_t{bricks.x} * bricks.y * bricks.z;
}

int64_t attribute_bytes(const WantedChannels& channels) {
  return static_cast<int64_t>(attribute_bytes(channels.grid));
}

}  // namespace

Result<Placed> place_scene(const Scene& scene, const VoxelizeOptions& options) {
  Placed placed;
  placed.world_from_file = world_from_file(options.placement);
  const Box3d box = world_bounds(scene, placed.world_from_file);
  if (box.empty()) return Error{ErrorCode::kEmptyMesh, "the mesh has no triangles", "", ""};
  VOXELD_ASSIGN(placed.spec, place_grid(options.placement, box.min, box.max));
  return placed;
}

WantedChannels wanted_channels(const Scene& scene, const VoxelizeOptions& options) {
  WantedChannels wanted;
  const bool has_source = options.color == ColorMode::kAxis ||
                          options.color == ColorMode::kShaded || scene.has_colors();
  wanted.grid.color = options.color != ColorMode::kNone && has_source &&
                      (!options.channels || options.channels->color);
  wanted.grid.normal = options.names(Channel::kNormal);
  wanted.grid.material = options.names(Channel::kMaterial);
  wanted.grid.label = options.names(Channel::kLabel);
  wanted.grid.coverage = options.names(Channel::kCoverage);
  wanted.volume = wanted.grid.coverage && options.fill == Fill::kSolid;
  wanted.grid.distance = options.measures();
  wanted.shaded = wanted.grid.color && options.color == ColorMode::kShaded;
  wanted.nearest = wanted.grid.color && options.color == ColorMode::kNearest;
  wanted.has_alpha =
      wanted.grid.color && options.color != ColorMode::kAxis && has_transparency(scene);
  wanted.summed.color = wanted.grid.color && !wanted.nearest;
  wanted.summed.alpha = wanted.has_alpha && wanted.summed.color;
  wanted.summed.normal = wanted.grid.normal || wanted.shaded;
  return wanted;
}

int64_t mesh_bytes(const Scene& scene) {
  return static_cast<int64_t>(scene.vertex_count() * sizeof(glm::ivec3) +
                              scene.triangle_count() *
                                  (sizeof(SnappedTriangle) + 2 * sizeof(uint32_t)));
}

int64_t dense_result_bytes(const GridSpec& spec, const WantedChannels& channels) {
  return brick_count(spec) * kBytesPerBrick + spec.cell_count() * attribute_bytes(channels);
}

int64_t SurfaceSize::bytes(const WantedChannels& channels) const {
  return bricks * kBytesPerBrick + voxels * attribute_bytes(channels);
}

SurfaceSize surface_size(const SnappedMesh& mesh, const GridSpec& spec) {
  std::vector<std::array<int64_t, 2>> sums(chunk_count(mesh.triangles.size(), kSumGrain));
  parallel_chunks(mesh.triangles.size(), kSumGrain, [&](size_t chunk, size_t begin, size_t end) {
    std::array<int64_t, 2> sum{};
    for (size_t t = begin; t < end; ++t) {
      cancel_point();
      const auto& v = mesh.triangles[t].vertices;
      const glm::ivec3 &a = mesh.vertices[v[0]], &b = mesh.vertices[v[1]], &c = mesh.vertices[v[2]];
      const glm::ivec3 extent = glm::max(a, glm::max(b, c)) - glm::min(a, glm::min(b, c));
      sum[0] += touched_max(extent, limits::kSubVoxelBits);
      sum[1] += touched_max(extent, kBrickBits);
    }
    sums[chunk] = sum;
  });
  SurfaceSize size;
  for (const auto& sum : sums) {
    size.voxels += sum[0];
    size.bricks += sum[1];
  }
  size.voxels = std::min(size.voxels, spec.cell_count());
  size.bricks = std::min({size.bricks, size.voxels, brick_count(spec)});
  return size;
}

int64_t fill_bytes(const SnappedMesh& mesh, const GridSpec& spec, const VoxelizeOptions& options,
                   int64_t surface_bytes, int threads) {
  if (options.fill == Fill::kSurface && !options.names(Channel::kDistance)) return 0;
  // An upper bound of the crossings: the columns that the boxes of triangles reach, along one axis
  // or three.
  const bool votes = options.sign == Sign::kAuto || options.sign == Sign::kMajority;
  std::vector<int64_t> sums(chunk_count(mesh.triangles.size(), kSumGrain));
  parallel_chunks(mesh.triangles.size(), kSumGrain, [&](size_t chunk, size_t begin, size_t end) {
    for (size_t t = begin; t < end; ++t) {
      cancel_point();
      const auto& v = mesh.triangles[t].vertices;
      const glm::ivec3 &a = mesh.vertices[v[0]], &b = mesh.vertices[v[1]], &c = mesh.vertices[v[2]];
      const glm::ivec3 extent = glm::max(a, glm::max(b, c)) - glm::min(a, glm::min(b, c));
      const glm::i64vec3 cells = glm::i64vec3(extent >> limits::kSubVoxelBits) + int64_t{1};
      sums[chunk] += cells.x * cells.y;
      if (votes) sums[chunk] += cells.y * cells.z + cells.z * cells.x;
      // A device also bins the triangle to each slab of 32 cells after the first. That costs a
      // third of a crossing.
      sums[chunk] +=
          cells.z / 96 * (cells.x / limits::kTileSide + 1) * (cells.y / limits::kTileSide + 1);
    }
  });
  const int64_t crossings = std::accumulate(sums.begin(), sums.end(), int64_t{0});
  constexpr int64_t kCrossingBytes = 12;  // as found, sorted, and its change of state
  constexpr int64_t kVolumeBytes = int64_t{2} << 20, kTileBytes = int64_t{164} << 10;
  const glm::ivec3 tiles = spec.tile_dims();
  const int64_t per_thread = (votes ? 4 : 2) * kVolumeBytes + tiles.z * kTileBytes;
  int64_t bytes = 2 * surface_bytes + crossings * kCrossingBytes + threads * per_thread;
  // Floods and shells look up bricks: 4 or 8 bytes for each brick of a tile with surface. A flood
  // has four masks for each.
  if (options.sign == Sign::kFlood || options.fill == Fill::kShell) {
    const int64_t tile_count = int64_t{tiles.x} * tiles.y * tiles.z;
    bytes += tile_count * (int64_t{8} << 15) + 8 * surface_bytes;
  }
  // A layer of tiles of the grid's bits, which is transferred to a device and back.
  if (options.sign == Sign::kFlood) {
    bytes += std::min(spec.cell_count() / 4, int64_t{128} << 20);
  }
  return bytes;
}

Status check_host_bytes(const GridSpec& spec, int64_t bytes, int64_t bytes_max) {
  if (bytes <= bytes_max) return {};
  return Error{ErrorCode::kGridTooLarge,
               "a grid of " + std::to_string(spec.dims.x) + " x " + std::to_string(spec.dims.y) +
                   " x " + std::to_string(spec.dims.z) +
                   " cells of this mesh needs too much memory",
               "at most " + std::to_string(bytes_max) + " bytes",
               "an estimate of " + std::to_string(bytes) + " bytes"};
}

int64_t default_host_bytes_max() {
  const long pages = ::sysconf(_SC_PHYS_PAGES), page_bytes = ::sysconf(_SC_PAGESIZE);
  if (pages <= 0 || page_bytes <= 0) return int64_t{4} << 30;
  return int64_t{pages} * page_bytes / 4 * 3;
}

}  // namespace voxeld
