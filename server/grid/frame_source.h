// A source of a sequence's frames one by one, for formats and animated images. Not all frames need
// to fit into memory.
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

  // Placement, channels and meta of the sequence, without tiles.
  virtual const Grid& common() const = 0;
  virtual size_t frame_count() const = 0;
  // Seconds; ascending.
  virtual double time_s(size_t index) const = 0;
  // Frames per second if they are evenly spaced; 0 if they have times of their own.
  virtual double fps() const = 0;
  // The grid of a frame, with the spec and channels of common(). Errors: the container's;
  // cancelled.
  virtual Result<Grid> frame(size_t index) const = 0;

  // The native container that holds exactly frame(index); nullopt if the frame is derived from it.
  // A caller that reads it in place of frame() must call before_tiles() now and then, when `done`
  // of its `total` tiles have been read. Errors: cancelled.
  virtual std::optional<std::filesystem::path> container(size_t /*index*/) const { return {}; }
  virtual Status before_tiles(size_t /*done*/, size_t /*total*/) const { return {}; }
};

}  // namespace voxeld
