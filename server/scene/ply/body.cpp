#include "server/scene/ply/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/ply/source.h"

namespace voxeld {
namespace {

// The role of a property of a vertex or face.
enum Role { kX, kY, kZ, kNx, kNy, kNz, kU, kV, kRed, kGreen, kBlue, kAlpha, kRoleCount };
constexpr int kNoRole = -1;

constexpr std::pair<std::string_view, Role> kRoles[] = {{"x", kX},
                                                        {"y", kY},
                                                        {"z", kZ},
                                                        {"nx", kNx},
                                                        {"ny", kNy},
                                                        {"nz", kNz},
                                                        {"s", kU},
                                                        {"t", kV},
                                                        {"u", kU},
                                                        {"v", kV},
                                                        {"texture_u", kU},
                                                        {"texture_v", kV},
                                                        {"red", kRed},
                                                        {"green", kGreen},
                                                        {"blue", kBlue},
                                                        {"alpha", kAlpha},
                                                        {"r", kRed},
                                                        {"g", kGreen},
                                                        {"b", kBlue},
                                                        {"a", kAlpha},
                                                        {"diffuse_red", kRed},
                                                        {"diffuse_green", kGreen},
                                                        {"diffuse_blue", kBlue},
                                                        {"diffuse_alpha", kAlpha}};

// The roles of one element's properties.
struct Roles {
  std::vector<int> of_property;
  std::array<bool, kRoleCount> given{};
  PlyType color_type = PlyType::kUint8;

  explicit Roles(const PlyElement& element) {
    for (const PlyProperty& property : element.properties) {
      int role = kNoRole;
      for (const auto& [name, known] : kRoles) {
        if (!property.is_list && property.name == name && !given[known]) role = known;
      }
      of_property.push_back(role);
      if (role == kNoRole) continue;
      given[static_cast<size_t>(role)] = true;
      if (role == kRed) color_type = property.type;
    }
  }
  bool has(Role first, Role last) const {
    for (int role = first; role <= last; ++role) {
      if (!given[static_cast<size_t>(role)]) return false;
    }
    return true;
  }
};

using Values = std::array<double, kRoleCount>;

float component_scale(PlyType type) {
  switch (type) {
    case PlyType::kFloat32:
    case PlyType::kFloat64:
      return 1.0f;
    case PlyType::kInt16:
      return 1.0f / 32767.0f;
    case PlyType::kUint16:
      return 1.0f / 65535.0f;
    default:
      return 1.0f / 255.0f;
  }
}

glm::vec4 color_of(const Values& values, const Roles& roles) {
  const float scale = component_scale(roles.color_type);
  const glm::vec3 rgb = glm::vec3(values[kRed], values[kGreen], values[kBlue]) * scale;
  const float alpha =
      roles.given[kAlpha] ? unit_clamped(static_cast<float>(values[kAlpha]) * scale) : 1.0f;
  const bool linear =
      roles.color_type == PlyType::kFloat32 || roles.color_type == PlyType::kFloat64;
  if (!linear) return {linear_from_srgb(rgb), alpha};
  return {unit_clamped(rgb.x), unit_clamped(rgb.y), unit_clamped(rgb.z), alpha};
}

template <typename Source>
class PlyBodyReader {
 public:
  PlyBodyReader(std::string_view name, const PlyHeader& header, Source source)
      : name_(name), header_(header), source_(std::move(source)) {}

  Result<PlyMesh> read() {
    const PlyElement* vertices = header_.element("vertex");
    vertex_count_ = vertices == nullptr ? 0 : vertices->count;
    for (const PlyElement& element : header_.elements) {
      if (element.properties.empty()) continue;
      element_ = &element;
      if (element.name == "vertex") {
        VOXELD_TRY(read_vertices());
      } else if (element.name == "face") {
        VOXELD_TRY(read_faces());
      } else {
        VOXELD_TRY(skip_element());
      }
    }
    return std::move(mesh_);
  }

 private:
  // An error such as "<name> line 7: vertex 3: <what>".
  Error malformed(std::string_view what, std::string expected, std::string got) const {
    return malformed_mesh(name_, source_.where(),
                          element_->name + " " + std::to_string(index_) + ": " + std::string(what),
                          std::move(expected), std::move(got));
  }

