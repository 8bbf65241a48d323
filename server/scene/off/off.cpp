#include "server/scene/off/off.h"

#include <algorithm>
#include <utility>

#include "proto/text/text_file.h"
#include "server/base/cancel_point.h"
#include "server/scene/core/color_space.h"
#include "server/scene/core/loaders.h"
#include "server/scene/core/mesh_error.h"
#include "server/scene/core/normals.h"
#include "server/scene/core/text_cursor.h"

namespace voxeld {
namespace {

// The largest fraction that still means 0..1, with room for an overexposed light.
constexpr float kUnitFractionMax = 1.5f;

void warn_dropped(Scene& scene, std::string_view name, const OffCount& dropped,
                  std::string_view code, std::string_view what, std::string_view outcome) {
  if (dropped.count == 0) return;
  add_warning(scene, code,
              std::string(name) + ": " + std::to_string(dropped.count) + " " + std::string(what) +
                  " (first: " + dropped.first + "); " + std::string(outcome));
}

}  // namespace

void OffColors::set(size_t first, size_t count, const OffColor& color) {
  if (color.kind == OffColor::kNone) return;
  float& max = color.kind == OffColor::kWhole ? whole_max_ : fraction_max_;
  for (int c = 0; c < (color.has_alpha ? 4 : 3); ++c) {
    max = std::max(max, color.rgba[c]);
    possible_ &= color.rgba[c] >= 0.0f && color.rgba[c] <= 255.0f;
  }
  colors_.resize(first);
  colors_.resize(first + count, color);
}

bool OffColors::drop_impossible() {
  if (possible_) return false;
  colors_.clear();
  return true;
}

std::vector<glm::vec4> OffColors::linear(size_t count) const {
  const float whole_scale = whole_max_ > 1.0f ? 255.0f : 1.0f;
  const float fraction_scale = fraction_max_ > kUnitFractionMax ? 255.0f : 1.0f;
  std::vector<glm::vec4> out;
  out.reserve(count);
  for (const OffColor& color : colors_) {
    cancel_point();
    if (color.kind == OffColor::kNone) {
      out.emplace_back(1.0f);
      continue;
    }
    const glm::vec4 srgb =
        color.rgba / (color.kind == OffColor::kWhole ? whole_scale : fraction_scale);
    out.emplace_back(linear_from_srgb(glm::vec3(srgb)),
                     color.has_alpha ? unit_clamped(srgb.w) : 1.0f);
  }
  out.resize(count, glm::vec4(1.0f));
  return out;
}

Status OffMesh::add_face(std::span<const uint32_t> corners, const OffColor& color) {
  if (corners.size() < 3) {
    ++skipped_face_count;
    return {};
  }
  const size_t first = part.indices.size() / 3;
  VOXELD_TRY(sink.add_face(corners, part));
  triangle_colors.set(first, part.indices.size() / 3 - first, color);
  return {};
}

Result<Scene> OffMesh::take_scene() {
  if (part.indices.empty()) return empty_mesh(name, "no faces");
  Scene scene;
  scene.format = "off";
  warn_skipped_faces(scene, name, skipped_face_count);
  if (mapped_color_count > 0) {
    add_warning(scene, "ignored-colors",
                std::string(name) + ": " + std::to_string(mapped_color_count) +
                    " faces with an index into a colour map; voxeld has none");
  }
  warn_dropped(scene, name, odd_vertex_columns, "ignored-columns",
               "vertices have columns that are no colour", "they were left out");
  warn_dropped(scene, name, odd_face_columns, "ignored-columns",
               "faces have columns that are no colour", "they were left out");
  warn_dropped(scene, name, bad_normals, "dropped-attribute", "normals are not finite",
               "those of triangles are used");
  warn_dropped(scene, name, bad_uvs, "dropped-attribute", "texture coordinates are not finite",
               "the file's were left out");
  warn_dropped(scene, name, bad_colors, "dropped-attribute", "colours are not finite",
               "they are taken as white");
  complete_normals(part.positions, part.indices, part.normals);
  if (bad_uvs.count > 0) part.uvs.clear();
  if (!vertex_colors.empty()) part.colors = vertex_colors.linear(part.positions.size());
  const bool by_face = part.colors.empty() && !triangle_colors.empty();
  scene.parts.push_back(
      by_face ? with_triangle_colors(part, triangle_colors.linear(part.indices.size() / 3))
              : std::move(part));
  return scene;
}

Status check_off_count(std::string_view name, const std::string& where, std::string_view what,
                       int64_t count, int64_t limit) {
  if (count < 0) {
    return malformed_mesh(name, where, "number of " + std::string(what), "a whole number from 0",
                          std::to_string(count));
  }
  if (count > limit) return over_limit(name, where, "too many " + std::string(what), limit, count);
  return {};
}

Error off_truncated(std::string_view name, const std::string& where, int64_t vertex_count,
                    int64_t face_count, int64_t needed_bytes, int64_t left_bytes) {
  return malformed_mesh(name, where,
                        "truncated: " + std::to_string(vertex_count) + " vertices and " +
                            std::to_string(face_count) + " faces declared",
                        "at least " + std::to_string(needed_bytes) + " bytes",
                        std::to_string(left_bytes) + " bytes left");
}

Result<OffPrefixes> off_prefixes(std::string_view name, int64_t line, std::string_view word) {
  const std::string_view keyword = word.substr(0, word.find("OFF") + 3);
  std::string_view left = keyword.substr(0, keyword.size() - 3);
  const auto accept = [&](std::string_view prefix) {
    if (!left.starts_with(prefix)) return false;
    left.remove_prefix(prefix.size());
    return true;
  };
  OffPrefixes prefixes;
  prefixes.uv = accept("ST");
  prefixes.color = accept("C");
  prefixes.normal = accept("N");
  if (left.empty()) return prefixes;
  if (left == "4" || left == "n" || left == "4n") {
    return Error{ErrorCode::kUnsupportedFeature,
                 std::string(name) + " line " + std::to_string(line) + ": " + std::string(keyword) +
                     ": points with other than 3 coordinates",
                 "OFF with the prefixes ST, C and N", std::string(keyword)};
  }
  return malformed_line(name, line, "wrong keyword", "OFF with the prefixes ST, C and N",
                        shown(word));
}

// "BINARY" follows the keyword on the same line.
Result<Scene> load_off(std::string_view name, std::span<const uint8_t> bytes) {
  TextCursor head(as_text(bytes), '#');
  const std::string_view keyword = head.token();
  const int64_t line = head.line();
  if (keyword.find("OFF") == keyword.npos || head.token_on_line() != "BINARY") {
    std::string storage;
    return load_off_text(name, plain_text(bytes, storage));
  }
  VOXELD_ASSIGN(const OffPrefixes prefixes, off_prefixes(name, line, keyword));
  const std::string_view rest = head.rest_of_line();
  if (!rest.empty()) {
    return malformed_line(name, line, "OFF BINARY", "the end of the line", shown(rest));
  }
  return load_off_binary(name, bytes, bytes.size() - head.bytes_left(), prefixes);
}

}  // namespace voxeld
