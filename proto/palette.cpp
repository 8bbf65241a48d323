#include "proto/palette.h"

#include <algorithm>

#include "proto/minecraft_blocks.h"
#include "proto/text/hex.h"

namespace voxeld {
namespace {

using Colors = std::vector<PaletteColor>;
using Levels = std::vector<uint8_t>;

// `count` levels from 0 to 255 at equal distances.
Levels even_levels(unsigned count) {
  Levels levels;
  levels.reserve(count);
  for (unsigned i = 0; i < count; ++i) {
    levels.push_back(static_cast<uint8_t>((i * 255 * 2 + count - 1) / (2 * (count - 1))));
  }
  return levels;
}

// All mixtures of the levels; blue changes fastest.
Colors cube(const Levels& reds, const Levels& greens, const Levels& blues) {
  Colors colors;
  colors.reserve(reds.size() * greens.size() * blues.size());
  for (const uint8_t r : reds) {
    for (const uint8_t g : greens) {
      for (const uint8_t b : blues) colors.push_back({r, g, b});
    }
  }
  return colors;
}

Colors cube(const Levels& levels) {
  return cube(levels, levels, levels);
}

Colors grays(const Levels& levels) {
  Colors colors;
  colors.reserve(levels.size());
  for (const uint8_t level : levels) colors.push_back({level, level, level});
  return colors;
}

// From a dark brown to a light yellow in equal steps.
Colors sepia() {
  constexpr std::array<unsigned, 3> kDark = {30, 18, 8}, kLight = {255, 243, 218};
  constexpr unsigned kSteps = 15;
  Colors colors(kSteps + 1);
  for (unsigned i = 0; i <= kSteps; ++i) {
    for (size_t c = 0; c < 3; ++c) {
      colors[i][c] = static_cast<uint8_t>(kDark[c] + (kLight[c] - kDark[c]) * i / kSteps);
    }
  }
  return colors;
}

// Bits for intensity, red, green and blue; the monitor shows dark yellow as brown.
Colors cga() {
  Colors colors;
  for (unsigned i = 0; i < 16; ++i) {
    const unsigned base = i & 8 ? 85 : 0;
    const auto part = [&](unsigned bit) {
      return static_cast<uint8_t>(base + (i & bit ? 170 : 0));
    };
    colors.push_back({part(4), part(2), part(1)});
  }
  colors[6] = {170, 85, 0};
  return colors;
}

// The 16 names of HTML 4.01, in the order of its table.
Colors html() {
  return {{0, 0, 0},   {192, 192, 192}, {128, 128, 128}, {255, 255, 255},
          {128, 0, 0}, {255, 0, 0},     {128, 0, 128},   {255, 0, 255},
          {0, 128, 0}, {0, 255, 0},     {128, 128, 0},   {255, 255, 0},
          {0, 0, 128}, {0, 0, 255},     {0, 128, 128},   {0, 255, 255}};
}

// Eight colours, and the same ones bright but for black. Bits of a number: green, red, blue.
Colors spectrum() {
  Colors colors;
  for (const uint8_t level : {uint8_t{215}, uint8_t{255}}) {
    for (unsigned i = level == 255 ? 1 : 0; i < 8; ++i) {
      const auto part = [&](unsigned bit) { return i & bit ? level : uint8_t{0}; };
      colors.push_back({part(2), part(4), part(1)});
    }
  }
  return colors;
}

// The colours of terminals after the first 16, which their users set.
Colors xterm() {
  Colors colors = cube({0, 95, 135, 175, 215, 255});
  for (unsigned i = 0; i < 24; ++i) {
    const auto level = static_cast<uint8_t>(8 + 10 * i);
    colors.push_back({level, level, level});
  }
  return colors;
}

// A cube of six levels, white first and without black; then ten levels each of red, green, blue
// and grey that the cube lacks.
Colors magicavoxel() {
  Colors colors = cube({255, 204, 153, 102, 51, 0});
  colors.pop_back();
  const Levels ramp = {238, 221, 187, 170, 136, 119, 85, 68, 34, 17};
  for (const PaletteColor& parts : {PaletteColor{1, 0, 0}, PaletteColor{0, 1, 0},
                                    PaletteColor{0, 0, 1}, PaletteColor{1, 1, 1}}) {
    for (const uint8_t level : ramp) {
      PaletteColor color{};
      for (size_t c = 0; c < 3; ++c) color[c] = static_cast<uint8_t>(parts[c] * level);
      colors.push_back(color);
    }
  }
  return colors;
}

Colors block_colors() {
  Colors colors;
  const auto blocks = minecraft_blocks();
  colors.reserve(blocks.size());
  for (const MinecraftBlock& block : blocks) colors.push_back(block.color);
  return colors;
}

std::vector<NamedPalette> all_palettes() {
  return {
      {"bw", "black and white", grays({0, 255})},
      {"gray4", "even greys", grays(even_levels(4))},
      {"rgb8", "the corners of the cube of colours", cube({0, 255})},
      {"zx15", "Sinclair ZX Spectrum", spectrum()},
      {"gray16", "even greys", grays(even_levels(16))},
      {"sepia16", "brown to light yellow", sepia()},
      {"cga16", "IBM Color Graphics Adapter", cga()},
      {"html16", "names of HTML 4.01", html()},
      {"cpc27", "Amstrad CPC", cube({0, 128, 255})},
      {"gray64", "even greys", grays(even_levels(64))},
      {"ega64", "IBM Enhanced Graphics Adapter", cube(even_levels(4))},
      {"minecraft", "the blocks of schem, litematic and nbt", block_colors()},
      {"websafe216", "web browsers of the 1990s", cube(even_levels(6))},
      {"xterm240", "terminals, without the 16 that users set", without_repeats(xterm())},
      {"magicavoxel", "a new model of MagicaVoxel", magicavoxel()},
      {"rgb332", "three bits of red and green, two of blue",
       cube(even_levels(8), even_levels(8), even_levels(4))},
  };
}

}  // namespace

std::span<const NamedPalette> named_palettes() {
  static const std::vector<NamedPalette> palettes = all_palettes();
  return palettes;
}

const NamedPalette* find_palette(std::string_view name) {
  const auto palettes = named_palettes();
  const auto found = std::ranges::find(palettes, name, &NamedPalette::name);
  return found == palettes.end() ? nullptr : &*found;
}

std::string palette_text(std::span<const PaletteColor> colors) {
  std::string text;
  text.reserve(8 * colors.size());
  for (const PaletteColor& color : colors) {
    text += text.empty() ? "#" : ",#";
    text += hex_text(color);
  }
  return text;
}

std::vector<PaletteColor> without_repeats(std::span<const PaletteColor> colors) {
  std::vector<PaletteColor> kept;
  kept.reserve(colors.size());
  for (const PaletteColor& color : colors) {
    if (std::ranges::find(kept, color) == kept.end()) kept.push_back(color);
  }
  return kept;
}

}  // namespace voxeld
