// Typed reads from the accessors of a glTF document. Opening an accessor checks every byte range in
// 64-bit arithmetic, so the reads need no checks.
#pragma once

#include <cstddef>
#include <cstdint>
#include <map>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <glm/mat4x4.hpp>
#include <glm/vec4.hpp>

#include "proto/result.h"
#include "server/scene/core/loaders.h"
#include "server/scene/gltf/container.h"
#include "server/scene/gltf/document.h"

namespace voxeld::gltf {

// Bytes of all buffers together, as read. More: malformed-mesh. Several buffers may name one file,
// so a limit on the upload alone would not bound this.
inline constexpr uint64_t kBufferBytesMax = uint64_t{8} << 30;
// Elements of an accessor of indices or attributes without a buffer view, which are all zero. More:
// malformed-mesh. Nothing in the file bounds their count, so a few bytes could claim all triangles
// that a scene may have.
inline constexpr uint64_t kZeroElementsMax = uint64_t{1} << 24;
// Bytes of all sparse accessors of one file after they are filled in. More: malformed-mesh.
inline constexpr uint64_t kSparseBytesMax = uint64_t{1} << 30;
// Bytes of all compressed buffer views and primitives of one file, decoded. More: malformed-mesh.
inline constexpr uint64_t kDecodedBytesMax = uint64_t{4} << 30;

enum class Scaling {
  kAsDeclared,  // integers of a normalized accessor are scaled to [-1, 1] or [0, 1]
  kAlways,      // all integers are scaled: for colours, weights and rotations
};

// Elements of one accessor. Valid for the lifetime of the Accessors that opened it.
struct Elements {
  uint64_t count = 0;
  int component_count = 0;

  // The first four components of element i < count; absent ones are 0.
  glm::dvec4 vector(uint64_t i, Scaling scaling = Scaling::kAsDeclared) const;
  // Element i < count of a SCALAR accessor of unsigned integers.
  uint32_t index(uint64_t i) const { return static_cast<uint32_t>(component(i, 0, false)); }
  // Element i < count of a MAT4 accessor of floats.
  glm::dmat4 matrix(uint64_t i) const;

  double component(uint64_t i, int c, bool is_scaled) const;

  const uint8_t* data = nullptr;  // null: all zeros
  uint64_t stride_bytes = 0;
  int component_type = 0;
  uint64_t component_bytes = 0, element_bytes = 0;
  bool is_normalized = false;
};

// The types that a caller accepts; any other is malformed-mesh.
struct Expected {
  std::string_view use;  // for errors: "POSITION"
  int components_min, components_max;
  enum Types { kUnsigned, kFloat, kFloatOrSmall } types;  // u8 u16 u32; f32; f32 i8 u8 i16 u16
};

// Accessors, buffer views and buffers. A buffer is read on first use: an unused one may have no
// data. One per load; the objects it refers to must outlive it.
class Accessors {
 public:
  // Warnings go to `scene`.
  Accessors(const Document& document, const Container& container, const Bundle& bundle,
            Scene& scene)
      : document_(document),
        container_(container),
        bundle_(bundle),
        scene_(scene),
        buffers_(document.buffers.size()) {}

  // Errors: malformed-mesh with the path, for a wrong type or a range outside its buffer;
  // unsupported-feature, naming the extension, if only an extension can read the data; the bundle's
  // own errors.
  Result<Elements> open(int accessor, const Expected& expected);
  // The bytes of a buffer view. Errors: as above.
  Result<std::span<const uint8_t>> view_bytes(int view);
  // Gives the accessors of a primitive that has `draco`, and that have no bytes of their own, those
  // of its stream; to be called before they are opened. `path`: of the primitive, for errors.
  // Errors: as above, and those of decode_draco().
  Status decode(const Primitive& primitive, const std::string& path);

 private:
  struct LoadedBuffer {
    bool is_loaded = false;
    std::vector<uint8_t> owned;  // empty for the BIN chunk
    std::span<const uint8_t> data;
  };
  Result<std::span<const uint8_t>> buffer_bytes(size_t index);
  Result<std::vector<uint8_t>> read_uri(const std::string& uri, const std::string& where) const;
  Status check(const Accessor& accessor, bool is_decoded, const std::string& path,
               const Expected& expected) const;
  Result<std::span<const uint8_t>> view_range(int view, uint64_t offset, uint64_t bytes,
                                              const std::string& path);
  Status fill_sparse(int accessor, const std::string& path, Elements& elements);
  Result<std::span<const uint8_t>> buffer_range(size_t buffer, uint64_t offset, uint64_t bytes,
                                                const std::string& path);
  Result<std::span<const uint8_t>> decoded_view(int view);
  Status count_decoded(uint64_t bytes, const std::string& path);

  const Document& document_;
  const Container& container_;
  const Bundle& bundle_;
  Scene& scene_;
  std::vector<LoadedBuffer> buffers_;
  uint64_t buffer_bytes_ = 0;
  std::map<int, std::vector<uint8_t>> filled_;  // sparse accessors
  uint64_t filled_bytes_ = 0;
  std::map<int, std::vector<uint8_t>> decoded_views_;
  struct DecodedAccessor {
    int view = -1;  // that it was decoded from
    int component_type = 0;
    std::vector<uint8_t> bytes;
  };
  std::map<int, DecodedAccessor> decoded_accessors_;
  uint64_t decoded_bytes_ = 0;
};

}  // namespace voxeld::gltf
