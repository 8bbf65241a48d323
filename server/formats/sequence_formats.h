// The frames of a sequence -> one file, one source file per output format. Frames are read and
// written one after the other: not all of them need to fit into memory.
#pragma once

#include <filesystem>
#include <vector>

#include "proto/job.h"
#include "proto/options.h"
#include "proto/result.h"
#include "proto/sequence_format.h"
#include "server/grid/frame_source.h"
#include "server/grid/grid_spec.h"

namespace voxeld {

// Writes the frames in the request's format to `path`, which is created or replaced; sequence_
// media_type() and sequence_extension() (proto/sequence_format.h) say what it is. The same frames
// give the same bytes. Errors: as encode() and check_sequence_encodable(); grid-too-large for a
// .vox that gets longer than its 32-bit lengths can say; storage-full; the source's. What is at
// `path` after an error is not a whole file.
Status write_sequence(const FrameSource& source, const OutputOptions& options,
                      const std::filesystem::path& path);

// The check alone, before anything is computed. Errors: as check_encodable() for each frame, and
// grid-too-large for dense formats of more than limits::kSequenceDenseCellsMax cells in all frames.
Status check_sequence_encodable(const GridSpec& spec, size_t frames, const OutputOptions& options);

// As encode_warnings(), and "many-frames" for a .vox of more frames than MagicaVoxel's editor
// plays.
std::vector<Warning> sequence_warnings(const GridSpec& spec, size_t frames,
                                       const OutputOptions& options);

// One per format, as write_sequence() calls them.
Status write_native_sequence(const FrameSource& source, const OutputOptions& options,
                             const std::filesystem::path& path);
Status write_vox_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);
Status write_npy_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);
Status write_npz_sequence(const FrameSource& source, const OutputOptions& options,
                          const std::filesystem::path& path);

}  // namespace voxeld
