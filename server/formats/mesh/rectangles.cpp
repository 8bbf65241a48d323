// Bricks give, for each direction and layer of cells, 8x8 faces as one word. Words of a tile's
// layer form a plane of 256 rows of 256 bits, in which rectangles are found by runs of bits. The
// words of each brick are made once; the layers of a slab share the plane.
#include "server/formats/mesh/rectangles.h"

#include <atomic>
#include <bit>
#include <memory>
#include <string>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"

namespace voxeld::mesh {
namespace {

constexpr int kSide = limits::kTileSide;
constexpr int kBrick = limits::kBrickSide;

// The layers of 8x8 faces of a brick that look up or down an axis: bit 8 * v + u.
using Layers = std::array<uint64_t, kBrick>;

// Turns planes of z into layers across an axis.
Layers layers_of(const Planes& faces, uint32_t axis) {
  if (axis == 2) return faces;
  Layers layers{};
  for (size_t z = 0; z < faces.size(); ++z) {
    if (faces[z] == 0) continue;
    for (size_t layer = 0; layer < layers.size(); ++layer) {
      const uint64_t row = axis == 1 ? faces[z] >> (8 * layer) & 0xff
                                     // Multiplies bit 8 * y of the column to bit 56 + y.
                                     : ((faces[z] >> layer & kColumn) * 0x0102040810204080) >> 56;
      layers[layer] |= row << (8 * z);
    }
  }
  return layers;
}

// The Morton code in a brick of a cell.
constexpr auto kSpread = [] {
  std::array<uint16_t, kBrick> spread{};
  for (uint32_t i = 0; i < spread.size(); ++i) spread[i] = static_cast<uint16_t>(morton_spread(i));
  return spread;
}();

// A layer of faces of a tile and their colours.
class FacePlane {
 public:
  void add(int u, int v, uint64_t faces) {  // of a brick whose first face is at u, v
    for (; faces != 0; faces >>= 8, ++v) {
      if ((faces & 0xff) == 0) continue;
      rows_[static_cast<size_t>(v)][static_cast<size_t>(u >> 6)] |= (faces & 0xff) << (u & 63);
      touched_[static_cast<size_t>(v >> 6)] |= uint64_t{1} << (v & 63);
    }
  }
  void set_color(int u, int v, Rgba color) { colors_[color_index(u, v)] = color; }

  // Calls take(u0, v0, u1, v1, color) for rectangles that cover the faces, and removes the faces.
  template <bool merge, bool has_colors, typename Take>
  void take_rectangles(Take&& take) {
    for (size_t word = 0; word < touched_.size(); ++word) {
      for (; touched_[word] != 0; touched_[word] &= touched_[word] - 1) {
        const int v = static_cast<int>(word) * 64 + std::countr_zero(touched_[word]);
        take_row<merge, has_colors>(v, take);
      }
    }
  }

 private:
  using Row = std::array<uint64_t, kSide / 64>;

  static size_t color_index(int u, int v) {
    return static_cast<size_t>(v) * kSide + static_cast<size_t>(u);
  }

  template <bool merge, bool has_colors, typename Take>
  void take_row(int v, Take& take) {
    Row& row = rows_[static_cast<size_t>(v)];
    for (size_t word = 0; word < row.size(); ++word) {
      while (row[word] != 0) {
        const int u = static_cast<int>(word) * 64 + std::countr_zero(row[word]);
        const Rgba color = has_colors ? colors_[color_index(u, v)] : 0;
        int u1 = u + 1, v1 = v + 1;
        if constexpr (merge) {
          u1 = run_end(row, u);
          if constexpr (has_colors) u1 = color_end(u, u1, v, color);
          while (v1 < kSide && contains(rows_[static_cast<size_t>(v1)], u, u1) &&
                 (!has_colors || color_end(u, u1, v1, color) == u1)) {
            clear(rows_[static_cast<size_t>(v1++)], u, u1);
          }
        }
        clear(row, u, u1);
        take(u, v, u1, v1, color);
      }
    }
  }

