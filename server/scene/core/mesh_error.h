// Errors and warnings about a mesh file. Each names the file, the place, the expected and the
// actual text.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>

#include "proto/result.h"
#include "server/scene/core/scene.h"

namespace voxeld {

// The largest magnitude of a coordinate, in world units. More: malformed-mesh. Sums and products of
// three such numbers stay far below the end of double's range.
inline constexpr double kCoordinateAbsMax = 1e30;

// Warnings of one scene; the last one says that more were omitted. The limit keeps a hostile file
// from filling a response with them.
inline constexpr size_t kSceneWarningsMax = 100;

// Parts that arise only from names (groups of an OBJ, solids of an STL). Further ones are merged
// into an existing part, so a file of many tiny groups costs no more than its triangles.
inline constexpr size_t kScenePartsMax = 65'536;
// Bytes of a part's name, which many parts may share. The rest is cut off.
inline constexpr size_t kPartNameBytesMax = 1024;

// Whether x is a valid coordinate: no NaN, no infinity, no magnitude above kCoordinateAbsMax.
inline bool is_coordinate(double x) {
  return x >= -kCoordinateAbsMax && x <= kCoordinateAbsMax;
}

// malformed-mesh with the detail "<name> <where>: <what>"; `where` is "line 12", "byte 84", or
// empty.
Error malformed_mesh(std::string_view name, std::string_view where, std::string_view what,
                     std::string expected = {}, std::string got = {});
// The same error, for a place in a text file.
Error malformed_line(std::string_view name, int64_t line, std::string_view what,
                     std::string expected = {}, std::string got = {});
// malformed-mesh for a count above a limit of limits.h: "at most 5", got "6".
Error over_limit(std::string_view name, std::string_view where, std::string_view what,
                 int64_t limit, int64_t got);
// The valid indices into `count` things, for an error: "0..3", "0", or "none, as there are no
// vertices".
std::string index_range(int64_t count, std::string_view things);
Error empty_mesh(std::string_view name, std::string_view why);

// Text of a file for an error message: in quotes, cut after 40 bytes, with \xNN for anything but
// printable ASCII. An empty text becomes "the end of the file".
std::string shown(std::string_view text);

// Appends to scene.warnings, up to kSceneWarningsMax.
void add_warning(Scene& scene, std::string_view code, std::string detail);
// Adds "skipped-faces" for `count` faces with fewer than 3 corners; nothing for 0.
void warn_skipped_faces(Scene& scene, std::string_view name, int64_t count);

}  // namespace voxeld
