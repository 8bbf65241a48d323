// Typed reads from the accessors of a glTF document. Opening an accessor checks every byte range in
// 64-bit arithmetic, so the reads need no checks.
#pragma once

#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

#include "proto/result.h"
#include "server/scene/gltf/buffers.h"
#include "server/scene/gltf/document.h"

namespace voxeld {

// Elements of an accessor of indices or attributes without a buffer view, which are all zero. More:
// malformed-mesh. Nothing in the file bounds their count, so a few bytes could claim all triangles
// that a scene may have.
inline constexpr uint64_t kGltfZeroElementsMax = uint64_t{1} << 24;
// Bytes of all sparse accessors of one file after they are filled in. More: malformed-mesh.
inline constexpr uint64_t kGltfSparseBytesMax = uint64_t{1} << 30;

// Reads elements of one accessor. Valid for the lifetime of the GltfAccessors that opened it.
class GltfReader {
 public:
  uint64_t count() const { return count_; }
  int component_count() const { return component_count_; }
  bool is_float() const;

  // The first four components of element i < count(); absent ones are 0. Integers of a normalized
  // accessor are scaled to [-1, 1] or [0, 1].
  glm::dvec4 vector(uint64_t i) const;
  // The same, but integers are always scaled: for colours and weights.
  glm::dvec4 unit_vector(uint64_t i) const;
  // Element i < count() of a SCALAR accessor of unsigned integers.
  uint32_t index(uint64_t i) const;
  // Element i < count() of a MAT4 accessor of floats.
  glm::dmat4 matrix(uint64_t i) const;

 private:
  friend class GltfAccessors;
  double component(const uint8_t* element, int c, bool scaled) const;
  const uint8_t* element(uint64_t i) const { return data_ ? data_ + i * stride_bytes_ : nullptr; }

  const uint8_t* data_ = nullptr;  // null: all zeros
  uint64_t stride_bytes_ = 0;
  uint64_t count_ = 0;
  int component_type_ = 0, component_bytes_ = 0, component_count_ = 0;
  bool normalized_ = false;
};

// The types that a caller accepts; any other is malformed-mesh.
struct GltfExpected {
  std::string_view use;  // for errors: "POSITION"
  int components_min, components_max;
  enum Types { kUnsigned, kFloat, kFloatOrSmall } types;  // u8 u16 u32; f32; f32 i8 u8 i16 u16
};

class GltfAccessors {
 public:
  GltfAccessors(std::string_view name, const GltfDocument& document, GltfBuffers& buffers)
      : name_(name), document_(document), buffers_(buffers) {}

  // Errors: malformed-mesh with the path, for a wrong type or a range outside its buffer.
  Result<GltfReader> open(int accessor, const GltfExpected& expected);
  // The bytes of a buffer view. Errors: malformed-mesh, and those of its buffer.
  Result<std::span<const uint8_t>> view_bytes(int view);

 private:
  Status check_type(const GltfAccessor& accessor, const std::string& path,
                    const GltfExpected& expected) const;
  Result<std::span<const uint8_t>> range(int view, uint64_t offset, uint64_t bytes,
                                         const std::string& path);
  Status fill_sparse(int accessor, const std::string& path, GltfReader& reader);

  std::string_view name_;
  const GltfDocument& document_;
  GltfBuffers& buffers_;
  std::map<int, std::vector<uint8_t>> filled_;  // sparse accessors
  uint64_t filled_bytes_ = 0;
};

}  // namespace voxeld
