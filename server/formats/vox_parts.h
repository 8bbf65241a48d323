// The parts that a .vox of one grid and one of a sequence share: chunks, models, palette, nodes.
#pragma once

#include <array>
#include <compare>
#include <cstdint>
#include <functional>
#include <map>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages/job.h"
#include "proto/result.h"
#include "server/formats/palette.h"
#include "server/grid/color/palette_entries.h"
#include "server/grid/grid.h"

namespace voxeld::vox {

inline constexpr int kModelSide = 256;
inline constexpr size_t kChunkBytesMax = 0x7fffffff;  // readers take lengths as signed

class Bytes {
 public:
  void u32(uint32_t value) {
    for (int i = 0; i < 4; ++i) bytes_.push_back(static_cast<uint8_t>(value >> (8 * i)));
  }
  void i32(int32_t value) { u32(static_cast<uint32_t>(value)); }
  void u8(uint8_t value) { bytes_.push_back(value); }
  void text(std::string_view value) {
    u32(static_cast<uint32_t>(value.size()));
    bytes_.insert(bytes_.end(), value.begin(), value.end());
  }
  void dict(const std::map<std::string, std::string>& entries) {
    u32(static_cast<uint32_t>(entries.size()));
    for (const auto& [key, value] : entries) {
      text(key);
      text(value);
    }
  }
  void raw(std::span<const uint8_t> bytes) {
    bytes_.insert(bytes_.end(), bytes.begin(), bytes.end());
  }
  void chunk(std::string_view id, const Bytes& content) {
    bytes_.insert(bytes_.end(), id.begin(), id.end());
    u32(static_cast<uint32_t>(content.bytes_.size()));
    u32(0);
    raw(content.bytes_);
  }
  std::vector<uint8_t>& bytes() { return bytes_; }
  size_t size() const { return bytes_.size(); }

 private:
  std::vector<uint8_t> bytes_;
};

// "outside-world" for more cells than MagicaVoxel's editor shows.
std::vector<Warning> scene_warnings(const GridSpec& spec);

using Dict = std::map<std::string, std::string>;

struct Voxel {
  uint8_t x, y, z, color;
};
// Cells that are one model: of one label, 0 if the grid has none, at a place among the models of
// the scene, z up.
struct Part {
  uint16_t label = 0;
  std::array<int, 3> place{};
  std::strong_ordering operator<=>(const Part&) const = default;  // NOLINT(modernize-use-nullptr)
};
using Models = std::map<Part, std::vector<Voxel>>;

// Chooses the colours of voxels, as keys of the palette.
class Colors {
 public:
  explicit Colors(const Grid& grid);

  // `voxel`: its number in the tile, or kNoAttributes.
  uint32_t of(const SparseTile& tile, size_t voxel) const;
  uint32_t other() const { return other_; }

 private:
  bool has_color_;
  std::optional<Channel> ids_;
  uint32_t other_;  // for voxels without a colour
};

// Adds the colours of the grid's voxels to `counts`.
void count_colors(const Grid& grid, const Colors& colors, ColorCounts& counts);
// The palette that the options name, in its order; else one of the counted colours.
Palette palette_of(ColorCounts counts, const Colors& colors, const OutputOptions& options);

// Size of the scene with z up.
std::array<int, 3> scene_size(const GridSpec& spec);
// The entry of each voxel: without dither that of its colour's cluster, or the nearest one of a
// named palette.
VoxelEntries entries_of(const Grid& grid, const Colors& colors, const Palette& palette,
                        Dither dither);
// The cells of each non-empty model.
Models models_of(const Grid& grid, const VoxelEntries& entries);

void add_file_header(Bytes& out, uint32_t version, uint32_t children_bytes);
// Writes the chunks SIZE and XYZI.
void add_model(Bytes& out, const Part& part, const std::vector<Voxel>& voxels,
               const std::array<int, 3>& scene);
// Writes the scene graph: node 0 with the grid's placement in its attributes, node 1 the group of
// all, for each label a group with its name, and for each part its transform and its shape, of
// which `add_shape` writes what follows the node's id. Nodes are numbered in the order of the file.
// `grid`: with channels, names and placement, its tiles do not matter. `parts` ascend.
void add_scene(Bytes& out, const Grid& grid, std::span<const Part> parts,
               const std::function<void(Bytes& shape, size_t part)>& add_shape);
void add_palette(Bytes& out, const Palette& palette);
// Errors: grid-too-large for more bytes than a .vox can have.
Status check_length(uint64_t bytes);

}  // namespace voxeld::vox
