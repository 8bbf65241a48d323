// Encodes grids and sequences as files, with one source file per output format. Frames of a
// sequence are read and written one after the other, so they need not all fit into memory.
#pragma once

#include <cstdint>
#include <filesystem>
#include <span>
#include <string>
#include <vector>

#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "proto/output_format.h"
#include "proto/result.h"
#include "server/grid/frame_source.h"
#include "server/grid/grid.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

class OutputFile;

// Writes a grid in the request's format to `path`, which is created or replaced. After an error,
// `path` does not hold a complete file. Errors: grid-too-large if a dense array exceeds
// limits::kDenseCellsMax, with cells, limit and what is sparse, or sparse arrays
// limits::kSparseVoxelsMax; invalid-option as check_channels(); storage-full.
Status write_grid(const Grid& grid, const OutputOptions& options,
                  const std::filesystem::path& path);
// The same bytes in memory.
Result<std::vector<uint8_t>> encode(const Grid& grid, const OutputOptions& options);
// Performs only the check, before anything is computed.
Status check_encodable(const GridSpec& spec, const OutputOptions& options);
// Checks that the grid has the channel that the options name, and colours if they name a palette.
// Errors: invalid-option with the channels that it has.
Status check_channels(const ChannelSet& channels, const OutputOptions& options);
// Whether a format of points is written in pieces, so that the file is never in memory.
bool is_written_in_pieces(Format format);

// Warnings about what an encoded grid loses: "outside-world" for a .vox with more cells than
// MagicaVoxel shows, those of mesh::mesh_warnings() and minecraft::block_warnings(), and
// lost_data_warnings().
std::vector<Warning> encode_warnings(const Grid& grid, const OutputOptions& options);

// Writes the frames in the request's format to `path`, which is created or replaced.
// sequence_media_type() and sequence_extension() (proto/output_format.h) name the type. Equal
// frames give equal bytes. After an error, `path` does not hold a complete file. Errors: as
// encode() and check_sequence_encodable(); grid-too-large for a .vox that exceeds its 32-bit
// lengths; storage-full; the source's.
Status write_sequence(const FrameSource& source, const OutputOptions& options,
                      const std::filesystem::path& path);

// Performs only the check, before anything is computed. Errors: as check_encodable() for each
// frame, and grid-too-large for dense formats with more than limits::kSequenceDenseCellsMax cells
// in all frames.
Status check_sequence_encodable(const GridSpec& spec, size_t frames, const OutputOptions& options);

// Like encode_warnings() of a grid without tiles, plus "many-frames" for a .vox with more frames
// than MagicaVoxel's editor plays.
std::vector<Warning> sequence_warnings(const Grid& common, size_t frames,
                                       const OutputOptions& options);

// Encoders of grids and writers of sequences, one of each per line of VOXELD_OUTPUT_FORMATS.
// write_grid(), encode() and write_sequence() call them once their checks have passed.
#define VOXELD_FORMAT_FUNCTIONS(format, name, type, extension, sequence_type, sequence_extension, \
                                layout, encode, write)                                            \
  Status encode(const Grid& grid, const OutputOptions& options, OutputFile& file);                \
  Status write(const FrameSource& source, const OutputOptions& options,                           \
               const std::filesystem::path& path);
VOXELD_OUTPUT_FORMATS(VOXELD_FORMAT_FUNCTIONS)
#undef VOXELD_FORMAT_FUNCTIONS

// Voxels of a grid that xyz and csv write. More: grid-too-large.
inline constexpr uint64_t kXyzPointsMax = uint64_t{1} << 26;

// A zip of the frames' grids, each encoded by itself, as "frame-0000.EXT" and so on. A frame's file
// lies beside `path` until it is in the zip, so that it need not fit into memory.
Status write_zip_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);

}  // namespace voxeld
