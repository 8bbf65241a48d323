#include "server/formats/mesh/vertex_table.h"

#include <algorithm>
#include <atomic>
#include <span>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/base/pieces.h"

namespace voxeld::mesh {
namespace {

// Bricks that a thread handles at a time.
constexpr size_t kBricksAtOnce = 256;

template <typename Work>
void for_each_brick_number(size_t bricks, Work&& work) {
  parallel_for((bricks + kBricksAtOnce - 1) / kBricksAtOnce, [&](size_t part) {
    cancel_point();
    const size_t end = std::min(bricks, (part + 1) * kBricksAtOnce);
    for (size_t brick = part * kBricksAtOnce; brick < end; ++brick) work(brick);
  });
}

}  // namespace

VertexTable::VertexTable(const LatticePoints& points, bool has_colors)
    : points_(points), has_colors_(has_colors), first_(points.index().size()) {
  if (has_colors) counts_.resize(points.index().size());
}

void VertexTable::count(uint32_t brick) {
  std::atomic_ref(counts_[brick]).fetch_add(1, std::memory_order_relaxed);
}

void VertexTable::begin() {
  begins_.reserve(counts_.size());
  uint64_t keys = 0;
  for (uint32_t& count : counts_) {
    begins_.push_back(keys);
    keys += count;
    count = 0;
  }
  keys_ = UnsetArray<Key>(keys);
}

void VertexTable::add(uint32_t brick, uint32_t in_brick, Rgba color) {
  const uint32_t at = std::atomic_ref(counts_[brick]).fetch_add(1, std::memory_order_relaxed);
  keys_[begins_[brick] + at] = Key{in_brick} << 32 | color;
}

void VertexTable::number_vertices() {
  std::vector<uint32_t> sizes(first_.size());
  if (!has_colors_) resize_in_pieces(before_, first_.size());
  for_each_brick_number(first_.size(), [&](size_t brick) {
    if (has_colors_) {
      const std::span keys(keys_.size() > 0 ? &keys_[begins_[brick]] : nullptr, counts_[brick]);
      std::ranges::sort(keys);
      const auto end = std::unique(keys.begin(), keys.end());
      counts_[brick] = static_cast<uint32_t>(end - keys.begin());
      sizes[brick] = counts_[brick];
      return;
    }
    uint32_t size = 0;
    for (size_t z = 0; z < before_[brick].size(); ++z) {
      before_[brick][z] = static_cast<uint16_t>(size);
      size += static_cast<uint32_t>(std::popcount(points_.marks(static_cast<uint32_t>(brick))[z]));
    }
    sizes[brick] = size;
  });
  for (size_t brick = 0; brick < sizes.size(); ++brick) {
    first_[brick] = size_;
    size_ += sizes[brick];
  }
}

uint32_t VertexTable::find(uint32_t brick, uint32_t in_brick, Rgba color) const {
  uint64_t number = first_[brick];
  if (has_colors_) {
    const std::span keys(&keys_[begins_[brick]], counts_[brick]);
    const auto found = std::ranges::lower_bound(keys, Key{in_brick} << 32 | color);
    number += static_cast<uint64_t>(found - keys.begin());
  } else {
    const uint64_t lower = (uint64_t{1} << (in_brick & 63)) - 1;
    number += before_[brick][in_brick >> 6] +
              static_cast<uint64_t>(std::popcount(points_.marks(brick)[in_brick >> 6] & lower));
  }
  return static_cast<uint32_t>(number);
}

UnsetArray<Vertex> VertexTable::vertices(Rgba color) const {
  UnsetArray<Vertex> vertices(size_);
  const auto& tiles = points_.index().tiles();
  parallel_for(tiles.size(), [&](size_t t) {
    cancel_point();
    uint32_t brick = tiles[t].first;
    for_each_brick_of(tiles[t].rows, [&](int x, int y, int z) {
      const std::array<int, 3> base = {
          tiles[t].coord[0] * limits::kTileSide + x * limits::kBrickSide,
          tiles[t].coord[1] * limits::kTileSide + y * limits::kBrickSide,
          tiles[t].coord[2] * limits::kTileSide + z * limits::kBrickSide};
      uint64_t number = first_[brick];
      const auto add = [&](uint32_t p, Rgba own) {
        vertices[number++] = {{static_cast<float>(base[0] + static_cast<int>(p & 7)),
                               static_cast<float>(base[1] + static_cast<int>(p >> 3 & 7)),
                               static_cast<float>(base[2] + static_cast<int>(p >> 6))},
                              own};
      };
      if (has_colors_) {
        for (uint32_t i = 0; i < counts_[brick]; ++i) {
          const Key key = keys_[begins_[brick] + i];
          add(static_cast<uint32_t>(key >> 32), static_cast<Rgba>(key));
        }
      } else {
        const Planes& marks = points_.marks(brick);
        for (uint32_t plane = 0; plane < marks.size(); ++plane) {
          for (uint64_t bits = marks[plane]; bits != 0; bits &= bits - 1) {
            add(64 * plane + static_cast<uint32_t>(std::countr_zero(bits)), color);
          }
        }
      }
      ++brick;
    });
  });
  return vertices;
}

}  // namespace voxeld::mesh
