#include "server/voxel/cpu/touch_tile.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <cstddef>
#include <cstring>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/check.h"
#include "server/voxel/triangles/tile_window.h"

namespace voxeld {
namespace {

// Fewer triangles are done before another thread has woken up.
constexpr size_t kTouchGrain = 1024;
// Triangles between two cancellation points. One as long as the tile takes some 7 us.
constexpr size_t kBatchTriangles = 4096;
// With more threads, joining their tiles would take longer than filling them.
constexpr int kThreadsMax = 64;

static_assert(sizeof(glm::ivec3) == 12 && sizeof(SnappedTriangle) % 4 == 0);
static_assert(offsetof(SnappedTriangle, vertices) == 0);
static_assert(std::endian::native == std::endian::little, "tiles are words of 64 and of 32 bits");

int thread_count(int threads) {
  if (threads <= 0) threads = static_cast<int>(ThreadPool::shared().threads());
  return std::clamp(threads, 1, kThreadsMax);
}

void append(const SparseTile& from, SparseTile& to) {
  to.brick_morton.insert(to.brick_morton.end(), from.brick_morton.begin(), from.brick_morton.end());
  to.masks.insert(to.masks.end(), from.masks.begin(), from.masks.end());
}

void append(const CompactedBlock& from, SparseTile& to) {
  static_assert(sizeof(BrickMask) == sizeof from.masks[0]);
  to.brick_morton.insert(to.brick_morton.end(), from.brick_morton,
                         from.brick_morton + from.brick_count);
  const size_t first = to.masks.size();
  to.masks.resize(first + from.brick_count);
  if (from.brick_count > 0) {
    std::memcpy(&to.masks[first], from.masks, from.brick_count * sizeof(BrickMask));
  }
}

// Share number `part` of `parts` equal shares of the set bits, in order.
uint64_t share_of_bits(uint64_t bits, size_t part, size_t parts) {
  const auto count = static_cast<size_t>(std::popcount(bits));
  const size_t first = count * part / parts, last = count * (part + 1) / parts;
  uint64_t share = 0;
  for (size_t i = 0; i < last; ++i, bits &= bits - 1) {
    if (i >= first) share |= bits & (~bits + 1);
  }
  return share;
}

}  // namespace

TouchInput touch_input(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin) {
  TouchInput input;
  if (mesh.triangles.empty() || bin.triangles.empty()) return input;
  input.vertices = &mesh.vertices.front().x;
  input.triangles = mesh.triangles.front().vertices.data();
  input.triangle_stride = sizeof(SnappedTriangle) / 4;
  input.list = bin.triangles.data();
  input.list_count = bin.triangles.size();
  const glm::ivec3 cell_last = tile_cell_max(spec, bin.coord);
  for (int axis = 0; axis < 3; ++axis) {
    input.tile_q[axis] = bin.coord[axis] * limits::kTileSide * kSubVoxelsPerVoxel;
    input.cell_last[axis] = cell_last[axis];
  }
  return input;
}

CpuTouch::CpuTouch(int threads, CpuIsa isa)
    : kernel_(&touch_kernel(isa)),
      team_(thread_count(threads)),
      workers_(static_cast<size_t>(team_.threads())) {}

void CpuTouch::touch_part(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin,
                          size_t part, size_t parts) {
  Worker& worker = workers_[part];
  worker.reserve();
  TouchInput input = touch_input(mesh, spec, bin);
  const size_t first = input.list_count * part / parts;
  const size_t last = input.list_count * (part + 1) / parts;
  input.list += first;
  input.list_count = last - first;
  worker.blocks = occupy(input, worker);
}

void CpuTouch::begin() {
  if (!std::exchange(is_running_, true)) return;
  for (Worker& worker : workers_) worker.words = {};
}

uint64_t CpuTouch::occupy(const TouchInput& input, Worker& worker) const {
  uint64_t blocks = 0, morton_blocks = 0;
  TouchInput batch = input;
  for (size_t first = 0; first < input.list_count; first += kBatchTriangles) {
    cancel_point();
    batch.list = input.list + first;
    batch.list_count = std::min(kBatchTriangles, input.list_count - first);
    blocks |= occupy_by(batch, worker);
    morton_blocks |= worker.words.data()[kMortonBlocksAt];  // of this batch alone
  }
  if (blocks != 0) worker.words.data()[kMortonBlocksAt] = morton_blocks;
  return blocks;
}

uint64_t CpuTouch::occupy_by(const TouchInput& input, Worker& worker) const {
  switch (rule_) {
    case Rule::kTouch:
      return kernel_->touch(input, worker.words.data());
    case Rule::kThin:
      return kernel_->thin(input, worker.words.data());
    case Rule::kCenter:
      return kernel_->center(input, worker.words.data());
    case Rule::kNone:
      break;
  }
  return 0;
}

size_t CpuTouch::touch_shared(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin) {
  const size_t parts = std::clamp<size_t>(bin.triangles.size() / kTouchGrain, 1, workers_.size());
  team_.run(static_cast<int>(parts),
            [&](int part) { touch_part(mesh, spec, bin, static_cast<size_t>(part), parts); });
  return parts;
}

template <typename Visit>
void CpuTouch::for_each_block(size_t parts, uint64_t blocks, const Visit& visit) {
  for (; blocks != 0; blocks &= blocks - 1) {
    const auto block = static_cast<size_t>(std::countr_zero(blocks));
    std::array<uint64_t*, kThreadsMax> tiles{};
    size_t tile_count = 0;
    for (size_t part = 0; part < parts; ++part) {
      if ((workers_[part].blocks >> block & 1) != 0) {
        tiles[tile_count++] = workers_[part].words.data();
      }
    }
    visit(block, std::span<uint64_t* const>(tiles.data(), tile_count));
  }
}

void CpuTouch::compact_blocks(size_t parts, uint64_t blocks, Worker& worker, SparseTile& tile) {
  worker.voxels = 0;
  for_each_block(parts, blocks, [&](size_t block, std::span<uint64_t* const> tiles) {
    kernel_->compact(tiles.data(), tiles.size(), block, &worker.compacted);
    append(worker.compacted, tile);
    worker.voxels += worker.compacted.voxel_count;
  });
}

uint64_t CpuTouch::run(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin,
                       std::span<uint32_t> mask) {
  VOXELD_CHECK(mask.size() == kTileWords * 2, "a mask of another size");
  begin();
  const size_t parts = touch_shared(mesh, spec, bin);
  uint64_t blocks = 0;
  for (size_t part = 0; part < parts; ++part) blocks |= workers_[part].blocks;
  team_.run(static_cast<int>(parts), [&](int part) {
    const uint64_t share = share_of_bits(blocks, static_cast<size_t>(part), parts);
    for_each_block(parts, share, [&](size_t block, std::span<uint64_t* const> tiles) {
      kernel_->join(tiles.data(), tiles.size(), block, mask.data());
    });
  });
  is_running_ = false;
  return blocks;
}

uint64_t CpuTouch::run(const SnappedMesh& mesh, const GridSpec& spec, const TileBin& bin,
                       SparseTile& tile) {
  begin();
  const size_t parts = touch_shared(mesh, spec, bin);
  uint64_t blocks = 0, voxels = 0;
  for (size_t part = 0; part < parts; ++part) blocks |= workers_[part].blocks;
  if (parts == 1) {
    compact_blocks(parts, blocks, workers_[0], tile);
    is_running_ = false;
    return workers_[0].voxels;
  }
  team_.run(static_cast<int>(parts), [&](int part) {
    Worker& worker = workers_[static_cast<size_t>(part)];
    worker.part.brick_morton.clear();
    worker.part.masks.clear();
    compact_blocks(parts, share_of_bits(blocks, static_cast<size_t>(part), parts), worker,
                   worker.part);
  });
  for (size_t part = 0; part < parts; ++part) {
    append(workers_[part].part, tile);
    voxels += workers_[part].voxels;
  }
  is_running_ = false;
  return voxels;
}

uint64_t CpuTouch::run(const SnappedMesh& mesh, const GridSpec& spec, std::span<const TileBin> bins,
                       std::span<SparseTile> tiles) {
  VOXELD_CHECK(bins.size() == tiles.size(), "a tile for each bin");
  uint64_t voxels = 0;
  if (bins.size() < 2 * workers_.size()) {
    for (size_t i = 0; i < bins.size(); ++i) voxels += run(mesh, spec, bins[i], tiles[i]);
    return voxels;
  }
  begin();
  std::atomic<size_t> next = 0;
  std::atomic<uint64_t> total = 0;
  team_.run(team_.threads(), [&](int part) {
    Worker& worker = workers_[static_cast<size_t>(part)];
    for (size_t i = next++; i < bins.size(); i = next++) {
      // The worker takes the whole tile with its own words, as the only part of a job of one.
      worker.reserve();
      const TouchInput input = touch_input(mesh, spec, bins[i]);
      uint64_t blocks = occupy(input, worker);
      uint64_t* words = worker.words.data();
      for (; blocks != 0; blocks &= blocks - 1) {
        kernel_->compact(&words, 1, static_cast<size_t>(std::countr_zero(blocks)),
                         &worker.compacted);
        append(worker.compacted, tiles[i]);
        total += worker.compacted.voxel_count;
      }
    }
  });
  is_running_ = false;
  return total;
}

}  // namespace voxeld
