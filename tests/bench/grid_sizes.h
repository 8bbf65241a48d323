// The same voxels in the files of others.
#pragma once

#include <string>
#include <utility>
#include <vector>

#include "proto/codec/sparse_tile.h"

namespace voxeld::bench {

// Name of the format and the file that was written.
using WrittenFiles = std::vector<std::pair<std::string, std::string>>;

// Occupancy alone as OpenVDB mask grids and, where NanoVDB is there, its value masks, by each of
// their codecs, in `folder`. Only compiled where OpenVDB is installed. Throws std::runtime_error
// when a grid has not as many voxels as the tiles, and what the libraries throw.
WrittenFiles write_vdbs(const std::vector<SparseTile>& tiles, const std::string& folder);

}  // namespace voxeld::bench
