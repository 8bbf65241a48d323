// The mean colours of triangles that lie within one voxel. The texture is averaged over the
// triangle's own area and nothing else.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include <glm/vec2.hpp>
#include <glm/vec4.hpp>

#include "server/scene/core/scene.h"

namespace voxeld {

// Mean colours by triangle. They stay valid from one frame of a scene to the next, because they do
// not depend on the positions of vertices.
struct FlatColors {
  std::vector<std::array<uint16_t, 4>> linear16;
  std::vector<uint8_t> known;  // 0: not computed yet

  void resize(size_t triangles) {
    linear16.resize(triangles);
    known.resize(triangles);
  }
};

// The most taps along a side of a flat triangle. Up to this count taps are at most 2 texels apart;
// longer sides skip texels. The standard error of the mean is then an eighth of the texels'
// standard deviation.
inline constexpr int kFlatTapsMax = 8;

// A corner's colour in linear light, multiplied by its alpha, without the texture, in [0, 1].
struct FlatCorner {
  glm::dvec2 uv{0.0};
  glm::dvec4 color{1.0};
};

// The mean of colour times texture over the triangle, multiplied by alpha, as 16 bits per
// component. It samples the centroids of n^2 equal parts, bilinear at full resolution. `corners`
// may be in any order. texture: the material's image, or null.
std::array<uint16_t, 4> mean_color(std::array<FlatCorner, 3> corners, const Material* material,
                                   const Image* texture);

}  // namespace voxeld
