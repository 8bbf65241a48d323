// Integer sums of the attribute pass -> the colours and normals of a tile. Definition: README.md.
#pragma once

#include <cstdint>
#include <span>

#include "proto/options.h"
#include "proto/sparse_tile.h"
#include "server/voxel/attribute_records.h"

namespace voxeld {

struct ResolveOptions {
  AttributeChannels channels;
  bool shaded = false;  // bake Phong shading into the colour; needs channels.normal
  ChannelSet write{};
};

// sums, carries: channels.count() words per voxel, lower and upper halves; carries may be empty:
// all are 0. Writes voxels [voxel_first, …) of `tile`, whose channels have their full size.
void resolve_voxels(std::span<const uint32_t> sums, std::span<const uint32_t> carries,
                    const ResolveOptions& options, size_t voxel_first, SparseTile& tile);

// The same of whole sums, on the caller's thread alone.
void resolve_voxels(std::span<const uint64_t> sums, const ResolveOptions& options,
                    size_t voxel_first, SparseTile& tile);

}  // namespace voxeld
