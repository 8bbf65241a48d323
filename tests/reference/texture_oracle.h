// A texture at a point, in double precision and at full resolution: what the voxelizer's levels
// are held against. Bilinear between the four nearest texels, in linear light.
#pragma once

#include <array>
#include <cstdint>
#include <span>

namespace voxeld::reference {

enum class Edge { kRepeat, kClamp, kMirror };

struct Texture {
  int width = 0, height = 0;
  std::span<const uint8_t> rgba;  // sRGB and linear alpha, row 0 on top
  Edge edge_u = Edge::kRepeat, edge_v = Edge::kRepeat;
};

// u and v. (0,0) is the top left corner of the first texel, (1,1) the lower right one of the last.
using TexturePoint = std::array<double, 2>;

// Linear light multiplied by alpha, and alpha, at a point of a triangle by its corners' shares. A
// triangle within one repetition of a texture sees no other.
std::array<double, 4> texture_color(const Texture& texture,
                                    const std::array<TexturePoint, 3>& corners,
                                    const std::array<double, 3>& shares);

}  // namespace voxeld::reference