  Status read_number(PlyType type, std::string_view property, double& value) {
    const auto number = source_.number(type);
    if (!number) return malformed(property, "a number", source_.got());
    value = *number;
    return {};
  }

  Status read_length(const PlyProperty& property, uint64_t& length) {
    double value = 0.0;
    VOXELD_TRY(read_number(property.count_type, property.name, value));
    if (!(value >= 0.0) || value != std::floor(value)) {
      return malformed("length of " + property.name, "a whole number from 0",
                       std::to_string(value));
    }
    // Even text has a byte for each item, so larger lengths are refused before memory is allocated.
    if (value > static_cast<double>(source_.bytes_left())) {
      return malformed("length of " + property.name, "as many as the file holds",
                       std::to_string(static_cast<int64_t>(std::min(value, 1e18))));
    }
    length = static_cast<uint64_t>(value);
    return {};
  }

  Status skip_property(const PlyProperty& property) {
    uint64_t count = 1;
    if (property.is_list) VOXELD_TRY(read_length(property, count));
    if (!source_.skip(property.type, count)) {
      return malformed(property.name, "a number", "the end of the file");
    }
    return {};
  }

  Status skip_element() {
    for (index_ = 0; index_ < element_->count; ++index_) {
      cancel_point();
      for (const PlyProperty& property : element_->properties) {
        VOXELD_TRY(skip_property(property));
      }
    }
    return {};
  }

  Status read_vertices() {
    const Roles roles(*element_);
    if (!roles.has(kX, kZ)) {
      return malformed_mesh(name_, "header", "element vertex", "properties x, y and z",
                            "not all of them");
    }
    mesh_.positions.reserve(element_->count);
    Values values{};
    for (index_ = 0; index_ < element_->count; ++index_) {
      cancel_point();
      for (size_t i = 0; i < element_->properties.size(); ++i) {
        VOXELD_TRY(read_property(i, roles, values));
      }
      VOXELD_TRY(add_vertex(values, roles));
    }
    return {};
  }

  Status read_property(size_t i, const Roles& roles, Values& values) {
    const PlyProperty& property = element_->properties[i];
    const int role = roles.of_property[i];
    if (role == kNoRole) return skip_property(property);
    return read_number(property.type, property.name, values[static_cast<size_t>(role)]);
  }

  Status add_vertex(const Values& values, const Roles& roles) {
    for (const Role axis : {kX, kY, kZ}) {
      if (is_coordinate(values[axis])) continue;
      return malformed("coordinate " + std::string(1, "xyz"[axis]), "a finite number up to 1e30",
                       std::to_string(values[axis]));
    }
    mesh_.positions.emplace_back(values[kX], values[kY], values[kZ]);
    if (roles.has(kNx, kNz)) mesh_.normals.emplace_back(values[kNx], values[kNy], values[kNz]);
    if (roles.has(kU, kV)) {
      const glm::vec2 uv(values[kU], values[kV]);
      const bool finite = std::isfinite(uv.x) && std::isfinite(uv.y);
      mesh_.uvs.push_back(finite ? uv : glm::vec2(0.0f));
    }
    if (roles.has(kRed, kBlue)) mesh_.colors.push_back(color_of(values, roles));
    return {};
  }

  Status read_faces() {
    const Roles roles(*element_);
    size_t indices_at = SIZE_MAX;
    for (size_t i = 0; i < element_->properties.size(); ++i) {
      const PlyProperty& property = element_->properties[i];
      const bool named = property.name == "vertex_indices" || property.name == "vertex_index";
      if (property.is_list && named && indices_at == SIZE_MAX) indices_at = i;
    }
    if (indices_at == SIZE_MAX) {
      return malformed_mesh(name_, "header", "element face", "a list property vertex_indices",
                            "none");
    }
    mesh_.face_sizes.reserve(element_->count);
    mesh_.corners.reserve(element_->count * 3);
    Values values{};
    for (index_ = 0; index_ < element_->count; ++index_) {
      cancel_point();
      texcoord_.clear();
      texture_ = 0;
      const size_t first = mesh_.corners.size();
      for (size_t i = 0; i < element_->properties.size(); ++i) {
        VOXELD_TRY(i == indices_at ? read_indices(element_->properties[i])
                                   : read_face_property(i, roles, values));
      }
      VOXELD_TRY(add_face(first, roles, values));
    }
    return {};
  }

