// Binary STL, little-endian:
//
//   byte 0    80  header: any text; may begin with "solid"; Materialise Magics: "COLOR=" and
//                 the bytes R, G, B, A of the object
//   byte 80    4  u32 triangle count n
//   byte 84  50n  per triangle: f32[3] normal, f32[3] x 3 vertices, u16 attribute
//
// Colour in the attribute, 5 bits each: VisCAM and SolidView: bit 15 set = this colour counts,
// 14..10 red, 9..5 green, 4..0 blue. Magics: bit 15 clear = this colour counts, set = the
// object's; 4..0 red, 9..5 green, 14..10 blue. Taken as sRGB.
//
// Some writers leave a wrong count. The size wins if it is that of whole triangles; those behind a
// count above 0 must then look like triangles, and not like rubbish. Any other file is not binary
// STL if it has a count above kTrianglesMax, or 84 bytes of text.
//
// Normals of the file are dropped: they follow from the vertices, and many writers leave zeros.
#include "server/scene/stl/stl.h"

#include <algorithm>
#include <bit>
#include <cmath>
#include <optional>

#include <glm/geometric.hpp>

#include "proto/limits.h"
#include "proto/text/text_file.h"
#include "server/base/cancel_point.h"
#include "server/base/pieces.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/text_cursor.h"
#include "server/scene/core/vertex_table.h"

namespace voxeld {
namespace {

constexpr size_t kBinaryHeaderBytes = 80;
constexpr size_t kFirstTriangle = 84;
constexpr size_t kTriangleBytes = 50;
constexpr size_t kAttributeOffset = 48;
constexpr size_t kTextHeadBytes = 512;  // even, as UTF-16 is

uint32_t read_u32(const uint8_t* at) {
  return uint32_t{at[0]} | uint32_t{at[1]} << 8 | uint32_t{at[2]} << 16 | uint32_t{at[3]} << 24;
}
uint32_t read_u16(const uint8_t* at) {
  return uint32_t{at[0]} | uint32_t{at[1]} << 8;
}

float read_f32(const uint8_t* at) {
  return std::bit_cast<float>(read_u32(at));
}

glm::vec4 color_of_bits(uint32_t red, uint32_t green, uint32_t blue) {
  const glm::vec3 srgb = glm::vec3(red & 31, green & 31, blue & 31) / 31.0f;
  return {linear_from_srgb(srgb), 1.0f};
}

// Decodes the attributes of one file.
class FacetColors {
 public:
  explicit FacetColors(std::span<const uint8_t> bytes, uint32_t triangle_count) {
    const std::string_view header = as_text(bytes.first(kBinaryHeaderBytes));
    const size_t magics = header.find("COLOR=");
    if (magics != header.npos && magics + 10 <= kBinaryHeaderBytes) {
      const uint8_t* rgba = bytes.data() + magics + 6;
      object_ = glm::vec4(linear_from_srgb(glm::vec3(rgba[0], rgba[1], rgba[2]) / 255.0f),
                          static_cast<float>(rgba[3]) / 255.0f);
      return;
    }
    for (uint32_t i = 0; i < triangle_count && !viscam_; ++i) {
      cancel_point();
      viscam_ = (read_u16(bytes.data() + kFirstTriangle + i * kTriangleBytes + kAttributeOffset) &
                 0x8000) != 0;
    }
  }
  bool any() const { return viscam_ || object_.has_value(); }
  glm::vec4 color(uint32_t attribute) const {
    const bool bit15 = (attribute & 0x8000) != 0;
    if (object_) {
      return bit15 ? *object_ : color_of_bits(attribute, attribute >> 5, attribute >> 10);
    }
    return bit15 ? stl_color(attribute) : glm::vec4(1.0f);
  }
  // Facets with equal keys have equal colours.
  uint32_t key(uint32_t attribute) const { return any() ? attribute : 0; }

