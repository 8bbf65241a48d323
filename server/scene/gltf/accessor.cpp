#include "server/scene/gltf/accessor.h"

#include <algorithm>
#include <cstring>
#include <utility>

#include "proto/limits.h"
#include "proto/range_text.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

enum ComponentType { kI8 = 5120, kU8 = 5121, kI16 = 5122, kU16 = 5123, kU32 = 5125, kF32 = 5126 };

// Bytes of a component type; 0 for an unknown one.
int bytes_of(int component_type) {
  switch (component_type) {
    case kI8:
    case kU8:
      return 1;
    case kI16:
    case kU16:
      return 2;
    case kU32:
    case kF32:
      return 4;
    default:
      return 0;
  }
}

template <typename T>
T load(const uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);  // elements need not be aligned
  return value;
}

uint32_t load_unsigned(const uint8_t* at, int bytes) {
  switch (bytes) {
    case 1:
      return *at;
    case 2:
      return load<uint16_t>(at);
    default:
      return load<uint32_t>(at);
  }
}

std::string path_of(int accessor) {
  return "accessors[" + std::to_string(accessor) + "]";
}

bool is_allowed(int type, GltfExpected::Types types) {
  switch (types) {
    case GltfExpected::kUnsigned:
      return type == kU8 || type == kU16 || type == kU32;
    case GltfExpected::kFloat:
      return type == kF32;
    case GltfExpected::kFloatOrSmall:
      return type == kF32 || type == kI8 || type == kU8 || type == kI16 || type == kU16;
  }
  return false;
}

std::string_view text_of(GltfExpected::Types types) {
  switch (types) {
    case GltfExpected::kUnsigned:
      return "5121, 5123 or 5125";
    case GltfExpected::kFloat:
      return "5126";
    case GltfExpected::kFloatOrSmall:
      return "5126, 5120, 5121, 5122 or 5123";
  }
  return {};
}

}  // namespace

bool GltfReader::is_float() const {
  return component_type_ == kF32;
}

// Scales integers: glTF 2.0, 3.6.2.2 and KHR_mesh_quantization.
double GltfReader::component(const uint8_t* element, int c, bool scaled) const {
  const uint8_t* at = element + std::ptrdiff_t{c} * component_bytes_;
  switch (component_type_) {
    case kF32:
      return load<float>(at);
    case kU8:
      return scaled ? *at / 255.0 : *at;
    case kI8: {
      const double value = load<int8_t>(at);
      return scaled ? std::max(value / 127.0, -1.0) : value;
    }
    case kU16:
      return scaled ? load<uint16_t>(at) / 65535.0 : load<uint16_t>(at);
    case kI16: {
      const double value = load<int16_t>(at);
      return scaled ? std::max(value / 32767.0, -1.0) : value;
    }
    default:
      return load<uint32_t>(at);
  }
}

glm::dvec4 GltfReader::vector(uint64_t i) const {
  glm::dvec4 out(0.0);
  const uint8_t* at = element(i);
  if (!at) return out;
  const int count = std::min(component_count_, 4);
  for (int c = 0; c < count; ++c) out[c] = component(at, c, normalized_);
  return out;
}

glm::dvec4 GltfReader::unit_vector(uint64_t i) const {
  glm::dvec4 out(0.0);
  const uint8_t* at = element(i);
  if (!at) return out;
  const int count = std::min(component_count_, 4);
  for (int c = 0; c < count; ++c) out[c] = component(at, c, true);
  return out;
}

uint32_t GltfReader::index(uint64_t i) const {
  const uint8_t* at = element(i);
  return at ? load_unsigned(at, component_bytes_) : 0;
}

glm::dmat4 GltfReader::matrix(uint64_t i) const {
  glm::dmat4 out(0.0);
  const uint8_t* at = element(i);
  if (!at) return out;
  for (int c = 0; c < 16; ++c) out[c / 4][c % 4] = component(at, c, false);
  return out;
}

Result<std::span<const uint8_t>> GltfAccessors::view_bytes(int view) {
  const GltfView& v = document_.views.at(static_cast<size_t>(view));
  VOXELD_ASSIGN(const auto buffer, buffers_.bytes(static_cast<size_t>(v.buffer)));
  if (v.offset_bytes > buffer.size() || v.length_bytes > buffer.size() - v.offset_bytes) {
    return malformed_mesh(
        name_, "bufferViews[" + std::to_string(view) + "]",
        "the range lies outside of buffers[" + std::to_string(v.buffer) + "]",
        "at most " + std::to_string(buffer.size()) + " bytes",
        std::to_string(v.length_bytes) + " bytes from byte " + std::to_string(v.offset_bytes));
  }
  return buffer.subspan(v.offset_bytes, v.length_bytes);
}

// The sums cannot wrap: `offset` is below 2^53 and `bytes` below 2^40.
Result<std::span<const uint8_t>> GltfAccessors::range(int view, uint64_t offset, uint64_t bytes,
                                                      const std::string& path) {
  VOXELD_ASSIGN(const std::span<const uint8_t> all, view_bytes(view));
  if (offset > all.size() || bytes > all.size() - offset) {
    return malformed_mesh(name_, path,
                          "the elements lie outside of bufferViews[" + std::to_string(view) + "]",
                          "at most " + std::to_string(all.size()) + " bytes",
                          std::to_string(bytes) + " bytes from byte " + std::to_string(offset));
  }
  return all.subspan(offset, bytes);
}

