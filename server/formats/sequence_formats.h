// Writes the frames of a sequence to one file, with one source file per output format. Frames are
// read and written one after the other, so they need not all fit into memory.
#pragma once

#include <filesystem>
#include <vector>

#include "proto/job.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "proto/sequence_format.h"
#include "server/grid/frame_source.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

// Writes the frames in the request's format to `path`, which is created or replaced.
// sequence_media_type() and sequence_extension() (proto/sequence_format.h) name the type. Equal
// frames give equal bytes. After an error, `path` does not hold a complete file. Errors: as
// encode() and check_sequence_encodable(); grid-too-large for a .vox that exceeds its 32-bit
// lengths; storage-full; the source's.
Status write_sequence(const FrameSource& source, const OutputOptions& options,
                      const std::filesystem::path& path);

// Performs only the check, before anything is computed. Errors: as check_encodable() for each
// frame, and grid-too-large for dense formats with more than limits::kSequenceDenseCellsMax cells
// in all frames.
Status check_sequence_encodable(const GridSpec& spec, size_t frames, const OutputOptions& options);

// Like encode_warnings(), plus "many-frames" for a .vox with more frames than MagicaVoxel's editor
// plays.
std::vector<Warning> sequence_warnings(const GridSpec& spec, size_t frames,
                                       const OutputOptions& options);

// One writer per format; write_sequence() calls them.
Status write_native_sequence(const FrameSource& source, const OutputOptions& options,
                             const std::filesystem::path& path);
Status write_vox_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);
Status write_npy_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);
Status write_npz_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);

}  // namespace voxeld
