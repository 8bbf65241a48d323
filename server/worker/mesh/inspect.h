// Descriptions of an asset's contents, for GET /v1/assets/{id}, and of grids, for their meta.
#pragma once

#include <cstddef>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "server/scene/core/animated_scene.h"
#include "server/voxel/pipelines/fill_stats.h"
#include "server/worker/mesh/mesh_topology.h"

namespace voxeld {

// {format, triangles, vertices, bounds {min, max}, has_colors, mesh_count, node_count, group_count,
// parts [{name, triangles, vertices, material, mesh, node, group}], materials [{name, base_color,
// texture, found}], missing_files [{name, needed_by}], watertight, open_edges, non_manifold_edges,
// flipped_edges, degenerate_triangles, components, enclosed_components, inner_walls}. vertices, of
// all and of each part, are distinct positions that triangles use. Counts are null for meshes
// above kTopologyTrianglesMax.
// For animations: joints [{name, parent}] (parent: an index, null for a root), joint_count,
// meshes [{name, material, vertices, triangles, influences_max, morph_targets}], animations [{name,
// frames, frame_rate, duration_s, unusable}] (frames and rate: null where keys are at times of
// their own; unusable: null, or the reason), animation_count. Lists are cut after 200 items.
nlohmann::json describe_scene(const AnimatedScene& animated);

// Bytes of one warning's text; longer ones are cut, because an untrusted mesh decides their
// lengths.
inline constexpr size_t kWarningBytesMax = 500;
// Warnings for people: [{code, detail}].
nlohmann::json describe_warnings(const std::vector<Warning>& warnings);

// Names of ids 1, 2, … of a channel: [{id, name}]. Names are cut to 200 bytes, or to as few as 32
// if all together would be too much for a response.
nlohmann::json describe_ids(const std::vector<std::string>& names);

// Whether and how the mesh closes, for the meta object of every grid: {watertight, closed,
// open_edges, non_manifold_edges, flipped_edges, degenerate_triangles, components,
// enclosed_components, inner_walls, ambiguous_fraction}. Unknown values are null:
// ambiguous_fraction if nothing was filled, the others if the mesh is above kTopologyTrianglesMax.
nlohmann::json describe_mesh(const std::optional<MeshTopology>& topology,
                             const std::optional<FillStats>& fill);

// The report of a fill, for the meta object: {sign, reason, closed, open_edges, non_manifold_edges,
// flipped_edges, components, enclosed_components, inner_walls, ambiguous_fraction}. Unknown values
// are null.
nlohmann::json describe_fill(const FillStats& fill, const std::optional<MeshTopology>& topology);

}  // namespace voxeld
