// Blocks of 4 x 4 pixels, BC1 to BC5 (Microsoft, "Texture Block Compression in Direct3D 11").
#pragma once

#include <cstddef>
#include <cstdint>

namespace voxeld {

// BC4 has one channel, which is grey here; BC5 has red and green.
enum class BcKind { kBc1, kBc2, kBc3, kBc4, kBc5 };

constexpr int kBcSide = 4;
constexpr size_t kBcPixels = 16;

constexpr size_t bc_block_bytes(BcKind kind) {
  return kind == BcKind::kBc1 || kind == BcKind::kBc4 ? 8 : 16;
}

// Decodes a block of bc_block_bytes() into 16 pixels RGBA, row by row.
void decode_bc_block(BcKind kind, const uint8_t* block, uint8_t* rgba);

}  // namespace voxeld