  // The end of the run of bits that begins at u.
  static int run_end(const Row& row, int u) {
    while (true) {
      const int left = 64 - (u & 63);
      const int ones = std::countr_one(row[static_cast<size_t>(u >> 6)] >> (u & 63));
      u += ones;
      if (ones < left || u == kSide) return u;
    }
  }
  // The end of the run of a colour in [u, u1).
  int color_end(int u, int u1, int v, Rgba color) const {
    while (u < u1 && colors_[color_index(u, v)] == color) ++u;
    return u;
  }
  // Bits of word w in [u, u1).
  static uint64_t mask(size_t w, int u, int u1) {
    const int begin = u - static_cast<int>(64 * w), end = u1 - static_cast<int>(64 * w);
    const uint64_t from = begin <= 0 ? ~uint64_t{0} : ~uint64_t{0} << begin;
    return end >= 64 ? from : from & ~(~uint64_t{0} << end);
  }
  template <typename Each>
  static void for_each_word(int u, int u1, Each&& each) {
    for (auto w = static_cast<size_t>(u >> 6); w <= static_cast<size_t>((u1 - 1) >> 6); ++w) {
      each(w, mask(w, u, u1));
    }
  }
  static bool contains(const Row& row, int u, int u1) {
    bool all = true;
    for_each_word(u, u1, [&](size_t w, uint64_t bits) { all = all && (row[w] & bits) == bits; });
    return all;
  }
  static void clear(Row& row, int u, int u1) {
    for_each_word(u, u1, [&](size_t w, uint64_t bits) { row[w] &= ~bits; });
  }

  std::array<Row, kSide> rows_{};
  Row touched_{};  // rows with faces
  std::array<Rgba, size_t{kSide} * kSide> colors_{};
};

// A brick of a slab and its faces in both directions.
struct SlabBrick {
  uint32_t brick;
  int u, v;                     // of its first cell
  std::array<Layers, 2> faces;  // down and up the axis
};

class SlabFinder {
 public:
  SlabFinder(const VoxelBricks& voxels, const VoxelColors* colors, bool merge)
      : voxels_(voxels),
        colors_(colors != nullptr && colors->several() ? colors : nullptr),
        other_(colors != nullptr ? colors->other() : 0),
        merge_(merge) {}

  // The rectangles of the bricks at `at` along the axis.
  RectangleSlab find(uint32_t tile, uint32_t axis, int at) const {
    RectangleSlab slab{tile, axis, at, {}};
    static thread_local std::vector<SlabBrick> bricks;
    static thread_local const auto plane = std::make_unique<FacePlane>();
    find_bricks(tile, axis, at, bricks);
    for (size_t layer = 0; layer < size_t{kBrick}; ++layer) {
      for (const bool up : {false, true}) {
        if (!add_layer(bricks, tile, axis, layer, up, *plane)) continue;
        const size_t number = static_cast<size_t>(at) * kBrick + layer + (up ? 1 : 0);
        const auto take = [&](int u0, int v0, int u1, int v1, Rgba color) {
          const auto u16 = [](auto value) { return static_cast<uint16_t>(value); };
          slab.rectangles.push_back({u16(u0), u16(v0), u16(u1), u16(v1), u16(number), up,
                                     colors_ != nullptr ? color : other_});
        };
        const bool has_colors = colors_ != nullptr;
        if (!merge_) {
          has_colors ? plane->take_rectangles<false, true>(take)
                     : plane->take_rectangles<false, false>(take);
        } else {
          has_colors ? plane->take_rectangles<true, true>(take)
                     : plane->take_rectangles<true, false>(take);
        }
      }
    }
    return slab;
  }

 private:
  void find_bricks(uint32_t tile, uint32_t axis, int at, std::vector<SlabBrick>& bricks) const {
    bricks.clear();
    const BrickRows& rows = voxels_.index().tiles()[tile].rows;
    const auto add = [&](int x, int y, int z) {
      const uint32_t brick = voxels_.index().find(tile, x, y, z);
      const std::array<int, 3> place = {x, y, z};
      SlabBrick found{
          brick, kBrick * place[kPlaneAxes[axis][0]], kBrick * place[kPlaneAxes[axis][1]], {}};
      uint64_t any = 0;
      for (const bool up : {false, true}) {
        const Planes faces = voxels_.open_faces(tile, place, axis, up);
        uint64_t some = 0;
        for (const uint64_t plane : faces) some |= plane;
        if (some != 0) found.faces[up ? 1 : 0] = layers_of(faces, axis);
        any |= some;
      }
      if (any != 0) bricks.push_back(found);
    };
    for (int b = 0; b < kTileBricks; ++b) {
      for (int a = 0; a < kTileBricks; ++a) {
        if (axis == 0) {
          if ((rows[row_of(a, b)] >> at & 1) != 0) add(at, a, b);
        } else {  // a row of bricks lies in the slab
          if (a > 0) break;
          const int y = axis == 1 ? at : b, z = axis == 1 ? b : at;
          for (uint32_t bits = rows[row_of(y, z)]; bits != 0; bits &= bits - 1) {
            add(std::countr_zero(bits), y, z);
          }
        }
      }
    }
  }

