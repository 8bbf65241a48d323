// What an asset holds, for GET /v1/assets/{id}.
#pragma once

#include <nlohmann/json_fwd.hpp>

#include "server/scene/scene.h"

namespace voxeld {

// {format, triangles, vertices, bounds {min, max}, has_colors, parts [{name, triangles, vertices,
// material}], materials [{name, base_color, texture, found}], missing_files [{name, needed_by}],
// watertight, open_edges, non_manifold_edges, flipped_edges, degenerate_triangles}. Edge counts are
// null for meshes above kTopologyTrianglesMax.
nlohmann::json describe_scene(const Scene& scene);

}  // namespace voxeld
