// OFF BINARY, as Geomview writes it. Behind the line of the keyword, all big-endian:
//
//   i32 vertices, i32 faces, i32 edges (never used)
//   per vertex: f32[3] position; with N f32[3] normal; with C f32[4] colour; with ST f32[2]
//   per face:   i32 n, i32[n] vertices, i32 c, f32[c] colour; c: 0, 3 or 4; 1: index of a map
//
// Nothing may follow the last face.
#include <array>
#include <bit>
#include <cmath>
#include <utility>

#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/off/off.h"

namespace voxeld {
namespace {

constexpr int64_t kWordBytes = 4;
constexpr int64_t kBinaryFaceBytesMin = 2 * kWordBytes;

class OffBinaryReader {
 public:
  OffBinaryReader(std::string_view name, std::span<const uint8_t> bytes, size_t offset,
                  const OffPrefixes& prefixes)
      : name_(name), bytes_(bytes), at_(offset), prefixes_(prefixes), mesh_(name) {}

  Result<Scene> read() {
    VOXELD_TRY(read_header());
    VOXELD_TRY(read_vertices());
    for (int64_t i = 0; i < face_count_; ++i) VOXELD_TRY(read_face(i));
    if (at_ < bytes_.size()) {
      return malformed("bytes after the last face", "the end of the file",
                       std::to_string(bytes_.size() - at_) + " more");
    }
    return mesh_.take_scene();
  }

 private:
  Error malformed(std::string_view what, std::string expected, std::string got) const {
    return malformed_mesh(name_, where(at_), what, std::move(expected), std::move(got));
  }
  static std::string where(size_t offset) { return "byte " + std::to_string(offset); }

  int64_t left() const { return static_cast<int64_t>(bytes_.size() - at_); }

  Status need(int64_t words, const std::string& what) const {
    if (left() >= words * kWordBytes) return {};
    return malformed("truncated: " + what, std::to_string(words * kWordBytes) + " bytes",
                     std::to_string(left()) + " bytes left");
  }

  // The caller has checked that the bytes are there.
  uint32_t take_word() {
    const uint8_t* b = bytes_.data() + at_;
    at_ += kWordBytes;
    return uint32_t{b[0]} << 24 | uint32_t{b[1]} << 16 | uint32_t{b[2]} << 8 | uint32_t{b[3]};
  }
  int32_t take_integer() { return static_cast<int32_t>(take_word()); }
  float take_float() { return std::bit_cast<float>(take_word()); }

  // Returns false if a number is not finite.
  bool take_floats(std::span<float> values) {
    bool finite = true;
    for (float& value : values) {
      value = take_float();
      finite = finite && is_coordinate(value);
    }
    return finite;
  }

  Status read_header() {
    VOXELD_TRY(need(3, "the counts"));
    const std::string vertices_at = where(at_);
    vertex_count_ = take_integer();
    const std::string faces_at = where(at_);
    face_count_ = take_integer();
    take_integer();
    VOXELD_TRY(
        check_off_count(name_, vertices_at, "vertices", vertex_count_, limits::kVerticesMax));
    VOXELD_TRY(check_off_count(name_, faces_at, "faces", face_count_, limits::kTrianglesMax));
    const int64_t vertex_bytes = kWordBytes * (3 + (prefixes_.normal ? 3 : 0) +
                                               (prefixes_.color ? 4 : 0) + (prefixes_.uv ? 2 : 0));
    const int64_t needed = vertex_bytes * vertex_count_ + kBinaryFaceBytesMin * face_count_;
    if (needed > left()) {
      return off_truncated(name_, where(at_), vertex_count_, face_count_, needed, left());
    }
    return {};
  }

  // The header check has ensured that all vertices are there.
  Status read_vertices() {
    mesh_.part.positions.reserve(static_cast<size_t>(vertex_count_));
    for (int64_t i = 0; i < vertex_count_; ++i) {
      cancel_point();
      glm::dvec3 position;
      for (int axis = 0; axis < 3; ++axis) {
        position[axis] = take_float();
        if (is_coordinate(position[axis])) continue;
        at_ -= kWordBytes;
        return malformed("vertex " + std::to_string(i), "a finite number up to 1e30",
                         std::to_string(position[axis]));
      }
      mesh_.part.positions.push_back(position);
      read_attributes(i);
    }
    return {};
  }

  void read_attributes(int64_t vertex) {
    const size_t begin = at_;
    if (prefixes_.normal) {
      std::array<float, 3> n{};
      if (!take_floats(n)) mesh_.bad_normals.add(where(begin));
      mesh_.part.normals.emplace_back(n[0], n[1], n[2]);
    }
    if (prefixes_.color) {
      mesh_.vertex_colors.set(static_cast<size_t>(vertex), 1, take_color(4));
    }
    if (prefixes_.uv) {
      std::array<float, 2> uv{};
      if (!take_floats(uv)) mesh_.bad_uvs.add(where(begin));
      mesh_.part.uvs.emplace_back(uv[0], 1.0f - uv[1]);
    }
  }

  OffColor take_color(size_t size) {
    const size_t begin = at_;
    std::array<float, 4> c{};
    if (!take_floats(std::span(c).first(size))) {
      mesh_.bad_colors.add(where(begin));
      return {};
    }
    return {{c[0], c[1], c[2], c[3]}, OffColor::kFraction, size == 4};
  }

  Status read_face(int64_t number) {
    const std::string face = "face " + std::to_string(number);
    VOXELD_TRY(need(1, face));
    const int64_t size = take_integer();
    if (size < 0 || size > limits::kPolygonCornersMax) {
      at_ -= kWordBytes;
      return malformed(face + ": number of corners",
                       "0 to " + std::to_string(limits::kPolygonCornersMax), std::to_string(size));
    }
    VOXELD_TRY(need(size + 1, face));
    corners_.clear();
    for (int64_t k = 0; k < size; ++k) {
      const int32_t index = take_integer();
      if (index < 0 || index >= vertex_count_) {
        at_ -= kWordBytes;
        return malformed(face + ": vertex index out of range",
                         index_range(vertex_count_, "vertices"), std::to_string(index));
      }
      corners_.push_back(static_cast<uint32_t>(index));
    }
    const int32_t color_size = take_integer();
    if (color_size < 0 || color_size > static_cast<int32_t>(kOffColorComponentsMax)) {
      at_ -= kWordBytes;
      return malformed(face + ": number of colour components", "0 to 4",
                       std::to_string(color_size));
    }
    VOXELD_TRY(need(color_size, face));
    return mesh_.add_face(corners_, read_face_color(static_cast<size_t>(color_size)));
  }

  OffColor read_face_color(size_t size) {
    if (size == 3 || size == 4) return take_color(size);
    if (size == 1) ++mesh_.mapped_color_count;
    if (size == 2) mesh_.odd_face_columns.add(where(at_));
    at_ += size * kWordBytes;
    return {};
  }

  std::string_view name_;
  std::span<const uint8_t> bytes_;
  size_t at_;
  OffPrefixes prefixes_;
  OffMesh mesh_;
  int64_t vertex_count_ = 0, face_count_ = 0;
  std::vector<uint32_t> corners_;
};

}  // namespace

Result<Scene> load_off_binary(std::string_view name, std::span<const uint8_t> bytes,
                              size_t data_offset, const OffPrefixes& prefixes) {
  return OffBinaryReader(name, bytes, data_offset, prefixes).read();
}

}  // namespace voxeld
