#include "server/scene/ply/body.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/ply/source.h"

namespace voxeld {
namespace {

// The role of a property of a vertex or face.
enum Role { kX, kY, kZ, kNx, kNy, kNz, kU, kV, kRed, kGreen, kBlue, kAlpha, kGrey, kRoleCount };
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
                                                        {"diffuse_alpha", kAlpha},
                                                        {"grey", kGrey},
                                                        {"gray", kGrey},
                                                        {"luminance", kGrey},
                                                        {"intensity", kGrey}};

bool is_floating(PlyType type) {
  return type == PlyType::kFloat32 || type == PlyType::kFloat64;
}

// The roles of one element's properties.
struct Roles {
  std::vector<int> of_property;
  std::array<bool, kRoleCount> given{};
  std::array<PlyType, kRoleCount> types{};

  explicit Roles(const PlyElement& element) {
    for (const PlyProperty& property : element.properties) {
      int role = kNoRole;
      for (const auto& [name, known] : kRoles) {
        // The intensity of a scan, in Stanford's files, is a float of any size, and no colour.
        if (name == "intensity" && is_floating(property.type)) continue;
        const bool named = !property.is_list && equals_ignoring_case(property.name, name);
        if (named && !given[known]) role = known;
      }
      of_property.push_back(role);
      if (role == kNoRole) continue;
      given[static_cast<size_t>(role)] = true;
      types[static_cast<size_t>(role)] = property.type;
    }
  }
  bool has(Role first, Role last) const {
    for (int role = first; role <= last; ++role) {
      if (!given[static_cast<size_t>(role)]) return false;
    }
    return true;
  }
  bool has_rgb() const { return has(kRed, kBlue); }
  bool has_colors() const { return has_rgb() || given[kGrey]; }
};

using Values = std::array<double, kRoleCount>;

// The colour as written.
glm::vec4 raw_color(const Values& values, const Roles& roles) {
  const auto number = [&](Role role) {
    const bool wrapped = roles.types[role] == PlyType::kInt8 && values[role] < 0.0;  // char 255
    return static_cast<float>(wrapped ? values[role] + 256.0 : values[role]);
  };
  const float alpha = number(kAlpha);
  if (!roles.has_rgb()) return {glm::vec3(number(kGrey)), alpha};
  return {number(kRed), number(kGreen), number(kBlue), alpha};
}

std::string printed(double value) {
  const bool whole = value == std::floor(value) && std::abs(value) < 1e15;
  return whole ? std::to_string(static_cast<int64_t>(value)) : std::to_string(value);
}

// The range of a file's colour components, all in sRGB as CGAL, MeshLab and CloudCompare take
// them. Bytes go to 255. Floats go to 1 or 255, and integers to 255 or what 16 bits hold; the
// largest value of the file tells which.
class ColorRange {
 public:
  ColorRange(PlyType type, float max) : max_(max) {
    constexpr float kUnitMax = 1.1f;  // rounding and interpolation exceed 1 a little
    const bool is_small = max <= (is_floating(type) ? kUnitMax : 255.0f);
    const float wide = type == PlyType::kInt16 ? 32767.0f : 65535.0f;
    if (is_floating(type)) {
      full_ = is_small ? 1.0f : 255.0f;
      other_ = is_small ? 255.0f : 1.0f;
    } else if (ply_type_bytes(type) > 1) {
      full_ = is_small ? 255.0f : wide;
      other_ = is_small ? wide : 255.0f;
    }
    // Wide integers are mostly written for 255, and 16 bits for all that they hold.
    is_guess_ = is_floating(type) || is_small == (ply_type_bytes(type) == 2);
    is_guess_ = is_guess_ && ply_type_bytes(type) > 1;
    for (size_t i = 0; i < of_byte_.size(); ++i) {
      of_byte_[i] = linear_from_srgb(static_cast<float>(i) * (1.0f / full_));
    }
  }
  float max() const { return max_; }
  float full() const { return full_; }
  float other() const { return other_; }  // the other reading
  bool is_guess() const { return is_guess_; }
  float linear(float value) const {
    const bool is_byte = value >= 0.0f && value <= 255.0f && value == std::floor(value);
    return is_byte ? of_byte_[static_cast<size_t>(value)] : linear_from_srgb(value / full_);
  }

