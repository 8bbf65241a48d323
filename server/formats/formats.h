// Grid -> bytes, one file per output format.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

// Errors: grid-too-large when a dense format exceeds kDenseCellsMax (says cells, limit and which
// formats are sparse).
Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options);
// The check alone, before anything is computed.
Status check_encodable(const GridSpec& spec, const OutputOptions& options);

// Whether the grid fits MagicaVoxel's world. Errors: grid-too-large.
Status check_vox_size(const GridSpec& spec);

Result<std::vector<uint8_t>> encode_npy(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_npz(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_vox(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_native(const Grid& grid, const OutputOptions& options);

}  // namespace voxeld
