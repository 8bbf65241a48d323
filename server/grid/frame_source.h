// The frames of a sequence one by one: what formats and animated pictures are made from, so that
// not all of them need to fit into memory.
#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>

#include "proto/result.h"
#include "server/grid/grid.h"

namespace voxeld {

class FrameSource {
 public:
  virtual ~FrameSource() = default;

  // Place, channels and meta of the sequence; no tiles.
  virtual const Grid& common() const = 0;
  virtual size_t frame_count() const = 0;
  // Seconds; ascending.
  virtual double time_s(size_t index) const = 0;
  // Pictures per second where the frames are even; 0 where they are at times of their own.
  virtual double fps() const = 0;
  // The grid of a frame: spec and channels are those of common(). Errors: the container's;
  // cancelled.
  virtual Result<Grid> frame(size_t index) const = 0;

  // The native container that holds frame(index) as it is; none where the frame is made from it.
  // Who reads it in place of frame() calls before_tiles() now and then, when `done` of its `total`
  // tiles have been read. Errors: cancelled.
  virtual std::optional<std::filesystem::path> container(size_t /*index*/) const { return {}; }
  virtual Status before_tiles(size_t /*done*/, size_t /*total*/) const { return {}; }
};

}  // namespace voxeld
