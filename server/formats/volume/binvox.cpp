// Writes Patrick Min's .binvox, version 1:
//
//   #binvox 1
//   dim D D D          the longest side of the grid: readers expect a cube
//   translate X Y Z    the min corner of the cube in world units
//   scale S            the edge of the whole cube in world units
//   data
//   u8 value 0 or 1, u8 count 1..255, over cells with y fastest, then z, then x
//
// The grid is at the cube's min corner; the other cells are empty. Runs end at each plane of x, so
// planes are encoded by themselves. The specification: https://www.patrickmin.com/binvox/binvox.html
#include "server/formats/volume/binvox.h"

#include <algorithm>
#include <bit>
#include <string>
#include <vector>

#include "proto/codec/tile_runs.h"
#include "proto/limits.h"
#include "proto/options/values.h"
#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/output_file.h"
#include "server/formats/volume/volume_facts.h"

namespace voxeld::volume {
namespace {

constexpr size_t kBrick = limits::kBrickSide;
constexpr size_t kRunMax = 255;
constexpr uint32_t kWordBits = 64;

int longest_side(const GridSpec& spec) {
  return std::max({spec.dims.x, spec.dims.y, spec.dims.z});
}

// The cells of a plane of x as bits, y fastest.
class BinvoxPlane {
 public:
  explicit BinvoxPlane(size_t side)
      : side_(side), words_((side * side + kWordBits - 1) / kWordBits) {}

  void set(size_t y, size_t z) {
    const size_t at = z * side_ + y;
    words_[at / kWordBits] |= uint64_t{1} << at % kWordBits;
  }

  // Appends the plane's runs.
  void encode(std::vector<uint8_t>& out) const {
    const size_t cells = side_ * side_;
    bool value = false;
    for (size_t begin = 0; begin < cells; value = !value) {
      const size_t end = find(!value, begin, cells);
      for (size_t left = end - begin; left > 0;) {
        const size_t count = std::min(left, kRunMax);
        out.push_back(value ? 1 : 0);
        out.push_back(static_cast<uint8_t>(count));
        left -= count;
      }
      begin = end;
    }
  }

 private:
  // The first cell from `at` on that is `value`; `cells`: none.
  size_t find(bool value, size_t at, size_t cells) const {
    const auto word = [&](size_t i) { return value ? words_[i] : ~words_[i]; };
    size_t i = at / kWordBits;
    uint64_t bits = word(i) >> at % kWordBits << at % kWordBits;
    while (bits == 0) {
      if (++i == words_.size()) return cells;
      bits = word(i);
    }
    return std::min(cells, i * kWordBits + static_cast<size_t>(std::countr_zero(bits)));
  }

  size_t side_;
  std::vector<uint64_t> words_;
};

// The bricks and full nodes of a grid by slabs, 8 planes of x. A full node is in each slab that it
// crosses.
class BinvoxSlabs {
 public:
  BinvoxSlabs(const Grid& grid, size_t side) : side_(side), slabs_((side + kBrick - 1) / kBrick) {
    for (const SparseTile& tile : grid.tiles) {
      cancel_point();
      for (size_t b = 0; b < tile.masks.size(); ++b) {
        const auto [x, y, z] = brick_cell(tile, tile.brick_morton[b]);
        slab(x).push_back({y, z, 0, &tile.masks[b]});
      }
      for (const FullNode& node : tile.full) {
        const auto [x, y, z] = brick_cell(tile, node.brick_morton);
        const int32_t node_side = limits::kBrickSide << node.level;
        for (int32_t dx = 0; dx < node_side; dx += limits::kBrickSide) {
          slab(x + dx).push_back({y, z, node_side, nullptr});
        }
      }
    }
  }

  size_t count() const { return slabs_.size(); }

  std::vector<uint8_t> encode(size_t number) const {
    const size_t planes_count = std::min(kBrick, side_ - number * kBrick);
    std::vector<BinvoxPlane> planes(planes_count, BinvoxPlane(side_));
    for (const Box& box : slabs_[number]) {
      box.mask != nullptr ? add_brick(planes, box) : add_full(planes, box);
    }
    std::vector<uint8_t> out;
    for (const BinvoxPlane& plane : planes) plane.encode(out);
    return out;
  }

 private:
  // A brick, or the part of a full node in the slab.
  struct Box {
    int32_t y, z, side;
    const BrickMask* mask;  // null: full
  };

  std::vector<Box>& slab(int32_t x) { return slabs_[static_cast<size_t>(x) / kBrick]; }

  static void add_brick(std::vector<BinvoxPlane>& planes, const Box& box) {
    for (uint32_t w = 0; w < box.mask->words.size(); ++w) {
      for (uint64_t bits = box.mask->words[w]; bits != 0; bits &= bits - 1) {
        const auto bit = static_cast<uint32_t>(std::countr_zero(bits));
        const auto [x, y, z] = morton_decode(w * kWordBits + bit);
        planes[x].set(static_cast<size_t>(box.y) + y, static_cast<size_t>(box.z) + z);
      }
    }
  }

  static void add_full(std::vector<BinvoxPlane>& planes, const Box& box) {
    for (BinvoxPlane& plane : planes) {
      for (int32_t z = box.z; z < box.z + box.side; ++z) {
        for (int32_t y = box.y; y < box.y + box.side; ++y) {
          plane.set(static_cast<size_t>(y), static_cast<size_t>(z));
        }
      }
    }
  }

  size_t side_;
  std::vector<std::vector<Box>> slabs_;
};

}  // namespace

Status check_binvox(const GridSpec& spec) {
  const int64_t side = longest_side(spec);
  const int64_t cells = side * side * side;
  if (cells <= limits::kDenseCellsMax) return {};
  return Error{
      ErrorCode::kGridTooLarge,
      "binvox: too many cells in the cube around the grid, of side " + std::to_string(side),
      "at most " + std::to_string(limits::kDenseCellsMax), std::to_string(cells)};
}

}  // namespace voxeld::volume

namespace voxeld {

Status encode_binvox(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  using namespace volume;
  VOXELD_TRY(check_binvox(grid.spec));
  const int side = longest_side(grid.spec);
  const std::string dim = " " + std::to_string(side);
  const double scale = side * grid.spec.voxel_size.x;
  VOXELD_TRY(file.append(text_bytes("#binvox 1\ndim" + dim + dim + dim + "\ntranslate " +
                                    vector_text(grid.spec.origin_world) + "\nscale " +
                                    option_values::to_text(scale) + "\ndata\n")));
  const BinvoxSlabs slabs(grid, static_cast<size_t>(side));
  const size_t batch = ThreadPool::shared().threads();
  for (size_t begin = 0; begin < slabs.count(); begin += batch) {
    std::vector<std::vector<uint8_t>> encoded(std::min(batch, slabs.count() - begin));
    ThreadPool::shared().for_each(encoded.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      encoded[i] = slabs.encode(begin + i);
    });
    for (const std::vector<uint8_t>& bytes : encoded) VOXELD_TRY(file.append(bytes));
  }
  return {};
}

}  // namespace voxeld
