#include "server/voxel/solid/merge.h"

#include <algorithm>
#include <array>
#include <atomic>
#include <bit>
#include <map>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/voxel/solid/inside_cells.h"

namespace voxeld {
namespace {

constexpr uint32_t kEnd = UINT32_MAX;

uint32_t tile_order(const SparseTile& tile) {
  return morton_encode(static_cast<uint32_t>(tile.coord[0]), static_cast<uint32_t>(tile.coord[1]),
                       static_cast<uint32_t>(tile.coord[2]));
}

// Full nodes of both lists, without those that lie within others.
std::vector<FullNode> merge_full(const std::vector<FullNode>& a, const std::vector<FullNode>& b) {
  std::vector<FullNode> all(a);
  all.insert(all.end(), b.begin(), b.end());
  std::ranges::sort(all, [](const FullNode& x, const FullNode& y) {
    if (x.brick_morton != y.brick_morton) return x.brick_morton < y.brick_morton;
    return x.level > y.level;
  });
  uint32_t end = 0;
  std::erase_if(all, [&](const FullNode& node) {
    if (node.brick_morton < end) return true;
    end = node.brick_morton + node.brick_count();
    return false;
  });
  return all;
}

class TileMerger {
 public:
  TileMerger(const SparseTile& surface, const SparseTile& inside, const ChannelSet& channels)
      : surface_(surface), inside_(inside), channels_(channels) {}

  SparseTile run() {
    out_.coord = surface_.coord;
    const size_t bricks_max = surface_.masks.size() + inside_.masks.size();
    out_.brick_morton.reserve(bricks_max);
    out_.masks.reserve(bricks_max);
    const std::vector<FullNode> nodes = merge_full(surface_.full, inside_.full);
    size_t next_node = 0;
    for (;;) {
      const uint32_t node = next_node < nodes.size() ? nodes[next_node].brick_morton : kEnd;
      const uint32_t brick = std::min(surface_brick(), inside_brick());
      if (node == kEnd && brick == kEnd) break;
      if (node <= brick) {
        add_node(nodes[next_node++]);
      } else {
        add_brick(brick, BrickMask());
      }
    }
    canonicalize(out_);
    return std::move(out_);
  }

 private:
  uint32_t surface_brick() const {
    return s_ < surface_.masks.size() ? surface_.brick_morton[s_] : kEnd;
  }
  uint32_t inside_brick() const {
    return i_ < inside_.masks.size() ? inside_.brick_morton[i_] : kEnd;
  }

  void add_node(const FullNode& node) {
    const uint32_t end = node.brick_morton + node.brick_count();
    if (!channels_.any() || surface_brick() >= end) {
      out_.full.push_back(node);
      while (surface_brick() < end) ++s_;
      while (inside_brick() < end) ++i_;
      return;
    }
    if (node.level == 0) {
      BrickMask full;
      full.words.fill(~uint64_t{0});
      add_brick(node.brick_morton, full);
      return;
    }
    const uint32_t child_bricks = node.brick_count() / 8;
    for (uint32_t child = 0; child < 8; ++child) {
      add_node({node.brick_morton + child * child_bricks, node.level - 1});
    }
  }

  void add_brick(uint32_t morton, const BrickMask& more) {
    cancel_point();
    BrickMask of_surface, mask = more;
    if (inside_brick() == morton) {
      for (size_t w = 0; w < 8; ++w) mask.words[w] |= inside_.masks[i_].words[w];
      ++i_;
    }
    if (surface_brick() == morton) of_surface = surface_.masks[s_++];
    for (size_t w = 0; w < 8; ++w) mask.words[w] |= of_surface.words[w];
    add_attributes(of_surface, mask);
    out_.brick_morton.push_back(morton);
    out_.masks.push_back(mask);
  }

  void add_attributes(const BrickMask& of_surface, const BrickMask& mask) {
    if (!channels_.any()) return;
    for_each_channel_member([&](Channel channel, auto member) {
      if (!channels_.has(channel)) return;
      append(surface_.*member, channel_info(channel).components, of_surface, mask, out_.*member);
    });
    for (const uint64_t word : of_surface.words) voxel_ += static_cast<size_t>(std::popcount(word));
  }

