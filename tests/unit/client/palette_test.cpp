// Palette files at the flag --palette and in the C library.
#include "client/include/voxeld/palette.h"

#include <gtest/gtest.h>

#include <CLI/CLI.hpp>
#include <array>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <string>

#include "client/cli/palette_flag.h"

namespace voxeld::cli {
namespace {

class PaletteFlag : public ::testing::Test {
 protected:
  void SetUp() override { std::filesystem::create_directories(dir_); }
  void TearDown() override { std::filesystem::remove_all(dir_); }

  std::string file(const std::string& name, const std::string& text) const {
    const std::filesystem::path path = dir_ / name;
    std::ofstream(path, std::ios::binary) << text;
    return path.string();
  }
  static std::string error_of(const std::string& value) {
    try {
      palette_option(value);
    } catch (const CLI::ValidationError& error) {
      return error.what();
    }
    return "";
  }

  const std::filesystem::path dir_ = std::filesystem::path(::testing::TempDir()) / "palette_flag";
};

TEST_F(PaletteFlag, names_a_file_by_a_dot_or_a_slash_and_otherwise_is_the_option) {
  EXPECT_EQ(palette_option("16"), "16");
  EXPECT_EQ(palette_option("cga16"), "cga16");
  EXPECT_EQ(palette_option("#010203,#040506"), "#010203,#040506");
  EXPECT_EQ(palette_option(file("a.gpl", "GIMP Palette\n1 2 3\n255 0 16\n")), "#010203,#ff0010");
  EXPECT_EQ(palette_option(file("a.HEX", "0a0b0c\n")), "#0a0b0c");
}

TEST_F(PaletteFlag, tells_what_is_wrong_with_a_file) {
  EXPECT_EQ(error_of(file("a.gpl", "GIMP Palette\n1 2\n")),
            "--palette: a.gpl line 2: expected red, green and blue from 0 to 255, got \"1 2\"");
  EXPECT_EQ(error_of("/nonexistent/a.gpl"),
            "--palette: /nonexistent/a.gpl: No such file or directory");
  EXPECT_EQ(error_of(dir_.string()), "--palette: " + dir_.string() + ": Is a directory");
  EXPECT_EQ(error_of(file("large.gpl", std::string((size_t{4} << 20) + 2, ' '))),
            "--palette: large.gpl: expected at most 4194304 bytes, got 4194305");
}

TEST(PaletteInC, has_colours_or_an_error_that_is_cut_to_its_place) {
  const std::string text = "GIMP Palette\n1 2 3\n255 0 16\n";
  std::array<uint8_t, 3 * VOXELD_PALETTE_COLORS> colors{};
  std::array<char, 12> error{};
  EXPECT_EQ(voxeld_palette_read(text.data(), text.size(), "a.gpl", colors.data(), error.data(),
                                error.size()),
            2);
  EXPECT_EQ(
      (std::array<uint8_t, 6>{1, 2, 3, 255, 0, 16}),
      (std::array<uint8_t, 6>{colors[0], colors[1], colors[2], colors[3], colors[4], colors[5]}));
  EXPECT_EQ(voxeld_palette_read("x", 1, "a.gpl", colors.data(), error.data(), error.size()), 0);
  EXPECT_STREQ(error.data(), "a.gpl: expe");
  EXPECT_EQ(voxeld_palette_read("x", 1, "a.gpl", colors.data(), nullptr, 0), 0);
}

}  // namespace
}  // namespace voxeld::cli
