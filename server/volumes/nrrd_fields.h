// The header of an NRRD file: what its samples are and where they lie.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>

#include "proto/result.h"
#include "server/grid/grid_spec.h"
#include "server/volumes/dense_samples.h"

namespace voxeld::volumes {

struct NrrdFile {
  SampleArray array;  // without its threshold
  GridSpec spec;
  bool is_gzip = false;   // else raw
  size_t data_begin = 0;  // byte of the file
};

// Reads the magic and the lines up to the empty one. Axes may be in any order and direction of the
// world's; the origin is the centre of the first sample, whatever the centering. Errors: as
// load_volume().
Result<NrrdFile> read_nrrd_fields(std::string_view name, std::span<const uint8_t> bytes);

}  // namespace voxeld::volumes
