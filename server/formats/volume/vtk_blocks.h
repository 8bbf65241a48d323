// Arrays in the blocks of VTK's compressed XML files, with header_type UInt64:
//
//   u64  number of blocks
//   u64  raw bytes of a block
//   u64  raw bytes of the last block if it is shorter, else 0
//   u64  compressed bytes of each block
//        the blocks, each a zlib stream of its own
#pragma once

#include "proto/result.h"
#include "server/formats/npy/array_pieces.h"
#include "server/formats/output_file.h"

namespace voxeld::volume {

// Raw bytes of a block.
inline constexpr size_t kVtkBlockBytes = size_t{1} << 20;

// Appends an array. Blocks are deflated on all threads; about 32 MiB of samples are in memory.
// Errors: those of OutputFile.
Status append_vtk_array(OutputFile& file, const ArrayPieces& array);

}  // namespace voxeld::volume