  // Puts a layer's faces into the plane. False: there are none.
  bool add_layer(const std::vector<SlabBrick>& bricks, uint32_t tile, uint32_t axis, size_t layer,
                 bool up, FacePlane& plane) const {
    bool any = false;
    for (const SlabBrick& brick : bricks) {
      const uint64_t faces = brick.faces[up ? 1 : 0][layer];
      if (faces == 0) continue;
      any = true;
      plane.add(brick.u, brick.v, faces);
      if (colors_ != nullptr) add_colors(brick, tile, axis, layer, faces, plane);
    }
    return any;
  }

  void add_colors(const SlabBrick& brick, uint32_t tile, uint32_t axis, size_t layer,
                  uint64_t faces, FacePlane& plane) const {
    const SparseTile& source = voxels_.grid().tiles[tile];
    const auto [mask, attribute] = voxels_.source(brick.brick);
    std::array<size_t, 8> before{};  // voxels of the mask before a word
    if (mask != kNone) {
      for (size_t w = 1; w < before.size(); ++w) {
        before[w] =
            before[w - 1] + static_cast<size_t>(std::popcount(source.masks[mask].words[w - 1]));
      }
    }
    for (; faces != 0; faces &= faces - 1) {
      const int bit = std::countr_zero(faces);
      size_t voxel = kNoAttributes;
      if (mask != kNone) {
        std::array<size_t, 3> cell{};
        cell[axis] = layer;
        cell[kPlaneAxes[axis][0]] = static_cast<size_t>(bit & 7);
        cell[kPlaneAxes[axis][1]] = static_cast<size_t>(bit >> 3);
        const uint32_t code =
            kSpread[cell[0]] | uint32_t{kSpread[cell[1]]} << 1 | uint32_t{kSpread[cell[2]]} << 2;
        const uint64_t lower = (uint64_t{1} << (code & 63)) - 1;
        voxel = attribute + before[code >> 6] +
                static_cast<size_t>(std::popcount(source.masks[mask].words[code >> 6] & lower));
      }
      plane.set_color(brick.u + (bit & 7), brick.v + (bit >> 3), colors_->of(source, voxel));
    }
  }

  const VoxelBricks& voxels_;
  const VoxelColors* colors_;  // null: one colour
  Rgba other_;
  bool merge_;
};

struct SlabPlace {
  uint32_t tile, axis;
  int at;
};

// The slabs that have bricks.
std::vector<SlabPlace> slabs_of(const BrickIndex& index) {
  std::vector<SlabPlace> slabs;
  for (uint32_t tile = 0; tile < index.tiles().size(); ++tile) {
    std::array<uint32_t, 3> places{};  // bit `at`: there is a brick
    for_each_brick_of(index.tiles()[tile].rows, [&](int x, int y, int z) {
      places[0] |= uint32_t{1} << x;
      places[1] |= uint32_t{1} << y;
      places[2] |= uint32_t{1} << z;
    });
    for (uint32_t axis = 0; axis < places.size(); ++axis) {
      for (uint32_t bits = places[axis]; bits != 0; bits &= bits - 1) {
        slabs.push_back({tile, axis, std::countr_zero(bits)});
      }
    }
  }
  return slabs;
}

}  // namespace

Result<std::vector<RectangleSlab>> find_rectangles(const VoxelBricks& voxels,
                                                   const VoxelColors* colors, bool merge,
                                                   std::string_view format, uint64_t count_max) {
  const SlabFinder finder(voxels, colors, merge);
  const std::vector<SlabPlace> places = slabs_of(voxels.index());
  std::vector<RectangleSlab> slabs(places.size());
  std::atomic<uint64_t> count{0};
  parallel_for(places.size(), [&](size_t i) {
    cancel_point();
    if (count.load(std::memory_order_relaxed) > count_max) return;
    slabs[i] = finder.find(places[i].tile, places[i].axis, places[i].at);
    count.fetch_add(slabs[i].rectangles.size(), std::memory_order_relaxed);
  });
  if (count.load() <= count_max) return slabs;
  return Error{ErrorCode::kGridTooLarge, std::string(format) + ": too many faces for a mesh",
               "at most " + std::to_string(count_max), "more"};
}

}  // namespace voxeld::mesh
