// The hierarchy of a Zarr store and its metadata documents, in Zarr 3 with OME-Zarr 0.5 or Zarr 2
// with OME-Zarr 0.4.
//
//   0, 1, …                   occupancy, at each level of detail
//   color/0, normal/0, …      the other channels that are no ids
//   labels/material/0, …      channels of ids, as label images of OME-Zarr
//
// Axes are z, y, x, after t for the frames of a sequence and before c for the components of a
// channel. Groups without c have a multiscale image of OME-Zarr, whose translations are the centres
// of the first cells; OME-Zarr has no images with c after x.
//
// Zarr 3: https://zarr-specs.readthedocs.io/en/latest/v3/core/index.html
// OME-Zarr: https://ngff.openmicroscopy.org/0.5/
#pragma once

#include <array>
#include <cstddef>
#include <optional>
#include <string>
#include <vector>

#include "proto/options/options.h"
#include "server/grid/grid.h"

namespace voxeld::zarr {

// Cells of a chunk along an axis. Bricks of one Morton node of a tile are a chunk; an occupancy
// chunk is 256 KiB before it is deflated, and a surface's is 2 to 3 KB after.
inline constexpr int kChunkSide = 64;

// The frames of a sequence; a grid has none.
struct FrameAxis {
  size_t count = 0;
  double step_s = 0;   // between two frames; 0: they have times of their own
  double begin_s = 0;  // of the first one
};

// Levels of detail that a store has: up to the first one that is a single chunk.
int level_count(const GridSpec& spec);

// The path of a channel's array, nullopt being occupancy: "0", "color/0", "labels/label/0".
std::string array_path(std::optional<Channel> channel, int level);
// The key of a chunk in its array: "c/0/1/2" in Zarr 3, "0/1/2" in Zarr 2. chunk: x, y, z.
std::string chunk_key(const std::array<uint32_t, 3>& chunk, std::optional<size_t> frame,
                      bool has_components, int version);

struct Document {
  std::string path, text;
};
// All documents of a store. common: placement, channels and meta, at level 0.
std::vector<Document> documents(const Grid& common, const FrameAxis& frames,
                                const OutputOptions& options);

}  // namespace voxeld::zarr