 private:
  float max_, full_ = 255.0f, other_ = 255.0f;
  bool is_guess_ = false;
  std::array<float, 256> of_byte_{};  // of whole numbers
};

template <typename Source>
class PlyBodyReader {
 public:
  PlyBodyReader(std::string_view name, const PlyHeader& header, std::span<const uint8_t> bytes,
                Source source)
      : name_(name), header_(header), bytes_(bytes), source_(std::move(source)) {}

  Result<PlyMesh> read() {
    const PlyElement* vertices = header_.element("vertex");
    vertex_count_ = vertices == nullptr ? 0 : vertices->count;
    for (const PlyElement& element : header_.elements) {
      // Vertices are an error then: faces would name some that are not there.
      if (element.properties.empty() && element.name != "vertex") continue;
      element_ = &element;
      if (element.name == "vertex") {
        VOXELD_TRY(read_vertices());
      } else if (element.name == "face") {
        VOXELD_TRY(read_faces());
      } else if (element.name == "tristrips" || element.name == "trifans") {
        VOXELD_TRY(read_strips(element.name == "trifans"));
      } else {
        VOXELD_TRY(skip_element());
      }
    }
    append_strips();
    warn_of_rest();
    return std::move(mesh_);
  }

 private:
  // An error such as "<name> line 7: vertex 3: <what>".
  Error malformed(std::string_view what, std::string expected, std::string got) const {
    return malformed_mesh(name_, source_.where(),
                          element_->name + " " + std::to_string(index_) + ": " + std::string(what),
                          std::move(expected), std::move(got));
  }

  void warn(std::string_view code, const std::string& detail) {
    mesh_.warnings.push_back({std::string(code), std::string(name_) + ": " + detail});
  }

  // Line ends, blanks, NUL and ^Z behind the last element are no data.
  void warn_of_rest() {
    const std::string_view rest = as_text(bytes_.last(source_.bytes_left()));
    const char* const end = rest.data() + rest.size();
    const auto is_padding = [](char c) {
      return is_blank(c) || c == '\n' || c == '\0' || c == '\x1a';
    };
    if (skipped(rest.data(), end, is_padding) == end) return;
    warn("trailing-bytes",
         std::to_string(rest.size()) + " bytes after the last element were left out");
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
    if (roles.has(kNx, kNz)) mesh_.normals.reserve(element_->count);
    if (roles.has(kU, kV)) mesh_.uvs.reserve(element_->count);
    if (roles.has_colors()) mesh_.colors.reserve(element_->count);
    Values values{};
    for (index_ = 0; index_ < element_->count; ++index_) {
      cancel_point();
      for (size_t i = 0; i < element_->properties.size(); ++i) {
        VOXELD_TRY(read_property(i, roles, values));
      }
      VOXELD_TRY(add_vertex(values, roles));
    }
    if (bad_normal_count_ > 0) {
      warn("dropped-attribute", std::to_string(bad_normal_count_) +
                                    " normals are not finite (first: " + first_bad_normal_ +
                                    "); those of triangles are used");
    }
    decode_colors("vertex", roles, mesh_.colors);
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
    if (roles.has(kNx, kNz)) add_normal({values[kNx], values[kNy], values[kNz]});
    if (roles.has(kU, kV)) {
      const glm::vec2 uv(values[kU], values[kV]);
      const bool finite = std::isfinite(uv.x) && std::isfinite(uv.y);
      mesh_.uvs.push_back(finite ? uv : glm::vec2(0.0f));
    }
    if (roles.has_colors()) mesh_.colors.push_back(raw_color(values, roles));
    return {};
  }

  void add_normal(const glm::dvec3& n) {
    const bool finite = is_coordinate(n.x) && is_coordinate(n.y) && is_coordinate(n.z);
    mesh_.normals.push_back(finite ? glm::vec3(n) : glm::vec3(0.0f));
    if (!finite && bad_normal_count_++ == 0) first_bad_normal_ = source_.where();
  }