  // Appends the samples of a brick's voxels: the surface's own, and zeros for the others.
  template <typename T>
  void append(const std::vector<T>& from, size_t components, const BrickMask& of_surface,
              const BrickMask& mask, std::vector<T>& to) const {
    auto next = from.begin() + static_cast<ptrdiff_t>(voxel_ * components);
    for (size_t w = 0; w < 8; ++w) {
      for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
        const bool is_surface = (of_surface.words[w] & bits & (~bits + 1)) != 0;
        if (!is_surface) {
          to.resize(to.size() + components);
          continue;
        }
        to.insert(to.end(), next, next + static_cast<ptrdiff_t>(components));
        next += static_cast<ptrdiff_t>(components);
      }
    }
  }

  const SparseTile& surface_;
  const SparseTile& inside_;
  const ChannelSet channels_;
  size_t s_ = 0, i_ = 0;  // next bricks
  size_t voxel_ = 0;      // next voxel of the surface
  SparseTile out_;
};

// Appends the samples of a voxel of all channels that the tile has.
void copy_voxel(const SparseTile& from, size_t voxel, SparseTile& to) {
  for_each_channel_member([&](Channel channel, auto member) {
    const auto& samples = from.*member;
    if (samples.empty()) return;
    const auto components = static_cast<ptrdiff_t>(channel_info(channel).components);
    const auto first = samples.begin() + static_cast<ptrdiff_t>(voxel) * components;
    (to.*member).insert((to.*member).end(), first, first + components);
  });
}

}  // namespace

SparseTile merge_tile(const SparseTile& surface, const SparseTile& inside,
                      const ChannelSet& channels) {
  return TileMerger(surface, inside, channels).run();
}

void merge_tiles(std::vector<SparseTile> inside, const ChannelSet& channels, ThreadTeam& team,
                 std::vector<SparseTile>& tiles) {
  std::ranges::sort(tiles, {}, tile_order);
  std::ranges::sort(inside, {}, tile_order);
  struct Pair {
    SparseTile* surface;
    SparseTile* inside;
  };
  std::vector<Pair> pairs;
  for (size_t s = 0, i = 0; s < tiles.size() || i < inside.size();) {
    const uint64_t of_surface = s < tiles.size() ? tile_order(tiles[s]) : kEnd;
    const uint64_t of_inside = i < inside.size() ? tile_order(inside[i]) : kEnd;
    pairs.push_back({of_surface <= of_inside ? &tiles[s] : nullptr,
                     of_inside <= of_surface ? &inside[i] : nullptr});
    if (of_surface <= of_inside) ++s;
    if (of_inside <= of_surface) ++i;
  }
  std::vector<SparseTile> merged(pairs.size());
  const bool bare = !channels.any();
  std::atomic<size_t> next = 0;
  team.run(team.threads(), [&](int) {
    SparseTile none;
    for (size_t p = next++; p < pairs.size(); p = next++) {
      cancel_point();
      const Pair& pair = pairs[p];
      if (pair.surface == nullptr && bare) {
        merged[p] = std::move(*pair.inside);
        continue;
      }
      none.coord = pair.surface != nullptr ? pair.surface->coord : pair.inside->coord;
      const SparseTile& of_surface = pair.surface != nullptr ? *pair.surface : none;
      const SparseTile& of_inside = pair.inside != nullptr ? *pair.inside : none;
      merged[p] = merge_tile(of_surface, of_inside, channels);
    }
  });
  tiles = std::move(merged);
}

void keep_inside(const std::vector<SparseTile>& inside, std::vector<SparseTile>& surface) {
  std::map<std::array<int32_t, 3>, const SparseTile*> tiles;
  for (const SparseTile& tile : inside) tiles[tile.coord] = &tile;
  for (SparseTile& tile : surface) {
    SparseTile kept;
    kept.coord = tile.coord;
    const auto cells = tiles.find(tile.coord);
    size_t first = 0;
    for (size_t b = 0; cells != tiles.end() && b < tile.masks.size(); ++b) {
      cancel_point();
      BrickMask common = brick_of(*cells->second, tile.brick_morton[b]);
      for (size_t w = 0; w < 8; ++w) common.words[w] &= tile.masks[b].words[w];
      size_t voxel = first;
      for (size_t w = 0; w < 8; ++w) {
        for (uint64_t bits = tile.masks[b].words[w]; bits != 0; bits &= bits - 1, ++voxel) {
          if ((common.words[w] & bits & (~bits + 1)) != 0) copy_voxel(tile, voxel, kept);
        }
      }
      first = voxel;
      if (common == BrickMask{}) continue;
      kept.brick_morton.push_back(tile.brick_morton[b]);
      kept.masks.push_back(common);
    }
    tile = std::move(kept);
  }
  std::erase_if(surface, [](const SparseTile& tile) { return tile.empty(); });
}

}  // namespace voxeld
