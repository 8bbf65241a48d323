// Converts the triangles of a glTF document into the parts of a scene.
#pragma once

#include "proto/result.h"
#include "server/scene/core/scene.h"
#include "server/scene/gltf/accessor.h"
#include "server/scene/gltf/document.h"
#include "server/scene/gltf/rig.h"
#include "server/scene/gltf/textures.h"

namespace voxeld::gltf {

// Adds the meshes of the nodes that the document shows to a scene, in world space, and their
// bindings to the rig. Skins and morph targets stand in the pose in which the file
// leaves them. Unused vertices are omitted, because files share one vertex array among many
// primitives. Primitives of points and lines, which have no surface, and those without POSITION are
// omitted with the warning "skipped-primitive", corners that are no whole triangle at the end of
// one with "incomplete-triangle".
//
// Errors: malformed-mesh for accessors of wrong types, ranges and counts, coordinates that are not
// finite, and joints that do not exist; empty-mesh; unsupported-feature for compressed data.
Status add_meshes(const Document& document, Accessors& accessors, Textures& textures, Scene& scene,
                  RigBuilder& rig);

}  // namespace voxeld::gltf
