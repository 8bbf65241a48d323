#include "proto/palette.h"

#include <gtest/gtest.h>

#include <map>
#include <set>

namespace voxeld {
namespace {

using Colors = std::vector<PaletteColor>;

TEST(Palettes, have_as_many_colours_as_their_names_say_each_once) {
  const std::map<std::string_view, size_t> counts = {
      {"bw", 2},       {"gray4", 4},      {"rgb8", 8},         {"zx15", 15},
      {"gray16", 16},  {"sepia16", 16},   {"cga16", 16},       {"html16", 16},
      {"cpc27", 27},   {"gray64", 64},    {"ega64", 64},       {"minecraft", 0},
      {"rgb332", 256}, {"xterm240", 240}, {"websafe216", 216}, {"magicavoxel", 255}};
  std::set<std::string_view> names;
  size_t last = 0;
  for (const NamedPalette& palette : named_palettes()) {
    ASSERT_TRUE(counts.contains(palette.name)) << palette.name;
    EXPECT_TRUE(names.insert(palette.name).second) << palette.name;
    EXPECT_EQ(without_repeats(palette.colors), palette.colors) << palette.name;
    EXPECT_LE(palette.colors.size(), kPaletteColorsMax);
    EXPECT_GE(palette.colors.size(), last) << palette.name;
    last = palette.colors.size();
    if (const size_t count = counts.at(palette.name); count > 0) {
      EXPECT_EQ(palette.colors.size(), count) << palette.name;
    }
  }
  EXPECT_EQ(names.size(), counts.size());
}

TEST(Palettes, have_the_known_colours) {
  EXPECT_EQ(find_palette("gray4")->colors,
            (Colors{{0, 0, 0}, {85, 85, 85}, {170, 170, 170}, {255, 255, 255}}));
  const Colors& cga = find_palette("cga16")->colors;
  EXPECT_EQ(cga[6], (PaletteColor{170, 85, 0}));
  EXPECT_EQ(cga[9], (PaletteColor{85, 85, 255}));
  EXPECT_EQ(cga[14], (PaletteColor{255, 255, 85}));
  const Colors& zx = find_palette("zx15")->colors;
  EXPECT_EQ(zx[2], (PaletteColor{215, 0, 0}));
  EXPECT_EQ(zx[14], (PaletteColor{255, 255, 255}));
  const Colors& web = find_palette("websafe216")->colors;
  EXPECT_EQ(web[1], (PaletteColor{0, 0, 51}));
  EXPECT_EQ(web[215], (PaletteColor{255, 255, 255}));
  const Colors& terminal = find_palette("xterm240")->colors;
  EXPECT_EQ(terminal[1], (PaletteColor{0, 0, 95}));
  EXPECT_EQ(terminal[239], (PaletteColor{238, 238, 238}));
  const Colors& model = find_palette("magicavoxel")->colors;
  EXPECT_EQ(model[1], (PaletteColor{255, 255, 204}));
  EXPECT_EQ(model[214], (PaletteColor{0, 0, 51}));
  EXPECT_EQ(model[215], (PaletteColor{238, 0, 0}));
  EXPECT_EQ(model[254], (PaletteColor{17, 17, 17}));
  EXPECT_EQ(find_palette("cga"), nullptr);
}

TEST(Palettes, are_written_as_a_text_of_colours) {
  EXPECT_EQ(palette_text(Colors{{26, 28, 44}, {0, 10, 255}}), "#1a1c2c,#000aff");
  EXPECT_EQ(palette_text({}), "");
  EXPECT_EQ(without_repeats(Colors{{1, 2, 3}, {4, 5, 6}, {1, 2, 3}}),
            (Colors{{1, 2, 3}, {4, 5, 6}}));
}

}  // namespace
}  // namespace voxeld
