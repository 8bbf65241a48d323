#include "server/scene/gltf/compression/draco.h"

#include <draco/compression/decode.h>
#include <draco/compression/point_cloud/point_cloud_decoder.h>
#include <draco/core/varint_decoding.h>
#include <draco/metadata/metadata_decoder.h>

#include <algorithm>
#include <utility>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld::gltf {
namespace {

struct Counts {
  uint32_t triangles = 0;
  uint32_t points = 0;  // with edgebreaker, points that share a corner of the mesh count once
  bool are_points_exact = false;
};

// Steps over the header and the metadata, and reads the counts that the connectivity begins with
// (Draco bitstream specification 2.2, Decode, Metadata and Connectivity sections).
Result<Counts> declared_counts(const Document& document, const std::string& path,
                               std::span<const uint8_t> data) {
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  draco::DracoHeader header{};
  if (!draco::PointCloudDecoder::DecodeHeader(&buffer, &header).ok()) {
    return document.malformed(path, "the data is no Draco stream");
  }
  if (header.version_major != 2 || header.version_minor != 2) {
    Error error = document.malformed(
        path, "version of the Draco bitstream", "2.2",
        std::to_string(header.version_major) + "." + std::to_string(header.version_minor));
    error.code = ErrorCode::kUnsupportedFeature;
    return error;
  }
  if (header.encoder_type != draco::TRIANGULAR_MESH) {
    return document.malformed(path, "geometry of the Draco stream", "a mesh", "a point cloud");
  }
  buffer.set_bitstream_version(uint16_t{DRACO_BITSTREAM_VERSION(2, 2)});
  bool is_read = true;
  if ((header.flags & METADATA_FLAG_MASK) != 0) {
    draco::GeometryMetadata metadata;
    is_read = draco::MetadataDecoder().DecodeGeometryMetadata(&buffer, &metadata);
  }
  Counts counts;
  if (header.encoder_method == draco::MESH_EDGEBREAKER_ENCODING) {
    uint8_t traversal = 0;
    is_read = is_read && buffer.Decode(&traversal) &&
              draco::DecodeVarint(&counts.points, &buffer) &&
              draco::DecodeVarint(&counts.triangles, &buffer);
  } else {
    counts.are_points_exact = true;
    is_read = is_read && draco::DecodeVarint(&counts.triangles, &buffer) &&
              draco::DecodeVarint(&counts.points, &buffer);
  }
  if (!is_read) return document.malformed(path, "the Draco stream is cut off");
  return counts;
}

Error count_error(const Document& document, const std::string& path, const char* what,
                  uint64_t expected, uint64_t got) {
  return document.malformed(path, std::string(what) + " of the Draco stream",
                            std::to_string(expected) + " as the accessors have",
                            std::to_string(got));
}

template <typename T>
bool copy_values(const draco::PointAttribute& from, uint64_t point_count, int component_count,
                 std::vector<uint8_t>& to) {
  const size_t element_bytes = sizeof(T) * static_cast<size_t>(component_count);
  resize_in_pieces(to, point_count * element_bytes);
  if (!from.is_mapping_identity() && from.indices_map_size() < point_count) return false;
  T element[4];  // components are at most 4: see decode_attribute()
  for (uint64_t i = 0; i < point_count; ++i) {
    cancel_point();
    const auto value = from.mapped_index(draco::PointIndex(static_cast<uint32_t>(i)));
    if (value.value() >= from.size()) return false;
    if (!from.ConvertValue<T>(value, static_cast<int8_t>(component_count), element)) return false;
    std::copy_n(reinterpret_cast<const uint8_t*>(element), element_bytes, &to[i * element_bytes]);
  }
  return true;
}

bool copy_values_of_type(const draco::PointAttribute& from, uint64_t point_count,
                         DracoAttribute& to) {
  const auto copy = [&]<typename T>(T) {
    return copy_values<T>(from, point_count, to.component_count, to.values);
  };
  switch (to.component_type) {
    case kI8:
      return copy(int8_t{});
    case kU8:
      return copy(uint8_t{});
    case kI16:
      return copy(int16_t{});
    case kU16:
      return copy(uint16_t{});
    case kU32:
      return copy(uint32_t{});
    default:
      return copy(float{});
  }
}

Status decode_attribute(const Document& document, const std::string& path, const draco::Mesh& from,
                        DracoAttribute& to) {
  const std::string where = path + ".attributes." + to.name;
  const draco::PointAttribute* const attribute = from.GetAttributeByUniqueId(to.id);
  if (attribute == nullptr) {
    return document.malformed(where, "the Draco stream has no such attribute",
                              std::to_string(from.num_attributes()) + " attributes",
                              std::to_string(to.id));
  }
  if (attribute->num_components() != to.component_count || to.component_count > 4) {
    return document.malformed(where, "components of the attribute",
                              std::to_string(to.component_count) + " as the accessor has",
                              std::to_string(attribute->num_components()));
  }
  if (copy_values_of_type(*attribute, from.num_points(), to)) return {};
  return document.malformed(where, "the attribute has values that its accessor cannot hold");
}

}  // namespace

Status decode_draco(const Document& document, const std::string& path,
                    std::span<const uint8_t> data, DracoMesh& mesh) {
  VOXELD_ASSIGN(const Counts declared, declared_counts(document, path, data));
  if (declared.triangles != mesh.triangle_count) {
    return count_error(document, path, "triangles", mesh.triangle_count, declared.triangles);
  }
  if (declared.are_points_exact ? declared.points != mesh.point_count
                                : declared.points > mesh.point_count) {
    return count_error(document, path, "points", mesh.point_count, declared.points);
  }
  draco::DecoderBuffer buffer;
  buffer.Init(reinterpret_cast<const char*>(data.data()), data.size());
  auto decoded = draco::Decoder().DecodeMeshFromBuffer(&buffer);
  if (!decoded.ok()) {
    return document.malformed(
        path, "the Draco stream is damaged: " + decoded.status().error_msg_string());
  }
  const draco::Mesh& from = *decoded.value();
  if (from.num_points() != mesh.point_count) {
    return count_error(document, path, "points", mesh.point_count, from.num_points());
  }
  if (from.num_faces() != mesh.triangle_count) {
    return count_error(document, path, "triangles", mesh.triangle_count, from.num_faces());
  }
  for (DracoAttribute& attribute : mesh.attributes) {
    cancel_point();
    VOXELD_TRY(decode_attribute(document, path, from, attribute));
  }
  mesh.indices.reserve(3 * mesh.triangle_count);
  for (uint32_t i = 0; i < from.num_faces(); ++i) {
    cancel_point();
    for (const draco::PointIndex& corner : from.face(draco::FaceIndex(i))) {
      mesh.indices.push_back(corner.value());
    }
  }
  return {};
}

}  // namespace voxeld::gltf
