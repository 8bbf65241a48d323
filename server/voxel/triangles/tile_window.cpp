#include "server/voxel/triangles/tile_window.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <utility>

#include "server/base/parallel.h"
#include "server/voxel/triangles/work_items.h"

namespace voxeld {
namespace {

constexpr size_t kWindowGrain = 1 << 13;

int largest_axis(const std::array<int64_t, 3>& v) {
  if (v[2] >= v[0] && v[2] >= v[1]) return 2;
  return v[0] >= v[1] ? 0 : 1;
}

bool comes_first(const glm::ivec3& a, const glm::ivec3& b) {
  if (a.x != b.x) return a.x < b.x;
  if (a.y != b.y) return a.y < b.y;
  return a.z < b.z;
}

// Finds the run of each image. An image's triangles are contiguous, because the mesh is grouped by
// image.
void find_image_runs(const SnappedMesh& mesh, std::span<const uint32_t> triangles,
                     std::span<const int> part_images, TileWindow& window) {
  window.image_runs.clear();
  const auto image_at = [&](size_t i) { return part_images[mesh.triangles[triangles[i]].part]; };
  for (size_t first = 0; first < triangles.size();) {
    const int image = image_at(first);
    // Images ascend, so bisection finds the run's end.
    size_t low = first, high = triangles.size();
    while (low + 1 < high) {
      const size_t middle = low + (high - low) / 2;
      (image_at(middle) == image ? low : high) = middle;
    }
    window.image_runs.push_back({image, first, high - first});
    first = high;
  }
}

// Counting sort of all chunks' items by key. Fills items and ranges.
void sort_items(const std::vector<ChunkItems>& chunks, TileWindow& window) {
  const size_t images = window.image_runs.size();
  const size_t keys = kTouchClassCount * images * kItemCostBuckets;
  std::vector<std::vector<size_t>> places(chunks.size(), std::vector<size_t>(keys));
  for (size_t c = 0; c < chunks.size(); ++c) {
    for (const PendingItem& item : chunks[c].items) ++places[c][item.key];
  }
  window.ranges.clear();
  size_t total = 0;
  for (size_t key = 0; key < keys; ++key) {
    if (key % kItemCostBuckets == 0) {
      const size_t group = key / kItemCostBuckets;
      window.ranges.push_back({static_cast<TouchClass>(group / images),
                               window.image_runs[group % images].image, total, 0});
    }
    for (auto& chunk : places) {
      const size_t count = std::exchange(chunk[key], total);
      total += count;
      window.ranges.back().count += count;
    }
  }
  std::erase_if(window.ranges, [](const ItemRange& range) { return range.count == 0; });
  window.items.resize(total);
  parallel_chunks(chunks.size(), 1, [&](size_t, size_t begin, size_t end) {
    for (size_t c = begin; c < end; ++c) {
      for (const PendingItem& item : chunks[c].items) {
        window.items[places[c][item.key]++] = item.words;
      }
    }
  });
}

}  // namespace

glm::ivec3 tile_cell_max(const GridSpec& spec, const glm::ivec3& tile_coord) {
  return glm::min(glm::ivec3(limits::kTileSide), spec.dims - tile_coord * limits::kTileSide) - 1;
}

CornerOrder corner_order(const std::array<glm::ivec3, 3>& q) {
  CornerOrder order;
  const auto swap_if_needed = [&](size_t i, size_t j) {
    if (!comes_first(q[order.corner[j]], q[order.corner[i]])) return;
    std::swap(order.corner[i], order.corner[j]);
    order.reversed = !order.reversed;
  };
  swap_if_needed(0, 1);
  swap_if_needed(1, 2);
  swap_if_needed(0, 1);
  return order;
}

int dominant_axis(const std::array<glm::ivec3, 3>& q) {
  const glm::ivec3 a = q[1] - q[0], b = q[2] - q[1];
  const std::array<int64_t, 3> normal = {std::abs(int64_t{a.y} * b.z - int64_t{a.z} * b.y),
                                         std::abs(int64_t{a.z} * b.x - int64_t{a.x} * b.z),
                                         std::abs(int64_t{a.x} * b.y - int64_t{a.y} * b.x)};
  if ((normal[0] | normal[1] | normal[2]) != 0) return largest_axis(normal);
  const glm::ivec3 extent =
      glm::max(q[0], glm::max(q[1], q[2])) - glm::min(q[0], glm::min(q[1], q[2]));
  return largest_axis({-extent.x, -extent.y, -extent.z});
}

bool fill_tile_window(const SnappedMesh& mesh, const GridSpec& spec, const glm::ivec3& tile_coord,
                      std::span<const uint32_t> triangles, std::span<const int> part_images,
                      const ItemSizes& sizes, TileWindow& window) {
  find_image_runs(mesh, triangles, part_images, window);
  window.vertices.resize(9 * triangles.size());
  window.axes.resize(triangles.size());
  std::vector<ChunkItems> chunks(chunk_count(triangles.size(), kWindowGrain));
  const glm::ivec3 tile_q = tile_coord * (limits::kTileSide * kSubVoxelsPerVoxel);
  const ItemMaker maker(tile_cell_max(spec, tile_coord), sizes, window.image_runs.size());
  const auto run_at = [&](size_t t) {
    const auto after =
        std::upper_bound(window.image_runs.begin(), window.image_runs.end(), t,
                         [](size_t at, const TileWindow::ImageRun& run) { return at < run.first; });
    return static_cast<size_t>(after - window.image_runs.begin()) - 1;
  };
  parallel_chunks(triangles.size(), kWindowGrain, [&](size_t chunk, size_t begin, size_t end) {
    ChunkItems& out = chunks[chunk];
    out.items.reserve((end - begin) + (end - begin) / 4);
    size_t run = begin < end ? run_at(begin) : 0;
    for (size_t t = begin; t < end && out.items.size() <= kWindowItemsMax; ++t) {
      cancel_point();
      while (t >= window.image_runs[run].first + window.image_runs[run].count) ++run;
      const auto& vertices = mesh.triangles[triangles[t]].vertices;
      const std::array<glm::ivec3, 3> file_q = {mesh.vertices[vertices[0]] - tile_q,
                                                mesh.vertices[vertices[1]] - tile_q,
                                                mesh.vertices[vertices[2]] - tile_q};
      const CornerOrder order = corner_order(file_q);
      const std::array<glm::ivec3, 3> q = {file_q[order.corner[0]], file_q[order.corner[1]],
                                           file_q[order.corner[2]]};
      int32_t* words = &window.vertices[9 * t];
      for (const glm::ivec3& corner : q) {
        *words++ = corner.x;
        *words++ = corner.y;
        *words++ = corner.z;
      }
      const int axis = dominant_axis(q);
      window.axes[t] = static_cast<uint8_t>(axis);
      maker.add(q, axis, static_cast<uint32_t>(t), run, out);
    }
  });
  size_t item_count = 0;
  window.blocks = 0;
  for (const ChunkItems& chunk : chunks) {
    item_count += chunk.items.size();
    window.blocks |= chunk.blocks;
  }
  if (item_count > kWindowItemsMax) return false;
  sort_items(chunks, window);
  return true;
}

}  // namespace voxeld
