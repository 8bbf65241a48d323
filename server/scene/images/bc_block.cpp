// Bits of a block, little endian:
//
//   colours  u16 a, u16 b (R5 G6 B5), then 2 bits for each pixel. 0: a, 1: b, and if a > b
//            2: (2a + b) / 3, 3: (a + 2b) / 3; else 2: (a + b) / 2, 3: transparent black
//   ramp     u8 a, u8 b, then 3 bits for each pixel. 0: a, 1: b, and if a > b six steps between
//            them; else four steps, 0 and 255
//
//   BC1 colours   BC2 4 bits of alpha for each pixel, colours   BC3 ramp of alpha, colours
//   BC4 ramp      BC5 ramp of red, ramp of green
//
// BC2 and BC3 always have four colours, as if a > b.
#include "server/scene/images/bc_block.h"

#include <algorithm>
#include <array>

#include "server/scene/images/decoders.h"

namespace voxeld {
namespace {

using Rgba = std::array<uint8_t, 4>;

// Bits of a channel, stretched to 0..255.
uint8_t stretched(uint64_t value, unsigned largest) {
  return static_cast<uint8_t>((value * 255 + largest / 2) / largest);
}

Rgba color_of(uint64_t r5g6b5) {
  return {stretched(r5g6b5 >> 11 & 31, 31), stretched(r5g6b5 >> 5 & 63, 63),
          stretched(r5g6b5 & 31, 31), 255};
}

// The mean of two colours with these weights, rounded.
Rgba mix(const Rgba& a, unsigned weight_a, const Rgba& b, unsigned weight_b) {
  const unsigned sum = weight_a + weight_b;
  Rgba mixed{0, 0, 0, 255};
  for (size_t c = 0; c < 3; ++c) {
    mixed[c] = static_cast<uint8_t>((a[c] * weight_a + b[c] * weight_b + sum / 2) / sum);
  }
  return mixed;
}

void decode_colors(const uint8_t* block, bool has_transparency, uint8_t* rgba) {
  const uint64_t first = little_endian({block, 2}), second = little_endian({block + 2, 2});
  const Rgba a = color_of(first), b = color_of(second);
  std::array<Rgba, 4> colors = {a, b, mix(a, 2, b, 1), mix(a, 1, b, 2)};
  if (has_transparency && first <= second) {
    colors[2] = mix(a, 1, b, 1);
    colors[3] = Rgba{};
  }
  uint64_t indices = little_endian({block + 4, 4});
  for (size_t i = 0; i < kBcPixels; ++i, indices >>= 2) {
    std::copy_n(colors[indices & 3].begin(), 4, rgba + 4 * i);
  }
}

void decode_ramp(const uint8_t* block, uint8_t* channel) {
  const unsigned a = block[0], b = block[1];
  std::array<unsigned, 8> values = {a, b, 0, 0, 0, 0, 0, 255};
  const unsigned steps = a > b ? 7 : 5;
  for (unsigned i = 1; i < steps; ++i)
    values[i + 1] = ((steps - i) * a + i * b + steps / 2) / steps;
  uint64_t indices = little_endian({block + 2, 6});
  for (size_t i = 0; i < kBcPixels; ++i, indices >>= 3) {
    channel[4 * i] = static_cast<uint8_t>(values[indices & 7]);
  }
}

}  // namespace

void decode_bc_block(BcKind kind, const uint8_t* block, uint8_t* rgba) {
  switch (kind) {
    case BcKind::kBc1:
      return decode_colors(block, true, rgba);
    case BcKind::kBc2:
      decode_colors(block + 8, false, rgba);
      for (size_t i = 0; i < kBcPixels; ++i) {
        rgba[4 * i + 3] = stretched(block[i / 2] >> (4 * (i % 2)) & 15, 15);
      }
      return;
    case BcKind::kBc3:
      decode_colors(block + 8, false, rgba);
      return decode_ramp(block, rgba + 3);
    case BcKind::kBc4:
    case BcKind::kBc5:
      for (size_t i = 0; i < kBcPixels; ++i)
        std::copy_n(Rgba{0, 0, 0, 255}.begin(), 4, rgba + 4 * i);
      decode_ramp(block, rgba);
      if (kind == BcKind::kBc5) return decode_ramp(block + 8, rgba + 1);
      for (size_t i = 0; i < kBcPixels; ++i) rgba[4 * i + 1] = rgba[4 * i + 2] = rgba[4 * i];
      return;
  }
}

}  // namespace voxeld
