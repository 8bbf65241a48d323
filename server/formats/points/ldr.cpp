// Writes LDraw's .ldr, a model of bricks. Lines of text that end with CR and LF:
//
//   0 TEXT                    header, and comments: dims, origin, voxel_size, units, transform and
//                             the number of voxels
//   1 COLOR X Y Z A..I PART   a brick: its place and the 3x3 matrix that turns it
//   0 STEP                    after each layer of the grid, from below, that has voxels
//
// A voxel is a brick 1 x 1: 20 x 24 x 20 units. LDraw's y points down, so cell x, y, z is the box
// [20 x, 20 x + 20], [-24 y - 24, -24 y], [-20 z - 20, -20 z]: the grid after half a turn around x,
// not mirrored. A brick's place is the middle of its top. Equal colours in a row are joined to
// bricks of up to 8 voxels, along x in even layers and along z in odd ones, so that bricks of
// neighbouring layers cross and hold each other. The parts lie along x; the matrix turns them.
//
// COLOR is the code of the nearest colour in OKLab of ldraw_colors.h, or 0x2RRGGBB: for the colours
// of a palette, and for those of ids in a grid without colours. Voxels without a colour, inside a
// solid, have the mean colour.
//
// Sources: https://www.ldraw.org/article/218.html (file format),
// https://www.ldraw.org/article/547.html (colours), and the parts' own files in the library.
#include "server/formats/points/ldr.h"

#include <algorithm>
#include <array>
#include <bit>
#include <charconv>
#include <cmath>
#include <span>
#include <string>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/mesh/voxel_colors.h"
#include "server/formats/mesh/world_vertices.h"
#include "server/formats/output_file.h"
#include "server/formats/points/ldraw_colors.h"
#include "server/formats/volume/volume_facts.h"
#include "server/grid/color/palette_entries.h"

namespace voxeld::ldraw {
namespace {

constexpr double kProportionRounding = 1e-6;
constexpr std::string_view kLineEnd = "\r\n";
constexpr uint32_t kSide = limits::kBrickSide;
constexpr uint32_t kRunMax = 8;
// The cells 0 to 3 of a row along x or z, in a word of a mask (BrickMask).
constexpr uint64_t kRowAlongX = 0x303, kRowAlongZ = 0x1100000011;

// The bricks 1 x N, which lie along x in their own files.
constexpr std::array<std::string_view, kRunMax + 1> kParts = {
    "", "3005.dat", "3004.dat", "3622.dat", "3010.dat", "", "3009.dat", "", "3008.dat"};
// The length of the first brick of a row with so many voxels: the rows of 5 and 7, which no brick
// has, become two bricks that are nearly equal, not one with a single stud at its end.
constexpr std::array<uint8_t, kRunMax + 1> kFirstLength = {0, 1, 2, 3, 4, 3, 6, 4, 8};

constexpr std::string_view kAlongX = " 1 0 0 0 1 0 0 0 1 ", kAlongZ = " 0 0 1 0 1 0 -1 0 0 ";

// The colour of each voxel as a line of the file names it.
class BrickColors {
 public:
  BrickColors(const Grid& grid, const OutputOptions& options) : grid_(grid), colors_(grid) {
    if (!grid.channels.color) return;
    std::vector<Rgb> entries;
    if (options.palette.empty()) {
      for (const LdrawColor& color : ldraw_colors()) {
        entries.push_back(color.srgb);
        codes_.push_back(color.code);
      }
    } else {
      entries.assign(options.palette.begin(), options.palette.end());
      for (const Rgb& color : entries) codes_.push_back(direct_color(color));
    }
    entries_ =
        choose_entries(grid, entries, Dither::kNone, [&](const SparseTile& tile, size_t voxel) {
          const mesh::Rgba color = colors_.of(tile, voxel);
          // A voxel inside a solid, of a brick that is not full, is all 0.
          return (color == 0 ? colors_.other() : color) & 0xffffff;
        });
  }

  uint32_t of(size_t tile, size_t voxel) const {
    if (!codes_.empty()) return codes_[entries_.of(tile, voxel)];
    if (!colors_.several()) return kPlainCode;
    return direct_color(rgb_of(colors_.of(grid_.tiles[tile], voxel)));
  }

