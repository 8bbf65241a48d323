// Small things that move, made here, and comparisons with tests/reference.
#pragma once

#include <string>
#include <vector>

#include "server/scene/core/animated_scene.h"
#include "tests/reference/gltf_skinning_oracle.h"
#include "tests/reference/md5_skinning_oracle.h"
#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {

// The daemon and the oracle may differ by so much, in units of the file.
inline constexpr double kFrameTolerance = 1e-4;

// Five joints with two roots; two meshes, up to three weights per vertex.
std::string puppet_mesh();
// An animation of all joints in another order; some of their numbers, over 4 frames at 10 per
// second.
std::string puppet_walk();
// An animation of all joints; every number of the second root, over 2 frames at 24 per second.
std::string puppet_wave();
// The three as puppet.md5mesh, anims/walk.md5anim, anims/wave.MD5ANIM in a zip.
std::string puppet_zip();

// A skinned mesh with two sets of joints, weights as bytes; a mesh with two morph targets, one
// sparse, on a moving node; a mesh below it. Animations "spline" and one without a name (linear,
// step, integers).
GltfBuilder dancer();

// Loads a file that must load.
AnimatedScene loaded(std::string_view filename, std::string_view bytes);
AnimatedScene loaded(const GltfBuilder& builder);
// A frame that must be made.
FrameVertices frame_of(const AnimatedScene& animated, size_t animation, double seconds);

// Largest distances of positions and normals, vertex by vertex.
void expect_frame(const FrameVertices& frame, const std::vector<reference::OraclePart>& expected);
// The same for the corners of all triangles.
void expect_frame(const FrameVertices& frame, const Scene& scene,
                  const std::vector<reference::OracleCorners>& expected);

}  // namespace voxeld