 private:
  bool viscam_ = false;
  std::optional<glm::vec4> object_;  // Magics
};

Status add_facet(std::string_view name, uint32_t number, const uint8_t* facet,
                 const FacetColors& colors, VertexTable& table, MeshPart& part) {
  const uint32_t attribute = read_u16(facet + kAttributeOffset);
  for (size_t corner = 0; corner < 3; ++corner) {
    VertexTable::Key key{0, 0, 0, colors.key(attribute)};
    glm::dvec3 p;
    for (int axis = 0; axis < 3; ++axis) {
      const uint32_t bits = read_u32(facet + 12 + corner * 12 + static_cast<size_t>(axis) * 4);
      const float x = std::bit_cast<float>(bits);
      if (!is_coordinate(x)) {
        return malformed_mesh(name, "triangle " + std::to_string(number), "vertex coordinate",
                              "a finite number up to 1e30", std::to_string(x));
      }
      p[axis] = x;
      // -0 and 0 are the same position.
      key[static_cast<size_t>(axis)] = x == 0.0f ? 0 : bits;
    }
    const auto next = static_cast<uint32_t>(part.positions.size());
    const auto [index, is_new] = table.find_or_add(key, next);
    if (is_new) {
      push_in_pieces(part.positions, p);
      if (colors.any()) push_in_pieces(part.colors, colors.color(attribute));
    }
    part.indices.push_back(index);
  }
  return {};
}

bool is_text_byte(uint8_t byte) {
  return byte >= 0x20 || byte == '\t' || byte == '\n' || byte == '\r';
}

bool is_text_head(std::span<const uint8_t> bytes) {
  const std::span<const uint8_t> head = bytes.first(kFirstTriangle);
  return std::all_of(head.begin(), head.end(), is_text_byte);
}

Error neither(std::string_view name, std::span<const uint8_t> bytes) {
  constexpr size_t kShownBytes = 16;
  std::string got = "no bytes";
  if (!bytes.empty()) {
    got = std::to_string(bytes.size()) + " bytes that begin with " +
          shown(as_text(bytes).substr(0, kShownBytes));
  }
  return malformed_mesh(name, "", "neither text nor binary STL",
                        "\"solid\", or 80 bytes of header and the number of triangles",
                        std::move(got));
}

// Whether the normal is a unit vector, zero or not a number, and the corners are not one place.
bool looks_like_facet(const uint8_t* facet) {
  const auto vector = [&](size_t at) {
    return glm::vec3(read_f32(facet + at), read_f32(facet + at + 4), read_f32(facet + at + 8));
  };
  const float square = glm::dot(vector(0), vector(0));
  const bool has_normal = std::abs(square - 1.0f) < 0.1f || square == 0.0f || std::isnan(square);
  const glm::vec3 a = vector(12), b = vector(24), c = vector(36);
  return has_normal && (a != b || b != c);
}

// Whether all bytes from a triangle on, of those that the size holds, look like triangles.
bool are_facets(std::span<const uint8_t> bytes, size_t first) {
  const size_t held = (bytes.size() - kFirstTriangle) / kTriangleBytes;
  for (size_t i = first; i < held; ++i) {
    cancel_point();
    if (!looks_like_facet(bytes.data() + kFirstTriangle + i * kTriangleBytes)) return false;
  }
  return true;
}

// The number of triangles to read: the declared one, or that of the size if the count is wrong.
uint32_t true_count(std::span<const uint8_t> bytes, uint32_t declared) {
  const size_t body = bytes.size() - kFirstTriangle;
  const size_t held = body / kTriangleBytes;
  if (body % kTriangleBytes != 0 || held == 0 || held > limits::kTrianglesMax) return declared;
  const bool is_held = declared == 0 || are_facets(bytes, declared);
  return is_held ? static_cast<uint32_t>(held) : declared;
}

void warn_of_size(Scene& scene, std::string_view name, uint32_t declared, uint32_t count,
                  size_t rest) {
  if (declared != count) {
    add_warning(scene, "triangle-count",
                std::string(name) + ": the header declares " + std::to_string(declared) +
                    " triangles, the size is that of " + std::to_string(count) +
                    ", which were read");
  }
  if (rest > 0) {
    add_warning(scene, "trailing-bytes",
                std::string(name) + ": " + std::to_string(rest) + " bytes after the " +
                    std::to_string(count) + " triangles were left out");
  }
}

}  // namespace

glm::vec4 stl_color(uint32_t bits) {
  return color_of_bits(bits >> 10, bits >> 5, bits);
}

bool is_binary_stl(std::span<const uint8_t> bytes) {
  if (bytes.size() <= kFirstTriangle) return false;
  const uint64_t count = read_u32(bytes.data() + kBinaryHeaderBytes);
  return bytes.size() == kFirstTriangle + count * kTriangleBytes;
}

bool is_binary_stl_of_wrong_count(std::span<const uint8_t> bytes) {
  return bytes.size() > kFirstTriangle && (bytes.size() - kFirstTriangle) % kTriangleBytes == 0 &&
         !is_text_head(bytes) && are_facets(bytes, 0);
}

Result<Scene> load_stl_binary(std::string_view name, std::span<const uint8_t> bytes) {
  if (bytes.size() < kFirstTriangle) return neither(name, bytes);
  const uint32_t declared = read_u32(bytes.data() + kBinaryHeaderBytes);
  const bool is_text = is_text_head(bytes);
  const uint32_t count = is_text ? declared : true_count(bytes, declared);
  const uint64_t needed = kFirstTriangle + uint64_t{count} * kTriangleBytes;
  if (bytes.size() != needed && (is_text || count > limits::kTrianglesMax)) {
    return neither(name, bytes);
  }
  if (count > limits::kTrianglesMax) {
    return over_limit(name, "byte 80", "too many triangles", limits::kTrianglesMax, count);
  }
  if (bytes.size() < needed) {
    return malformed_mesh(name, "byte 80",
                          "truncated: " + std::to_string(count) + " triangles declared",
                          std::to_string(needed) + " bytes", std::to_string(bytes.size()));
  }
  if (count == 0) return empty_mesh(name, "no triangles");
  Scene scene;
  scene.format = "stl";
  warn_of_size(scene, name, declared, count, bytes.size() - needed);
  const FacetColors colors(bytes, count);
  MeshPart& part = scene.parts.emplace_back();
  part.indices.reserve(size_t{count} * 3);
  VertexTable table(count / 2);  // a closed mesh has half as many vertices as triangles
  for (uint32_t i = 0; i < count; ++i) {
    cancel_point();
    const uint8_t* facet = bytes.data() + kFirstTriangle + size_t{i} * kTriangleBytes;
    const Status added = add_facet(name, i, facet, colors, table, part);
    // With a count that is none, numbers that are none mean another kind of file.
    if (!added && declared > limits::kTrianglesMax) return neither(name, bytes);
    VOXELD_TRY(added);
  }
  return scene;
}

Result<Scene> load_stl(std::string_view name, std::span<const uint8_t> bytes) {
  if (is_binary_stl(bytes)) return load_stl_binary(name, bytes);
  // Text never contains NUL; a binary header of 80 bytes mostly does.
  std::string storage;
  const std::string_view head =
      plain_text(bytes.first(std::min(bytes.size(), kTextHeadBytes)), storage);
  const std::string_view word = TextCursor(head).token();
  const bool text = (equals_ignoring_case(word, "solid") || equals_ignoring_case(word, "facet")) &&
                    head.find('\0') == head.npos;
  if (!text) return load_stl_binary(name, bytes);
  std::string text_storage;
  return load_stl_ascii(name, plain_text(bytes, text_storage));
}

}  // namespace voxeld