Status GltfAccessors::check_type(const GltfAccessor& accessor, const std::string& path,
                                 const GltfExpected& expected) const {
  const std::string what = std::string(expected.use);
  if (accessor.component_count < expected.components_min ||
      accessor.component_count > expected.components_max) {
    std::string wanted = std::to_string(expected.components_min);
    if (expected.components_max != expected.components_min) {
      wanted += " or " + std::to_string(expected.components_max);
    }
    return malformed_mesh(name_, path + ".type", "components of " + what, wanted,
                          std::to_string(accessor.component_count));
  }
  if (!is_allowed(accessor.component_type, expected.types)) {
    return malformed_mesh(name_, path + ".componentType", "component type of " + what,
                          std::string(text_of(expected.types)),
                          std::to_string(accessor.component_type));
  }
  constexpr auto kCountMax = static_cast<uint64_t>(3 * limits::kTrianglesMax);
  if (accessor.count > kCountMax) {
    return malformed_mesh(name_, path + ".count", "elements of " + what,
                          "at most " + std::to_string(kCountMax), std::to_string(accessor.count));
  }
  // Keys and matrices have limits of their own.
  const bool is_geometry = expected.types != GltfExpected::kFloat;
  if (is_geometry && accessor.view < 0 && accessor.count > kGltfZeroElementsMax) {
    return malformed_mesh(name_, path + ".count", "elements of " + what + " without a bufferView",
                          "at most " + std::to_string(kGltfZeroElementsMax),
                          std::to_string(accessor.count));
  }
  return {};
}

Result<GltfReader> GltfAccessors::open(int index, const GltfExpected& expected) {
  const GltfAccessor& accessor = document_.accessors.at(static_cast<size_t>(index));
  const std::string path = path_of(index);
  VOXELD_TRY(check_type(accessor, path, expected));
  GltfReader reader;
  reader.count_ = accessor.count;
  reader.component_type_ = accessor.component_type;
  reader.component_bytes_ = bytes_of(accessor.component_type);
  reader.component_count_ = accessor.component_count;
  reader.normalized_ = accessor.normalized;
  const auto element_bytes = static_cast<uint64_t>(reader.component_bytes_) *
                             static_cast<uint64_t>(accessor.component_count);
  reader.stride_bytes_ = element_bytes;
  if (accessor.view >= 0 && accessor.count > 0) {
    const uint64_t stride = document_.views[static_cast<size_t>(accessor.view)].stride_bytes;
    if (stride != 0 && stride < element_bytes) {
      return malformed_mesh(name_, path, "byteStride is smaller than an element",
                            "at least " + std::to_string(element_bytes), std::to_string(stride));
    }
    if (stride != 0) reader.stride_bytes_ = stride;
    const uint64_t bytes = (accessor.count - 1) * reader.stride_bytes_ + element_bytes;
    VOXELD_ASSIGN(const auto elements, range(accessor.view, accessor.offset_bytes, bytes, path));
    reader.data_ = elements.data();
  }
  if (accessor.sparse) VOXELD_TRY(fill_sparse(index, path, reader));
  return reader;
}

// Copies the elements into a dense array and writes the sparse ones over it.
Status GltfAccessors::fill_sparse(int index, const std::string& path, GltfReader& reader) {
  const GltfSparse& sparse = *document_.accessors[static_cast<size_t>(index)].sparse;
  const auto element_bytes = static_cast<uint64_t>(reader.component_bytes_) *
                             static_cast<uint64_t>(reader.component_count_);
  auto found = filled_.find(index);
  if (found == filled_.end()) {
    const int index_bytes = bytes_of(sparse.index_type);
    if (!is_allowed(sparse.index_type, GltfExpected::kUnsigned)) {
      return malformed_mesh(name_, path + ".sparse.indices.componentType", "component type",
                            std::string(text_of(GltfExpected::kUnsigned)),
                            std::to_string(sparse.index_type));
    }
    if (sparse.count > reader.count_) {
      return malformed_mesh(name_, path + ".sparse.count", "more elements than the accessor has",
                            "at most " + std::to_string(reader.count_),
                            std::to_string(sparse.count));
    }
    const uint64_t bytes = reader.count_ * element_bytes;
    if (bytes > kGltfSparseBytesMax - filled_bytes_) {
      return malformed_mesh(name_, path + ".sparse", "bytes of all sparse accessors",
                            "at most " + std::to_string(kGltfSparseBytesMax), "more");
    }
    VOXELD_ASSIGN(const auto indices, range(sparse.index_view, sparse.index_offset_bytes,
                                            sparse.count * static_cast<uint64_t>(index_bytes),
                                            path + ".sparse.indices"));
    VOXELD_ASSIGN(const auto values, range(sparse.value_view, sparse.value_offset_bytes,
                                           sparse.count * element_bytes, path + ".sparse.values"));
    filled_bytes_ += bytes;
    std::vector<uint8_t> dense(bytes);
    for (uint64_t i = 0; i < reader.count_ && reader.data_; ++i) {
      std::copy_n(reader.element(i), element_bytes, dense.begin() + i * element_bytes);
    }
    for (uint64_t i = 0; i < sparse.count; ++i) {
      const uint32_t target = load_unsigned(indices.data() + i * index_bytes, index_bytes);
      if (target >= reader.count_) {
        return malformed_mesh(name_, path + ".sparse.indices", "index out of range",
                              index_text(reader.count_, "elements"), std::to_string(target));
      }
      std::copy_n(values.data() + i * element_bytes, element_bytes,
                  dense.begin() + target * element_bytes);
    }
    found = filled_.emplace(index, std::move(dense)).first;
  }
  reader.data_ = found->second.data();
  reader.stride_bytes_ = element_bytes;
  return {};
}

}  // namespace voxeld
