#include "server/scene/core/mesh_error.h"

#include <utility>

#include "proto/text/hex.h"

namespace voxeld {

Error malformed_mesh(std::string_view name, std::string_view where, std::string_view what,
                     std::string expected, std::string got) {
  std::string detail(name);
  if (!where.empty()) detail.append(" ").append(where);
  detail.append(": ").append(what);
  return {ErrorCode::kMalformedMesh, std::move(detail), std::move(expected), std::move(got)};
}

Error malformed_line(std::string_view name, int64_t line, std::string_view what,
                     std::string expected, std::string got) {
  return malformed_mesh(name, "line " + std::to_string(line), what, std::move(expected),
                        std::move(got));
}

Error over_limit(std::string_view name, std::string_view where, std::string_view what,
                 int64_t limit, int64_t got) {
  return malformed_mesh(name, where, what, "at most " + std::to_string(limit), std::to_string(got));
}

std::string index_range(int64_t count, std::string_view things) {
  if (count == 0) return "none, as there are no " + std::string(things);
  return count == 1 ? "0" : "0.." + std::to_string(count - 1);
}

Error empty_mesh(std::string_view name, std::string_view why) {
  return {ErrorCode::kEmptyMesh, std::string(name) + ": the mesh is empty", "at least one triangle",
          std::string(why)};
}

std::string shown(std::string_view text) {
  constexpr size_t kShownBytes = 40;
  if (text.empty()) return "the end of the file";
  std::string out = "\"";
  for (const char c : text.substr(0, kShownBytes)) {
    const auto byte = static_cast<unsigned char>(c);
    if (byte >= 0x20 && byte < 0x7f) {
      out += c;
    } else {
      out += "\\x";
      append_hex(out, byte);
    }
  }
  if (text.size() > kShownBytes) out += "…";
  return out + "\"";
}

void add_warning(Scene& scene, std::string_view code, std::string detail) {
  if (scene.warnings.size() + 1 < kSceneWarningsMax) {
    scene.warnings.push_back({std::string(code), std::move(detail)});
  } else if (scene.warnings.size() < kSceneWarningsMax) {
    scene.warnings.push_back({"more-warnings", "further warnings are left out"});
  }
}

void warn_skipped_faces(Scene& scene, std::string_view name, int64_t count) {
  if (count == 0) return;
  add_warning(scene, "skipped-faces",
              std::string(name) + ": " + std::to_string(count) +
                  " faces with fewer than 3 corners were left out");
}

}  // namespace voxeld
