// The triangles of a glTF scene at a time of an animation, from the JSON and its buffers:
// own reader, rotations as matrices, sums written out. Shares no code with the daemon.
#pragma once

#include <cstdint>
#include <map>
#include <nlohmann/json_fwd.hpp>
#include <string>
#include <vector>

#include "tests/reference/rigid_math.h"

namespace voxeld::reference {

// Corners of the triangles of one primitive on one node, in the order of the indices.
struct OracleCorners {
  std::vector<Vec3> positions, normals;  // normals: empty where the file has none
};

// Takes a well-formed document whose buffers are in `buffers`, of triangles alone, without
// mirroring transforms. Nodes by the tree of the default scene, parents first. animation < 0: as
// the file leaves its nodes.
std::vector<OracleCorners> gltf_frame(const nlohmann::json& document,
                                      const std::vector<std::vector<uint8_t>>& buffers,
                                      int animation, double seconds);

// JSON and the one buffer of a GLB.
nlohmann::json read_glb(const std::vector<uint8_t>& bytes,
                        std::vector<std::vector<uint8_t>>& buffers);

}  // namespace voxeld::reference
