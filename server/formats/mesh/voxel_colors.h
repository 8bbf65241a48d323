// The colours of voxels in meshes.
#pragma once

#include <array>
#include <cstdint>
#include <optional>

#include "server/grid/grid.h"

namespace voxeld::mesh {

// sRGB R, G, B and linear A; R in the lowest byte.
using Rgba = uint32_t;

constexpr Rgba rgba(const std::array<uint8_t, 3>& color, uint8_t alpha = 255) {
  return color[0] | Rgba{color[1]} << 8 | Rgba{color[2]} << 16 | Rgba{alpha} << 24;
}
constexpr uint8_t byte_of(Rgba color, unsigned component) {
  return static_cast<uint8_t>(color >> (8 * component) & 0xff);
}

// The grid's own colours; a colour for each id if it has only ids; otherwise one for all voxels.
// Voxels of full nodes, and others inside of solids, have the mean colour.
class VoxelColors {
 public:
  explicit VoxelColors(const Grid& grid)
      : has_color_(grid.channels.color), ids_(coloring_ids(grid)), other_(rgba(mean_color(grid))) {}

  bool several() const { return has_color_ || ids_; }
  Rgba other() const { return other_; }  // of voxels without attributes
  // Whether a voxel has a colour or an id of its own, as those inside of solids have not.
  bool has_own(const SparseTile& tile, size_t voxel) const {
    if (voxel == kNoAttributes) return false;
    if (has_color_) return has_own_color(tile, voxel);
    return ids_ && id_samples(tile, *ids_)[voxel] != 0;
  }
  Rgba of(const SparseTile& tile, size_t voxel) const {
    if (voxel == kNoAttributes) return other_;
    if (has_color_) {
      if (!has_own_color(tile, voxel)) return other_;
      const uint8_t* color = &tile.color[4 * voxel];
      return rgba({color[0], color[1], color[2]}, color[3]);
    }
    return ids_ ? rgba(id_color(id_samples(tile, *ids_)[voxel])) : other_;
  }

 private:
  bool has_color_;
  std::optional<Channel> ids_;
  Rgba other_;
};

}  // namespace voxeld::mesh
