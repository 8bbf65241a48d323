// Encodes a grid as bytes, with one source file per output format.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/job.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

// Encodes a grid. Errors: grid-too-large if a dense format exceeds kDenseCellsMax, with cells,
// limit and the sparse formats.
Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options);
// Performs only the check, before anything is computed.
Status check_encodable(const GridSpec& spec, const OutputOptions& options);

// Warnings about what an encoded grid loses in its usual programs: "outside-world" for a .vox with
// more cells than MagicaVoxel shows. The file is still complete.
std::vector<Warning> encode_warnings(const GridSpec& spec, const OutputOptions& options);

Result<std::vector<uint8_t>> encode_npy(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_npz(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_vox(const Grid& grid, const OutputOptions& options);
// Encodes the container in the requested codec. Codec::kSmall is for grids that are stored for long
// or sent.
Result<std::vector<uint8_t>> encode_native(const Grid& grid, const OutputOptions& options);

}  // namespace voxeld