 private:
  const Grid& grid_;
  mesh::VoxelColors colors_;
  std::vector<uint32_t> codes_;  // of the entries; empty: ids, or one colour
  VoxelEntries entries_;
};

// The bricks of the grid's octree in a slab of 8 layers.
struct SlabBrick {
  uint32_t x, z;  // in bricks
  size_t tile;
  const BrickMask* mask;                // null: full, without attributes
  std::array<size_t, 8> word_voxels{};  // the first voxel with attributes, of each word of the mask
};
using Slab = std::vector<SlabBrick>;

std::vector<Slab> slabs_of(const Grid& grid) {
  std::vector<Slab> slabs((static_cast<size_t>(grid.spec.dims.y) + kSide - 1) / kSide);
  constexpr uint32_t kTileBricks = limits::kTileSide / limits::kBrickSide;
  for (size_t t = 0; t < grid.tiles.size(); ++t) {
    cancel_point();
    const SparseTile& tile = grid.tiles[t];
    const auto first = [&](size_t axis) {
      return static_cast<uint32_t>(tile.coord[axis]) * kTileBricks;
    };
    for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t voxel) {
      const auto at = morton_decode(morton);
      const bool is_full = voxel == kNoAttributes;
      SlabBrick& brick = slabs[first(1) + at[1]].emplace_back(
          SlabBrick{first(0) + at[0], first(2) + at[2], t, is_full ? nullptr : &mask});
      if (is_full) return;
      for (size_t w = 0; w < mask.words.size(); ++w) {
        brick.word_voxels[w] = voxel;
        voxel += static_cast<size_t>(std::popcount(mask.words[w]));
      }
    });
  }
  return slabs;
}

// One line, which is made in place: there are millions.
class BrickLine {
 public:
  BrickLine& operator<<(std::string_view text) {
    end_ = std::ranges::copy(text, end_).out;
    return *this;
  }
  BrickLine& operator<<(int32_t number) {
    end_ = std::to_chars(end_, chars_.data() + chars_.size(), number).ptr;
    return *this;
  }
  void add_color(uint32_t color) {
    if (color < direct_color({0, 0, 0})) {
      *this << static_cast<int32_t>(color);
      return;
    }
    constexpr std::string_view kDigits = "0123456789ABCDEF";
    *this << "0x";
    for (int shift = 24; shift >= 0; shift -= 4) *end_++ = kDigits[color >> shift & 0xf];
  }
  std::string_view text() const { return {chars_.data(), end_}; }

 private:
  std::array<char, 128> chars_;  // NOLINT(*-member-init); the longest line has 64
  char* end_ = chars_.data();
};

// Writes the lines of one slab.
class SlabLines {
 public:
  SlabLines(const BrickColors& colors, Slab& slab, uint32_t number)
      : colors_(colors), slab_(slab), first_layer_(number * kSide) {}

  std::string write() {
    for (const bool along_z : {false, true}) {
      std::ranges::sort(slab_, {}, [&](const SlabBrick& brick) {
        return along_z ? std::pair(brick.x, brick.z) : std::pair(brick.z, brick.x);
      });
      for (uint32_t y = along_z ? 1 : 0; y < kSide; y += 2) write_layer(y, along_z);
    }
    std::string text;
    for (const std::string& layer : layers_) {
      text += layer;
      if (!layer.empty()) (text += "0 STEP") += kLineEnd;
    }
    return text;
  }

 private:
  // A row of equal colours: cells [begin, end).
  struct Run {
    uint32_t begin = 0, end = 0, color = 0;
  };

  void write_layer(uint32_t y, bool along_z) {
    std::string& text = layers_[y];
    for (auto begin = slab_.begin(); begin != slab_.end();) {
      const uint32_t across = along_z ? begin->x : begin->z;
      const auto end = std::find_if(begin, slab_.end(), [&](const SlabBrick& brick) {
        return (along_z ? brick.x : brick.z) != across;
      });
      for (uint32_t i = 0; i < kSide; ++i) {
        Run run;
        for (auto brick = begin; brick != end; ++brick) {
          add_brick(text, *brick, y, i, along_z, run);
        }
        finish(text, y, across * kSide + i, along_z, run);
      }
      begin = end;
    }
  }

