// GLSL's types for C++, so that one struct declaration serves both. Parameter blocks use only
// 4-byte scalars and 16-byte vectors, each vector at a multiple of 16 bytes; then std140, std430
// and C++ agree, and static_asserts beside each struct say so.
#ifdef __cplusplus
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxeld::shared {
using uint = uint32_t;
struct alignas(16) vec4 {
  float x = 0, y = 0, z = 0, w = 0;
};
struct alignas(16) ivec4 {
  int32_t x = 0, y = 0, z = 0, w = 0;
};
struct alignas(16) uvec4 {
  uint32_t x = 0, y = 0, z = 0, w = 0;
};
// Columns, as GLSL keeps them.
struct alignas(16) mat4 {
  vec4 columns[4];
};
}  // namespace voxeld::shared

#define VOXELD_SHARED_BEGIN namespace voxeld::shared {
#define VOXELD_SHARED_END }
#define VOXELD_SHARED_CONST inline constexpr
#else
#define VOXELD_SHARED_BEGIN
#define VOXELD_SHARED_END
#define VOXELD_SHARED_CONST const
#endif
