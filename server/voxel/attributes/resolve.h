// Conversion of the attribute pass's integer sums into the colours and normals of a tile, as
// README.md defines them.
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "proto/codec/sparse_tile.h"
#include "proto/options/options.h"
#include "server/voxel/attributes/attribute_records.h"

namespace voxeld {

struct ResolveOptions {
  AttributeChannels channels;
  bool shaded = false;  // bakes Phong shading into the colour; needs channels.normal
  ChannelSet write{};
};

// The byte of 16-bit alpha.
uint8_t alpha8(uint32_t alpha16);

// The mean colour of sums of R, G, B and, if has_alpha, alpha, which the others are multiplied by:
// in linear light, 16 bits each, with straight alpha. It is white where alpha is 0 as a byte.
std::array<uint32_t, 4> straight_mean(const std::array<uint64_t, 4>& sums, uint64_t weight,
                                      bool has_alpha);

// Writes voxels [voxel_first, …) of `tile`, whose channels have their full size. sums, carries: the
// lower and upper halves of channels.count() sums per voxel. Empty carries mean that all are 0.
void resolve_voxels(std::span<const uint32_t> sums, std::span<const uint32_t> carries,
                    const ResolveOptions& options, size_t voxel_first, SparseTile& tile);

// The same for 64-bit sums. It uses only the caller's thread.
void resolve_voxels(std::span<const uint64_t> sums, const ResolveOptions& options,
                    size_t voxel_first, SparseTile& tile);

}  // namespace voxeld