  // Adds the voxels of a row of a brick to the run, and writes what they end.
  void add_brick(std::string& text, const SlabBrick& brick, uint32_t y, uint32_t across,
                 bool along_z, Run& run) const {
    const uint32_t first = (along_z ? brick.z : brick.x) * kSide;
    const uint32_t row = (along_z ? brick.x : brick.z) * kSide + across;
    // The row is in two words, 4 cells in each.
    const uint32_t low = along_z ? morton_encode(across, y, 0) : morton_encode(0, y, across);
    const unsigned step = along_z ? 2 : 0;  // of the axis in the Morton code
    for (uint32_t half = 0; half < 2; ++half) {
      const uint32_t word = low / 64 + (half << step);
      const uint64_t mask = brick.mask != nullptr ? brick.mask->words[word] : ~uint64_t{0};
      for (uint64_t bits = mask & (along_z ? kRowAlongZ : kRowAlongX) << low % 64; bits != 0;
           bits &= bits - 1) {
        const auto bit = static_cast<uint32_t>(std::countr_zero(bits));
        const uint32_t cell = first + 4 * half + morton_compact((bit - low % 64) >> step);
        const uint32_t color = color_of(brick, word, bit, mask);
        if (cell != run.end || color != run.color || run.begin == run.end) {
          finish(text, y, row, along_z, run);
          run = {cell, cell, color};
        }
        ++run.end;
      }
    }
  }

  uint32_t color_of(const SlabBrick& brick, uint32_t word, uint32_t bit, uint64_t bits) const {
    if (brick.mask == nullptr) return colors_.of(brick.tile, kNoAttributes);
    const uint64_t before = bits & ((uint64_t{1} << bit) - 1);
    return colors_.of(brick.tile,
                      brick.word_voxels[word] + static_cast<size_t>(std::popcount(before)));
  }

  // Writes the bricks of a run.
  void finish(std::string& text, uint32_t y, uint32_t row, bool along_z, const Run& run) const {
    for (uint32_t begin = run.begin; begin < run.end;) {
      const uint32_t length = kFirstLength[std::min(run.end - begin, kRunMax)];
      const auto middle = static_cast<int32_t>(2 * begin + length) * kBrickUnits.x / 2;
      const auto across = static_cast<int32_t>(2 * row + 1) * kBrickUnits.x / 2;
      const int32_t top = static_cast<int32_t>(first_layer_ + y + 1) * kBrickUnits.y;
      BrickLine line;
      line << "1 ";
      line.add_color(run.color);
      line << " " << (along_z ? across : middle) << " " << -top << " "
           << -(along_z ? middle : across) << (along_z ? kAlongZ : kAlongX) << kParts[length]
           << kLineEnd;
      text += line.text();
      begin += length;
    }
  }

  const BrickColors& colors_;
  Slab& slab_;
  uint32_t first_layer_;
  std::array<std::string, kSide> layers_;
};

std::string ldr_header(const Grid& grid) {
  std::string text;
  const auto add = [&](std::string_view line) { ((text += "0 ") += line) += kLineEnd; };
  add("Voxels as bricks");
  add("Name: voxels.ldr");
  add("Author: voxeld");
  add("!LDRAW_ORG Unofficial_Model");
  for (const std::string& line : mesh::placement_lines(grid)) add("// " + line);
  add("// voxels " + std::to_string(grid.voxel_count()));
  return text;
}

}  // namespace

std::vector<Warning> brick_warnings(const GridSpec& spec) {
  const glm::dvec3 size = spec.voxel_size;
  const double height = static_cast<double>(kBrickUnits.y) / kBrickUnits.x;
  const glm::dvec3 brick = glm::dvec3(1, height, 1) * size.x;
  const glm::dvec3 off = glm::abs(size / brick - 1.0);
  if (std::max(off.y, off.z) <= kProportionRounding) return {};
  return {{"brick-proportions", "ldr: bricks are " + volume::vector_text({1, height, 1}, " x ") +
                                    ", voxels of this grid " + volume::vector_text(size, " x ") +
                                    ", so the model is stretched"}};
}

}  // namespace voxeld::ldraw

namespace voxeld {

Status encode_ldr(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  using namespace ldraw;
  if (const uint64_t voxels = grid.voxel_count(); voxels > kXyzPointsMax) {
    return Error{ErrorCode::kGridTooLarge, "ldr: too many voxels for bricks",
                 "at most " + std::to_string(kXyzPointsMax), std::to_string(voxels)};
  }
  const BrickColors colors(grid, options);
  std::vector<Slab> slabs = slabs_of(grid);
  VOXELD_TRY(file.append(volume::text_bytes(ldr_header(grid))));
  const size_t batch = ThreadPool::shared().threads();
  for (size_t begin = 0; begin < slabs.size(); begin += batch) {
    std::vector<std::string> texts(std::min(batch, slabs.size() - begin));
    ThreadPool::shared().for_each(texts.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      const auto number = static_cast<uint32_t>(begin + i);
      texts[i] = SlabLines(colors, slabs[number], number).write();
    });
    for (const std::string& text : texts) VOXELD_TRY(file.append(volume::text_bytes(text)));
  }
  return {};
}

}  // namespace voxeld
