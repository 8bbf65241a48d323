#include "server/scene/gltf/accessor.h"

#include <algorithm>
#include <cstring>
#include <optional>
#include <utility>

#include "proto/limits.h"
#include "proto/text/number_text.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/gltf/compression/draco.h"
#include "server/scene/gltf/compression/meshopt.h"

namespace voxeld::gltf {
namespace {

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
    warn_assumed_file(scene_, bundle_, uri, document_.name, document_.name);
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
  } else if (!buffer.fallback_of.empty()) {
    return document_.malformed(where, "only views with " + buffer.fallback_of + " have data here",
                               "a view with the extension", "a view without it");
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

Result<std::span<const uint8_t>> Accessors::buffer_range(size_t index, uint64_t offset,
                                                         uint64_t bytes, const std::string& path) {
  VOXELD_ASSIGN(const auto buffer, buffer_bytes(index));
  if (is_inside(offset, bytes, buffer.size())) return buffer.subspan(offset, bytes);
  return document_.malformed(path, "the range lies outside of " + at_index("buffers", index),
                             "at most " + std::to_string(buffer.size()) + " bytes",
                             from_byte(bytes, offset));
}

Status Accessors::count_decoded(uint64_t bytes, const std::string& path) {
  if (bytes <= kDecodedBytesMax - decoded_bytes_) {
    decoded_bytes_ += bytes;
    return {};
  }
  return document_.malformed(path, "bytes of all compressed data, decoded",
                             "at most " + std::to_string(kDecodedBytesMax), "more");
}

Result<std::span<const uint8_t>> Accessors::decoded_view(int index) {
  const auto found = decoded_views_.find(index);
  if (found != decoded_views_.end()) return std::span<const uint8_t>(found->second);
  const View& view = document_.views[index];
  const CompressedView& from = *view.compressed;
  const std::string path = at_index("bufferViews", index) + ".extensions." + from.extension;
  VOXELD_ASSIGN(const auto stream,
                buffer_range(from.buffer, from.offset_bytes, from.length_bytes, path));
  VOXELD_TRY(count_decoded(view.length_bytes, path));
  VOXELD_ASSIGN(auto bytes, decode_meshopt(document_, index, stream));
  return std::span<const uint8_t>(decoded_views_.emplace(index, std::move(bytes)).first->second);
}

Result<std::span<const uint8_t>> Accessors::view_bytes(int index) {
  const View& view = document_.views[index];
  if (view.compressed) return decoded_view(index);
  return buffer_range(view.buffer, view.offset_bytes, view.length_bytes,
                      at_index("bufferViews", index));
}

Status Accessors::decode(const Primitive& primitive, const std::string& path) {
  if (!primitive.draco) return {};
  const std::string where = path + ".extensions.KHR_draco_mesh_compression";
  const int view = primitive.draco->view;
  const auto is_wanted = [&](int accessor) {
    const Accessor& one = document_.accessors[accessor];
    if (one.view >= 0 || one.sparse) return false;
    const auto found = decoded_accessors_.find(accessor);
    return found == decoded_accessors_.end() || found->second.view != view;
  };
  DracoMesh mesh;
  std::vector<int> accessors;  // of mesh.attributes
  uint64_t decoded_bytes = 0;
  for (const auto& [name, accessor] : primitive.attributes) {
    const auto id = primitive.draco->ids.find(name);
    if (id == primitive.draco->ids.end() || !is_wanted(accessor)) continue;
    const Accessor& one = document_.accessors[accessor];
    mesh.attributes.push_back({.name = name,
                               .id = static_cast<uint32_t>(id->second),
                               .component_type = one.component_type,
                               .component_count = one.component_count});
    accessors.push_back(accessor);
    decoded_bytes +=
        one.count * bytes_of(one.component_type) * static_cast<uint64_t>(one.component_count);
  }
  const bool has_indices = primitive.indices >= 0 && is_wanted(primitive.indices);
  if (accessors.empty() && !has_indices) return {};
  const auto position = primitive.attributes.find("POSITION");
  if (primitive.indices < 0 || position == primitive.attributes.end()) {
    return document_.malformed(path, "a Draco stream stands for indices and POSITION", "both",
                               "one is missing");
  }
  constexpr int kTriangles = 4;
  if (primitive.mode != kTriangles) {
    Error error = document_.malformed(path + ".mode", "mode of a primitive with a Draco stream",
                                      "4 (triangles)", std::to_string(primitive.mode));
    error.code = ErrorCode::kUnsupportedFeature;
    return error;
  }
  const Accessor& indices = document_.accessors[primitive.indices];
  if (indices.component_count != 1 || !is_allowed(indices.component_type, Expected::kUnsigned)) {
    return document_.malformed(at_index("accessors", primitive.indices) + ".componentType",
                               "component type of indices", text_of(Expected::kUnsigned),
                               std::to_string(indices.component_type));
  }
  mesh.point_count = document_.accessors[position->second].count;
  mesh.triangle_count = indices.count / 3;
  if (mesh.triangle_count > uint64_t{limits::kTrianglesMax}) {
    return over_limit(document_.name, where, "triangles of the scene", limits::kTrianglesMax,
                      static_cast<int64_t>(mesh.triangle_count));
  }
  decoded_bytes += indices.count * sizeof(uint32_t);
  VOXELD_TRY(count_decoded(decoded_bytes, where));
  VOXELD_ASSIGN(const auto stream, view_bytes(view));
  VOXELD_TRY(decode_draco(document_, where, stream, mesh));
  for (size_t i = 0; i < accessors.size(); ++i) {
    DracoAttribute& attribute = mesh.attributes[i];
    decoded_accessors_[accessors[i]] = {view, attribute.component_type,
                                        std::move(attribute.values)};
  }
  if (has_indices) {
    auto bytes = copied_in_pieces(reinterpret_cast<const uint8_t*>(mesh.indices.data()),
                                  mesh.indices.size() * sizeof(uint32_t));
    decoded_accessors_[primitive.indices] = {view, kU32, std::move(bytes)};
  }
  return {};
}

Result<std::span<const uint8_t>> Accessors::view_range(int view, uint64_t offset, uint64_t bytes,
                                                       const std::string& path) {
  VOXELD_ASSIGN(const auto all, view_bytes(view));
  if (is_inside(offset, bytes, all.size())) return all.subspan(offset, bytes);
  return document_.malformed(path, "the elements lie outside of " + at_index("bufferViews", view),
                             "at most " + std::to_string(all.size()) + " bytes",
                             from_byte(bytes, offset));
}

Status Accessors::check(const Accessor& accessor, bool is_decoded, const std::string& path,
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
  if (expected.types == Expected::kFloat || accessor.view >= 0 || is_decoded) return {};
  return limit("elements of " + use + " without a bufferView", kZeroElementsMax);
}

Result<Elements> Accessors::open(int index, const Expected& expected) {
  const Accessor& accessor = document_.accessors[index];
  const std::string path = at_index("accessors", index);
  const auto decoded = decoded_accessors_.find(index);
  const bool is_decoded = decoded != decoded_accessors_.end();
  VOXELD_TRY(check(accessor, is_decoded, path, expected));
  const int component_type = is_decoded ? decoded->second.component_type : accessor.component_type;
  const uint64_t component_bytes = bytes_of(component_type);
  const uint64_t element_bytes = component_bytes * static_cast<uint64_t>(accessor.component_count);
  Elements elements{.count = accessor.count,
                    .component_count = accessor.component_count,
                    .stride_bytes = element_bytes,
                    .component_type = component_type,
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
  } else if (is_decoded) {
    const std::vector<uint8_t>& bytes = decoded->second.bytes;
    if (accessor.count > bytes.size() / element_bytes) {
      return document_.malformed(path + ".count", "elements of the Draco stream",
                                 std::to_string(bytes.size() / element_bytes),
                                 std::to_string(accessor.count));
    }
    elements.data = bytes.data();
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
    std::vector<uint8_t> dense;
    resize_in_pieces(dense, bytes);
    for (uint64_t i = 0; i < elements.count && elements.data != nullptr; ++i) {
      cancel_point();
      std::memcpy(&dense[i * element_bytes], elements.data + i * elements.stride_bytes,
                  element_bytes);
    }
    const Elements indices{.count = sparse.count,
                           .data = places.data(),
                           .stride_bytes = index_bytes,
                           .component_type = sparse.index_type};
    for (uint64_t i = 0; i < sparse.count; ++i) {
      cancel_point();
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
