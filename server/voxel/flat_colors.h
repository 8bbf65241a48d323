// The mean colour of a triangle, for triangles that lie within one voxel: their texture is
// averaged over their own area, and over nothing else.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include "server/scene/scene.h"

namespace voxeld {

// Mean colours by triangle, from one frame of a scene to the next: they do not depend on where the
// vertices are.
struct FlatColors {
  std::vector<std::array<uint16_t, 4>> linear16;
  std::vector<uint8_t> known;  // 0: not computed yet

  void resize(size_t triangles) {
    linear16.resize(triangles);
    known.resize(triangles);
  }
};

// Taps along a side of a flat triangle. More texels than 2 between two taps are not read: the
// standard error of the mean is then an eighth of the texels' standard deviation.
inline constexpr int kFlatTapsMax = 8;

// Linear light, not multiplied with the texture; taken within [0, 1].
struct FlatCorner {
  glm::dvec2 uv{0.0};
  glm::dvec4 color{1.0};
};

// The mean of colour times texture over the triangle, 16 bits: the centroids of n^2 equal parts,
// bilinear at full resolution. `corners` in any order. texture: the material's image, or null.
std::array<uint16_t, 4> mean_color(std::array<FlatCorner, 3> corners, const Material* material,
                                   const Image* texture);

}  // namespace voxeld
