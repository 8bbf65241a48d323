// Consecutive tiles of a native container as a container of their own, without a copy of their
// streams: the new container is `front`, then a range of bytes of the old one.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <vector>

#include "proto/result.h"

namespace voxeld {

struct GridExcerpt {
  std::vector<uint8_t> front;             // header, meta and directory
  uint64_t first_byte = 0, end_byte = 0;  // of the tiles' streams, in the old container
  size_t tile_count = 0;
};

// The tiles from `first` on, at most `count` of them. Reads the header and the entries of these
// tiles alone. Errors: bad-request, "grid container, byte N: ...", also if the container has no
// tile `first`; internal for a meta that is too long.
Result<GridExcerpt> excerpt_tiles(std::span<const uint8_t> container, size_t first, size_t count,
                                  const std::string& meta_json);

}  // namespace voxeld
