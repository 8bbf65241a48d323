// Codec of one stream of the native container: a zstd frame with content size and checksum.
// Attribute planes are stored as differences.
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "proto/result.h"

namespace voxeld {

enum class StreamKind {
  kOctree,
  kPlanes,    // of colours, normals and ids
  kMeasures,  // planes of distances and coverages
};

// `kind` decides how much time is spent to save bytes. `prefix` is a similar stream that the reader
// knows; the frame is then a difference to it. Without one the frame is complete in itself.
Result<std::vector<uint8_t>> compress_stream(StreamKind kind, std::span<const uint8_t> raw,
                                             std::span<const uint8_t> prefix = {});
// `prefix` must be that of the writer. Errors: bad-request if the frame is broken, gives no size,
// gives more than `raw_max` (checked before memory is allocated), or is followed by more bytes.
Result<std::vector<uint8_t>> decompress_stream(std::span<const uint8_t> stored, size_t raw_max,
                                               std::span<const uint8_t> prefix = {});

// Converts interleaved samples (channels per voxel) to planes of differences, and back.
std::vector<uint8_t> planes_from_samples(std::span<const uint8_t> samples, size_t channels);
std::vector<uint8_t> samples_from_planes(std::span<const uint8_t> planes, size_t channels);

}  // namespace voxeld