  // Turns what was written into linear light, by the largest value of the file.
  void decode_colors(std::string_view of, const Roles& roles, std::vector<glm::vec4>& colors) {
    if (colors.empty()) return;
    glm::vec4 max(0.0f);
    for (const glm::vec4& color : colors) {
      cancel_point();
      max = glm::max(max, color);  // without NaN
    }
    const ColorRange rgb(roles.types[roles.has_rgb() ? kRed : kGrey],
                         std::max({max.x, max.y, max.z}));
    const ColorRange alpha(roles.types[kAlpha], max.w);
    warn_of_range(of, "colours (sRGB)", rgb);
    // Some programs write an alpha that they never set.
    const bool has_alpha = roles.given[kAlpha] && max.w > 0.0f;
    mesh_.is_alpha_dropped = mesh_.is_alpha_dropped || has_alpha != roles.given[kAlpha];
    if (has_alpha && alpha.full() != rgb.full()) warn_of_range(of, "alpha", alpha);
    for (glm::vec4& color : colors) {
      cancel_point();
      const float a = has_alpha ? unit_clamped(color.w * (1.0f / alpha.full())) : 1.0f;
      color = {rgb.linear(color.x), rgb.linear(color.y), rgb.linear(color.z), a};
    }
  }

  void warn_of_range(std::string_view of, std::string_view what, const ColorRange& range) {
    if (!range.is_guess()) return;
    warn("color-range", "range of " + std::string(of) + " " + std::string(what) + ": 0 to " +
                            printed(range.full()) + ", not 0 to " + printed(range.other()) +
                            ", as the largest is " + printed(range.max()));
  }

  Result<size_t> indices_property() const {
    for (size_t i = 0; i < element_->properties.size(); ++i) {
      const PlyProperty& property = element_->properties[i];
      const bool named = property.name == "vertex_indices" || property.name == "vertex_index";
      if (property.is_list && named) return i;
    }
    return malformed_mesh(name_, "header", "element " + element_->name,
                          "a list property vertex_indices", "none");
  }

  Status read_faces() {
    const Roles roles(*element_);
    VOXELD_ASSIGN(const size_t indices_at, indices_property());
    mesh_.face_sizes.reserve(element_->count);
    mesh_.corners.reserve(element_->count * 3);
    if (roles.has_colors()) mesh_.face_colors.reserve(element_->count);
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
    decode_colors("face", roles, mesh_.face_colors);
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
      VOXELD_TRY(check_index(value));
      push_in_pieces(mesh_.corners, static_cast<uint32_t>(value));
    }
    return {};
  }

  Status check_index(double value) const {
    if (value >= 0.0 && value < static_cast<double>(vertex_count_) && value == std::floor(value)) {
      return {};
    }
    return malformed("vertex index out of range", index_range(vertex_count_, "vertices"),
                     printed(value));
  }

  Status read_strips(bool fans) {
    VOXELD_ASSIGN(const size_t indices_at, indices_property());
    for (index_ = 0; index_ < element_->count; ++index_) {
      for (size_t i = 0; i < element_->properties.size(); ++i) {
        const PlyProperty& property = element_->properties[i];
        VOXELD_TRY(i == indices_at ? read_strip(property, fans) : skip_property(property));
      }
    }
    return {};
  }

  // Reads a list of strips or fans, which are separated by -1 (in unsigned types: all bits set).
  Status read_strip(const PlyProperty& property, bool fans) {
    uint64_t length = 0;
    VOXELD_TRY(read_length(property, length));
    std::array<uint32_t, 3> corners{};
    uint64_t corner_count = 0;  // of the strip
    const auto end_strip = [&] {
      mesh_.skipped_face_count += corner_count == 1 || corner_count == 2 ? 1 : 0;
      corner_count = 0;
    };
    for (uint64_t i = 0; i < length; ++i) {
      cancel_point();
      double value = 0.0;
      VOXELD_TRY(read_number(property.type, property.name, value));
      if (is_separator(value, property.type)) {
        end_strip();
        continue;
      }
      VOXELD_TRY(check_index(value));
      corners[std::min<uint64_t>(corner_count, 2)] = static_cast<uint32_t>(value);
      if (++corner_count < 3) continue;
      // Every other triangle of a strip turns the other way.
      const bool turned = !fans && corner_count % 2 == 0;
      VOXELD_TRY(add_strip_triangle(corners[turned ? 1 : 0], corners[turned ? 0 : 1], corners[2]));
      if (!fans) corners[0] = corners[1];
      corners[1] = corners[2];
    }
    end_strip();
    return {};
  }

