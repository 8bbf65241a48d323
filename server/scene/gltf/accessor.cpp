#include "server/scene/gltf/accessor.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "proto/limits.h"
#include "proto/number_text.h"
#include "server/scene/core/mesh_error.h"

namespace voxeld::gltf {
namespace {

enum ComponentType { kI8 = 5120, kU8 = 5121, kI16 = 5122, kU16 = 5123, kU32 = 5125, kF32 = 5126 };

// Bytes of a component type; 0 for an unknown one.
uint64_t bytes_of(int component_type) {
  if (component_type == kI8 || component_type == kU8) return 1;
  if (component_type == kI16 || component_type == kU16) return 2;
  return component_type == kU32 || component_type == kF32 ? 4 : 0;
}

bool is_allowed(int type, Expected::Types types) {
  if (types == Expected::kUnsigned) return type == kU8 || type == kU16 || type == kU32;
  return type == kF32 || (types == Expected::kFloatOrSmall && type >= kI8 && type <= kU16);
}

std::string text_of(Expected::Types types) {
  if (types == Expected::kUnsigned) return "5121, 5123 or 5125";
  return types == Expected::kFloat ? "5126" : "5126, 5120, 5121, 5122 or 5123";
}

template <typename T>
T load(const uint8_t* at) {
  T value;
  std::memcpy(&value, at, sizeof value);  // elements need not be aligned
  return value;
}

// Whether [offset, offset + bytes) lies in `size` bytes. No sum can wrap.
bool is_inside(uint64_t offset, uint64_t bytes, uint64_t size) {
  return offset <= size && bytes <= size - offset;
}

std::string from_byte(uint64_t bytes, uint64_t offset) {
  return std::to_string(bytes) + " bytes from byte " + std::to_string(offset);
}

}  // namespace

// Scales integers: glTF 2.0, 3.6.2.2 and KHR_mesh_quantization.
double Elements::component(uint64_t i, int c, bool is_scaled) const {
  if (data == nullptr) return 0.0;
  const uint8_t* at = data + i * stride_bytes + static_cast<uint64_t>(c) * component_bytes;
  const auto scaled = [&](double value, double largest) {
    return is_scaled ? std::max(value / largest, -1.0) : value;
  };
  switch (component_type) {
    case kI8:
      return scaled(load<int8_t>(at), 127.0);
    case kU8:
      return scaled(*at, 255.0);
    case kI16:
      return scaled(load<int16_t>(at), 32767.0);
    case kU16:
      return scaled(load<uint16_t>(at), 65535.0);
    case kF32:
      return load<float>(at);
    default:
      return load<uint32_t>(at);
  }
}

glm::dvec4 Elements::vector(uint64_t i, Scaling scaling) const {
  const bool is_scaled = is_normalized || scaling == Scaling::kAlways;
  glm::dvec4 out(0.0);
  for (int c = 0; c < std::min(component_count, 4); ++c) out[c] = component(i, c, is_scaled);
  return out;
}

glm::dmat4 Elements::matrix(uint64_t i) const {
  glm::dmat4 out(0.0);
  for (int c = 0; c < 16; ++c) out[c / 4][c % 4] = component(i, c, false);
  return out;
}

Result<std::vector<uint8_t>> Accessors::read_uri(const std::string& uri,
                                                 const std::string& where) const {
  std::optional<std::vector<uint8_t>> bytes;
  if (is_data_uri(uri)) {
    bytes = decode_data_uri(uri);
    if (!bytes) return document_.malformed(where, "broken data URI", "base64", shown(uri));
  } else {
    VOXELD_ASSIGN(bytes, bundle_.find(uri, document_.name));
  }
  if (bytes) return *std::move(bytes);
  return document_.malformed(where, "the buffer's file is not in the upload",
                             "a zip with the mesh and its files", shown(uri));
}

Result<std::span<const uint8_t>> Accessors::buffer_bytes(size_t index) {
  LoadedBuffer& loaded = buffers_[index];
  if (loaded.is_loaded) return loaded.data;
  const Buffer& buffer = document_.buffers[index];
  const std::string where = at_index("buffers", index);
  if (buffer.uri) {
    VOXELD_ASSIGN(loaded.owned, read_uri(*buffer.uri, where + ".uri"));
    loaded.data = loaded.owned;
    buffer_bytes_ += loaded.owned.size();
    if (buffer_bytes_ > kBufferBytesMax) {
      return over_limit(document_.name, where, "bytes of all buffers together", kBufferBytesMax,
                        static_cast<int64_t>(buffer_bytes_));
    }
  } else if (!buffer.compressed_by.empty()) {
    return unread_extension(document_.name, where, "the data is compressed", buffer.compressed_by);
  } else if (index != 0 || !container_.bin) {
    return document_.malformed(where + ".uri", "the buffer has no data",
                               container_.is_glb ? "a uri, or a BIN chunk for buffers[0]" : "a uri",
                               "nothing");
  } else {
    loaded.data = *container_.bin;
  }
  if (loaded.data.size() < buffer.length_bytes) {
    return document_.malformed(where, "the data is shorter than byteLength",
                               std::to_string(buffer.length_bytes) + " bytes",
                               std::to_string(loaded.data.size()) + " bytes");
  }
  loaded.data = loaded.data.first(buffer.length_bytes);
  loaded.is_loaded = true;
  return loaded.data;
}

Result<std::span<const uint8_t>> Accessors::view_bytes(int index) {
  const View& view = document_.views[index];
  VOXELD_ASSIGN(const auto buffer, buffer_bytes(view.buffer));
  if (is_inside(view.offset_bytes, view.length_bytes, buffer.size())) {
    return buffer.subspan(view.offset_bytes, view.length_bytes);
  }
  return document_.malformed(at_index("bufferViews", index),
                             "the range lies outside of " + at_index("buffers", view.buffer),
                             "at most " + std::to_string(buffer.size()) + " bytes",
                             from_byte(view.length_bytes, view.offset_bytes));
}

Result<std::span<const uint8_t>> Accessors::view_range(int view, uint64_t offset, uint64_t bytes,
                                                       const std::string& path) {
  VOXELD_ASSIGN(const auto all, view_bytes(view));
  if (is_inside(offset, bytes, all.size())) return all.subspan(offset, bytes);
  return document_.malformed(path, "the elements lie outside of " + at_index("bufferViews", view),
                             "at most " + std::to_string(all.size()) + " bytes",
                             from_byte(bytes, offset));
}

Status Accessors::check(const Accessor& accessor, const std::string& path,
                        const Expected& expected) const {
  const std::string use(expected.use);
  if (accessor.component_count < expected.components_min ||
      accessor.component_count > expected.components_max) {
    std::string wanted = std::to_string(expected.components_min);
    if (expected.components_max != expected.components_min) {
      wanted += " or " + std::to_string(expected.components_max);
    }
    return document_.malformed(path + ".type", "components of " + use, wanted,
                               std::to_string(accessor.component_count));
  }
  if (!is_allowed(accessor.component_type, expected.types)) {
    return document_.malformed(path + ".componentType", "component type of " + use,
                               text_of(expected.types), std::to_string(accessor.component_type));
  }
  const auto limit = [&](const std::string& what, uint64_t most) {
    if (accessor.count <= most) return Status();
    return Status(over_limit(document_.name, path + ".count", what, static_cast<int64_t>(most),
                             static_cast<int64_t>(accessor.count)));
  };
  VOXELD_TRY(limit("elements of " + use, 3 * uint64_t{limits::kTrianglesMax}));
  // Keys and matrices have limits of their own.
  if (expected.types == Expected::kFloat || accessor.view >= 0) return {};
  return limit("elements of " + use + " without a bufferView", kZeroElementsMax);
}

Result<Elements> Accessors::open(int index, const Expected& expected) {
  const Accessor& accessor = document_.accessors[index];
  const std::string path = at_index("accessors", index);
  VOXELD_TRY(check(accessor, path, expected));
  const uint64_t component_bytes = bytes_of(accessor.component_type);
  const uint64_t element_bytes = component_bytes * static_cast<uint64_t>(accessor.component_count);
  Elements elements{.count = accessor.count,
                    .component_count = accessor.component_count,
                    .stride_bytes = element_bytes,
                    .component_type = accessor.component_type,
                    .component_bytes = component_bytes,
                    .element_bytes = element_bytes,
                    .is_normalized = accessor.normalized};
  if (accessor.view >= 0 && accessor.count > 0) {
    const uint64_t stride = document_.views[accessor.view].stride_bytes;
    if (stride != 0 && stride < element_bytes) {
      return document_.malformed(path, "byteStride is smaller than an element",
                                 "at least " + std::to_string(element_bytes),
                                 std::to_string(stride));
    }
    if (stride != 0) elements.stride_bytes = stride;
    // Below 2^40: see the limits of check().
    const uint64_t bytes = (accessor.count - 1) * elements.stride_bytes + element_bytes;
    VOXELD_ASSIGN(const auto data, view_range(accessor.view, accessor.offset_bytes, bytes, path));
    elements.data = data.data();
  }
  if (accessor.sparse) VOXELD_TRY(fill_sparse(index, path, elements));
  return elements;
}

// Copies the elements into a dense array and writes the sparse ones over it.
Status Accessors::fill_sparse(int index, const std::string& path, Elements& elements) {
  const Sparse& sparse = *document_.accessors[index].sparse;
  const uint64_t element_bytes = elements.element_bytes;
  auto found = filled_.find(index);
  if (found == filled_.end()) {
    if (!is_allowed(sparse.index_type, Expected::kUnsigned)) {
      return document_.malformed(path + ".sparse.indices.componentType", "component type",
                                 text_of(Expected::kUnsigned), std::to_string(sparse.index_type));
    }
    if (sparse.count > elements.count) {
      return document_.malformed(path + ".sparse.count", "more elements than the accessor has",
                                 "at most " + std::to_string(elements.count),
                                 std::to_string(sparse.count));
    }
    const uint64_t bytes = elements.count * element_bytes;
    if (bytes > kSparseBytesMax - filled_bytes_) {
      return document_.malformed(path + ".sparse", "bytes of all sparse accessors",
                                 "at most " + std::to_string(kSparseBytesMax), "more");
    }
    const uint64_t index_bytes = bytes_of(sparse.index_type);
    VOXELD_ASSIGN(const auto places,
                  view_range(sparse.index_view, sparse.index_offset_bytes,
                             sparse.count * index_bytes, path + ".sparse.indices"));
    VOXELD_ASSIGN(const auto values,
                  view_range(sparse.value_view, sparse.value_offset_bytes,
                             sparse.count * element_bytes, path + ".sparse.values"));
    filled_bytes_ += bytes;
    std::vector<uint8_t> dense(bytes);
    for (uint64_t i = 0; i < elements.count && elements.data != nullptr; ++i) {
      std::memcpy(&dense[i * element_bytes], elements.data + i * elements.stride_bytes,
                  element_bytes);
    }
    const Elements indices{.count = sparse.count,
                           .data = places.data(),
                           .stride_bytes = index_bytes,
                           .component_type = sparse.index_type};
    for (uint64_t i = 0; i < sparse.count; ++i) {
      const uint32_t target = indices.index(i);
      if (target >= elements.count) {
        return document_.malformed(path + ".sparse.indices", "index out of range",
                                   index_text(elements.count, "elements"), std::to_string(target));
      }
      std::memcpy(&dense[target * element_bytes], &values[i * element_bytes], element_bytes);
    }
    found = filled_.emplace(index, std::move(dense)).first;
  }
  elements.data = found->second.data();
  elements.stride_bytes = element_bytes;
  return {};
}

}  // namespace voxeld::gltf
