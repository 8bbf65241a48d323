// Palettes: the names and the texts that the option `palette` takes.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

namespace voxeld {

using PaletteColor = std::array<uint8_t, 3>;  // sRGB R, G, B

// The most colours of a palette. Encoders and the choice of colours number them by a byte.
inline constexpr size_t kPaletteColorsMax = 256;

struct NamedPalette {
  std::string_view name;    // "cga16"
  std::string_view origin;  // "IBM Color Graphics Adapter"
  std::vector<PaletteColor> colors;
};

// All of them, from few colours to many.
std::span<const NamedPalette> named_palettes();
// Null for an unknown name.
const NamedPalette* find_palette(std::string_view name);

// "#1a1c2c,#f4f4f4": the text of the option for these colours.
std::string palette_text(std::span<const PaletteColor> colors);
// Removes the colours that equal an earlier one.
std::vector<PaletteColor> without_repeats(std::span<const PaletteColor> colors);

}  // namespace voxeld
