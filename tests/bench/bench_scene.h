// The meshes that benchmarks run on: made ones, files, and files with their holes closed.
#pragma once

#include <cstdint>
#include <string>

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/load.h"

namespace voxeld::bench {

inline constexpr const char* kSceneHelp =
    "a mesh file, closed:FILE (its holes closed), wave:TRIANGLES or waves-LEVELS (made meshes)";

// `name`: a mesh file; "closed:FILE"; "wave:N", a sphere with waves of about N triangles in rows
// and columns, whose triangles at the poles are thin; "waves-N", the closed mesh of waves.h with
// 20 * 4^N triangles, N in 0..10; "waves", which is "waves-6". Errors: those of MappedFile and
// load_scene; invalid-option for numbers out of range.
Result<Scene> bench_scene(const std::string& name);

// Closes every hole of parts with consistent winding: each loop of open edges gets a fan around the
// mean of its corners. Attributes are dropped.
void close_holes(Scene& scene);

// Another order of triangles and of their corners (winding unchanged) within every part.
void shuffle_triangles(Scene& scene, uint32_t seed);

// Binary PLY of the positions, as floats, and triangles.
Status write_ply(const Scene& scene, const std::string& path);

}  // namespace voxeld::bench
