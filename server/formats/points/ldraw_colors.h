// The solid colours of LDraw's library that bricks are made in.
#pragma once

#include <cstdint>
#include <span>
#include <string_view>

#include "server/grid/color/rgb.h"

namespace voxeld::ldraw {

struct LdrawColor {
  uint32_t code;  // that a file names
  std::string_view name;
  Rgb srgb;
};

// At most 256, so that a VoxelEntries can name them.
std::span<const LdrawColor> ldraw_colors();

// Light bluish grey, of grids without colours.
inline constexpr uint32_t kPlainCode = 71;

// A colour that a file states itself: 0x2RRGGBB.
constexpr uint32_t direct_color(const Rgb& srgb) {
  return 0x2000000U | uint32_t{srgb[0]} << 16 | uint32_t{srgb[1]} << 8 | srgb[2];
}

}  // namespace voxeld::ldraw
