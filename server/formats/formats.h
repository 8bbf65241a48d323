// Grid -> bytes, one file per output format.
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/job.h"
#include "proto/options.h"
#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

// Errors: grid-too-large when a dense format exceeds kDenseCellsMax (says cells, limit and which
// formats are sparse).
Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options);
// The check alone, before anything is computed.
Status check_encodable(const GridSpec& spec, const OutputOptions& options);

// What an encoded grid loses in the programs that it is meant for: "outside-world" for a .vox of
// more cells than MagicaVoxel shows. The file holds everything all the same.
std::vector<Warning> encode_warnings(const GridSpec& spec, const OutputOptions& options);

Result<std::vector<uint8_t>> encode_npy(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_npz(const Grid& grid, const OutputOptions& options);
Result<std::vector<uint8_t>> encode_vox(const Grid& grid, const OutputOptions& options);
// The container in the codec asked for; Codec::kSmall is for those who keep or send it.
Result<std::vector<uint8_t>> encode_native(const Grid& grid, const OutputOptions& options);

}  // namespace voxeld
