// One stream of the native container: a zstd frame with content size and checksum; attribute planes
// are stored as differences.
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

// `kind`: how much time its bytes are worth. `prefix`: what the reader knows of a stream like this
// one, to which the frame tells the difference; none: the frame stands for itself.
Result<std::vector<uint8_t>> compress_stream(StreamKind kind, std::span<const uint8_t> raw,
                                             std::span<const uint8_t> prefix = {});
// `prefix`: as it was written with. Errors: bad-request, when the frame is broken, says no size,
// says more than `raw_max` (before any memory is taken), or is followed by more bytes.
Result<std::vector<uint8_t>> decompress_stream(std::span<const uint8_t> stored, size_t raw_max,
                                               std::span<const uint8_t> prefix = {});

// Interleaved samples (channels per voxel) to planes of differences, and back.
std::vector<uint8_t> planes_from_samples(std::span<const uint8_t> samples, size_t channels);
std::vector<uint8_t> samples_from_planes(std::span<const uint8_t> planes, size_t channels);

}  // namespace voxeld
