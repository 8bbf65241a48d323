// Entries of a palette that stand for the colours of a grid's voxels.
#pragma once

#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/color/rgb.h"
#include "server/grid/grid.h"

namespace voxeld {

struct VoxelEntries {
  std::vector<std::vector<uint8_t>> tiles;  // for each tile: of its voxels with attributes
  uint8_t other = 0;                        // of all other voxels, those of full nodes

  uint8_t of(size_t tile, size_t voxel) const {
    return voxel == kNoAttributes ? other : tiles[tile][voxel];
  }
};

// The key of a voxel with attributes that has no colour of its own: it gets the entry of the voxels
// of full nodes, and no dither reaches it.
inline constexpr uint32_t kNoColorKey = uint32_t{1} << 24;
// The key of a voxel's colour; the voxel is a number in the tile, or kNoAttributes. Thread-safe.
using KeyOfVoxel = std::function<uint32_t(const SparseTile& tile, size_t voxel)>;

// Chooses one of 1 to 256 colours for each voxel, by distance in OKLab; of equally near ones the
// first. The result depends only on the grid. With dither, so that the mean colour of neighbours
// stays, where mixtures of the palette can have it:
//   bayer  by a 4x4x4 pattern of thresholds. Each 4x4 square of cells across an axis has each of 16
//          thresholds once, and squares across z are Bayer's ("An optimum method for two-level
//          rendition of continuous-tone pictures", 1973). The voxel with threshold k takes the
//          k-th, by lightness, of 16 entries whose mean is about its colour. They are found one
//          after the other, each next to what the ones before it lack.
//   error  by error diffusion (Floyd and Steinberg, "An adaptive algorithm for spatial greyscale",
//          1976) in three dimensions: the error of a voxel goes to its later neighbours among the
//          voxels of its tile, z slowest: 4 parts across a face, 2 across an edge, 1 at a corner.
// Both take over an error of at most three times the distance of the voxel's own colour to the
// nearest entry, so that colours far away do not speckle a surface that is nearly right: of a
// mixture of two, the rarer entry has at least an eighth.
VoxelEntries choose_entries(const Grid& grid, std::span<const Rgb> colors, Dither dither,
                            const KeyOfVoxel& key_of);

// The same for one tile: the entries of its voxels with attributes; 0 for those without a colour.
std::vector<uint8_t> choose_tile_entries(const SparseTile& tile, std::span<const Rgb> colors,
                                         Dither dither, const KeyOfVoxel& key_of);

}  // namespace voxeld
