// The place of a grid in OctoMap's lattice, whose points are multiples of the voxel size.
#pragma once

#include <vector>

#include <glm/vec3.hpp>

#include "proto/messages/job.h"
#include "server/grid/grid_spec.h"

namespace voxeld::octomap {

// Cells on each side of the lattice's origin, in which keys of 16 bits can name one.
inline constexpr int kLatticeReach = 1 << 15;

struct LatticePlace {
  double cell_size = 1;      // world units; that of x where voxels are no cubes
  glm::ivec3 first_cell{0};  // of the lattice: cell (0,0,0) of the grid
  glm::dvec3 offset{0};      // world units: what to add to a position of the file
};

// The nearest cells of the lattice. Along an axis on which the grid would not fit there, it begins
// at 0: a map in a local frame, as robots use it, with the offset beside it.
LatticePlace lattice_place(const GridSpec& spec);

// "moved" if the offset is not 0.
std::vector<Warning> lattice_warnings(const GridSpec& spec);

}  // namespace voxeld::octomap
