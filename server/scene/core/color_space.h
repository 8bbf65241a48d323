// Conversion from sRGB (IEC 61966-2-1) to linear light.
#pragma once

#include <cmath>

#include <glm/vec3.hpp>

namespace voxeld {

// Converts one component in [0, 1]. Values outside are clamped, NaN gives 0.
inline float linear_from_srgb(float c) {
  if (!(c > 0.0f)) return 0.0f;
  if (c >= 1.0f) return 1.0f;
  return c <= 0.04045f ? c / 12.92f : std::pow((c + 0.055f) / 1.055f, 2.4f);
}

inline glm::vec3 linear_from_srgb(const glm::vec3& c) {
  return {linear_from_srgb(c.x), linear_from_srgb(c.y), linear_from_srgb(c.z)};
}

// Clamps to [0, 1]; NaN gives 0.
inline float unit_clamped(float c) {
  return c > 0.0f ? (c < 1.0f ? c : 1.0f) : 0.0f;
}

}  // namespace voxeld
