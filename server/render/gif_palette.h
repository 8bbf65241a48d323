// Reduces an image to the 256 colours of a GIF.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <vector>

namespace voxeld {

struct IndexedImage {
  std::vector<std::array<uint8_t, 3>> palette;  // 1 to 256 colours
  std::vector<uint8_t> indices;                 // one per pixel
};

// rgb: three bytes per pixel, row by row; at least one pixel. An image of at most 256 colours keeps
// them. Others get a palette by median cut (P. Heckbert, "Color image quantization for frame buffer
// display", SIGGRAPH 1982) of boxes with the largest squared error first, and are dithered by error
// diffusion (R. Floyd and L. Steinberg, 1976). Has cancellation points.
IndexedImage reduce_colors(std::span<const uint8_t> rgb, int width);

}  // namespace voxeld
