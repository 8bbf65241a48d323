// sign=auto of meshes that are not closed or not consistently oriented: what the axes leave in
// doubt. See ../README.md, "Signs".
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "server/voxel/solid/inside/inside.h"

namespace voxeld {

struct AutoSettings {
  std::span<const SparseTile> touched;  // the cells of rule=touch, in any order of tiles
  // Whether it matters which of the touched cells are inside.
  bool decides_touched = true;
};

// How it was decided, for reports.
struct AutoReport {
  int64_t doubtful = 0;  // cells, not touched, that neither the axes nor a region decided
  // The winding number decided about doubtful cells; else their majority stays.
  bool by_winding = false;
};

// Changes `inside`, the cells of sign=majority, to those of sign=auto. votes: of that majority,
// with the doubtful cells, which are taken. Tiles are canonical, in any order. Errors: those of
// `progress`, which is called from time to time with 0 columns done.
Status settle_doubt(const FillMesh& mesh, const glm::ivec3& dims, const AutoSettings& settings,
                    ThreadTeam& team, const ColumnProgress& progress, AxisVotes& votes,
                    std::vector<SparseTile>& inside, AutoReport& report);

// An upper bound of the bytes that settle_doubt() takes beside its tree (tree_bytes()).
// surface_bytes: of the touched tiles.
int64_t auto_sign_bytes(const glm::ivec3& dims, int64_t surface_bytes);

}  // namespace voxeld