  bool is_separator(double value, PlyType type) const {
    if (value == -1.0) return true;
    const double all_bits = std::exp2(8.0 * static_cast<double>(ply_type_bytes(type))) - 1.0;
    return value == all_bits && value >= static_cast<double>(vertex_count_) && !is_floating(type);
  }

  // Strips repeat corners to go on elsewhere; such triangles have no area.
  Status add_strip_triangle(uint32_t a, uint32_t b, uint32_t c) {
    if (a == b || b == c || c == a) return {};
    for (const uint32_t corner : {a, b, c}) push_in_pieces(strip_corners_, corner);
    const auto count = static_cast<int64_t>(strip_corners_.size() / 3);
    if (count <= limits::kTrianglesMax) return {};
    return over_limit(name_, source_.where(), "too many triangles", limits::kTrianglesMax, count);
  }

  // Makes faces of the strips, without attributes.
  void append_strips() {
    reserve_in_pieces(mesh_.corners, mesh_.corners.size() + strip_corners_.size());
    for_each_in_pieces(std::span<const uint32_t>(strip_corners_),
                       [&](uint32_t corner) { mesh_.corners.push_back(corner); });
    const size_t count = mesh_.face_sizes.size() + strip_corners_.size() / 3;
    resize_in_pieces(mesh_.face_sizes, count, uint32_t{3});
    if (!mesh_.face_colors.empty()) resize_in_pieces(mesh_.face_colors, count, glm::vec4(1.0f));
    if (!mesh_.face_textures.empty()) resize_in_pieces(mesh_.face_textures, count);
    if (!mesh_.corner_uvs.empty()) resize_in_pieces(mesh_.corner_uvs, mesh_.corners.size());
  }

  Status read_face_property(size_t i, const Roles& roles, Values& values) {
    const PlyProperty& property = element_->properties[i];
    if (property.is_list && property.name == "texcoord") return read_texcoord(property);
    if (!property.is_list && property.name == "texnumber") {
      double value = 0.0;
      VOXELD_TRY(read_number(property.type, property.name, value));
      has_texture_ = true;
      texture_ = value >= 0.0 && value < 1e6 ? static_cast<int>(value) : 0;
      if (value < 0.0) texture_ = -1;
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
    push_in_pieces(mesh_.face_sizes, static_cast<uint32_t>(corner_count));
    if (roles.has_colors()) push_in_pieces(mesh_.face_colors, raw_color(values, roles));
    if (has_texture_) push_in_pieces(mesh_.face_textures, texture_);
    if (!has_texcoord_) return {};
    if (!texcoord_.empty() && texcoord_.size() != 2 * corner_count) {
      return malformed("texcoord", std::to_string(2 * corner_count) + " numbers",
                       std::to_string(texcoord_.size()));
    }
    texcoord_.resize(2 * corner_count, 0.0f);
    for (size_t i = 0; i < corner_count; ++i) {
      push_in_pieces(mesh_.corner_uvs, {texcoord_[2 * i], texcoord_[2 * i + 1]});
    }
    return {};
  }

  std::string_view name_;
  const PlyHeader& header_;
  std::span<const uint8_t> bytes_;  // of the file
  Source source_;
  const PlyElement* element_ = nullptr;  // being read
  uint64_t index_ = 0;                   // number of the element being read
  uint64_t vertex_count_ = 0;
  int64_t bad_normal_count_ = 0;
  std::string first_bad_normal_;
  std::vector<float> texcoord_;          // of the face being read
  std::vector<uint32_t> strip_corners_;  // three per triangle
  int texture_ = 0;
  bool has_texture_ = false, has_texcoord_ = false;
  PlyMesh mesh_;
};

}  // namespace

Result<PlyMesh> read_ply_body(std::string_view name, const PlyHeader& header,
                              std::span<const uint8_t> bytes) {
  if (header.encoding == PlyEncoding::kAscii) {
    PlyTextSource source(bytes.subspan(header.data_offset), header.data_line);
    return PlyBodyReader(name, header, bytes, source).read();
  }
  const bool little = header.encoding == PlyEncoding::kLittleEndian;
  const bool swapped = little != (std::endian::native == std::endian::little);
  PlyBinarySource source(bytes, header.data_offset, swapped);
  return PlyBodyReader(name, header, bytes, source).read();
}

}  // namespace voxeld