  Status read_indices(const PlyProperty& property) {
    uint64_t length = 0;
    VOXELD_TRY(read_length(property, length));
    if (length > limits::kPolygonCornersMax) {
      return malformed("too many corners", "at most " + std::to_string(limits::kPolygonCornersMax),
                       std::to_string(length));
    }
    for (uint64_t i = 0; i < length; ++i) {
      double value = 0.0;
      VOXELD_TRY(read_number(property.type, property.name, value));
      if (!(value >= 0.0 && value < static_cast<double>(vertex_count_)) ||
          value != std::floor(value)) {
        return malformed("vertex index out of range", index_range(vertex_count_, "vertices"),
                         printed(value));
      }
      mesh_.corners.push_back(static_cast<uint32_t>(value));
    }
    return {};
  }

  static std::string printed(double value) {
    const bool whole = value == std::floor(value) && std::abs(value) < 1e15;
    return whole ? std::to_string(static_cast<int64_t>(value)) : std::to_string(value);
  }

  Status read_face_property(size_t i, const Roles& roles, Values& values) {
    const PlyProperty& property = element_->properties[i];
    if (property.is_list && property.name == "texcoord") return read_texcoord(property);
    if (!property.is_list && property.name == "texnumber") {
      double value = 0.0;
      VOXELD_TRY(read_number(property.type, property.name, value));
      has_texture_ = true;
      texture_ = value >= 0.0 && value < 1e6 ? static_cast<int>(value) : 0;
      return {};
    }
    return read_property(i, roles, values);
  }

  Status read_texcoord(const PlyProperty& property) {
    uint64_t length = 0;
    VOXELD_TRY(read_length(property, length));
    has_texcoord_ = true;
    if (length > uint64_t{2} * limits::kPolygonCornersMax) {
      return malformed("texcoord", "two numbers for each corner", std::to_string(length));
    }
    for (uint64_t k = 0; k < length; ++k) {
      double value = 0.0;
      VOXELD_TRY(read_number(property.type, property.name, value));
      texcoord_.push_back(std::isfinite(value) ? static_cast<float>(value) : 0.0f);
    }
    return {};
  }

  Status add_face(size_t first, const Roles& roles, const Values& values) {
    const size_t corner_count = mesh_.corners.size() - first;
    if (corner_count < 3) {
      mesh_.corners.resize(first);
      ++mesh_.skipped_face_count;
      return {};
    }
    mesh_.face_sizes.push_back(static_cast<uint32_t>(corner_count));
    if (roles.has(kRed, kBlue)) mesh_.face_colors.push_back(color_of(values, roles));
    if (has_texture_) mesh_.face_textures.push_back(texture_);
    if (!has_texcoord_) return {};
    if (!texcoord_.empty() && texcoord_.size() != 2 * corner_count) {
      return malformed("texcoord", std::to_string(2 * corner_count) + " numbers",
                       std::to_string(texcoord_.size()));
    }
    texcoord_.resize(2 * corner_count, 0.0f);
    for (size_t i = 0; i < corner_count; ++i) {
      mesh_.corner_uvs.emplace_back(texcoord_[2 * i], texcoord_[2 * i + 1]);
    }
    return {};
  }

  std::string_view name_;
  const PlyHeader& header_;
  Source source_;
  const PlyElement* element_ = nullptr;  // being read
  uint64_t index_ = 0;                   // number of the element being read
  uint64_t vertex_count_ = 0;
  std::vector<float> texcoord_;  // of the face being read
  int texture_ = 0;
  bool has_texture_ = false, has_texcoord_ = false;
  PlyMesh mesh_;
};

}  // namespace

Result<PlyMesh> read_ply_body(std::string_view name, const PlyHeader& header,
                              std::span<const uint8_t> bytes) {
  if (header.encoding == PlyEncoding::kAscii) {
    PlyTextSource source(bytes.subspan(header.data_offset), header.data_line);
    return PlyBodyReader(name, header, source).read();
  }
  const bool little = header.encoding == PlyEncoding::kLittleEndian;
  const bool swapped = little != (std::endian::native == std::endian::little);
  PlyBinarySource source(bytes, header.data_offset, swapped);
  return PlyBodyReader(name, header, source).read();
}

}  // namespace voxeld
