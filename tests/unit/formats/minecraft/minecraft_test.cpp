// Schematics, litematics and structures, read by a naive reader and compared cell by cell.
#include <gtest/gtest.h>

#include <algorithm>
#include <functional>
#include <limits>
#include <map>
#include <random>
#include <string>

#include "proto/minecraft_blocks.h"
#include "proto/text/hex.h"
#include "server/formats/formats.h"
#include "server/formats/minecraft/block_file.h"
#include "server/formats/minecraft/litematic.h"
#include "server/formats/palette.h"
#include "server/grid/color/oklab.h"
#include "tests/unit/formats/minecraft/nbt_reader.h"
#include "tests/unit/formats/npy/npy_reader.h"
#include "tests/unit/formats/sample_grid.h"

namespace voxeld {
namespace {

using minecraft::block_warnings;
using test::Nbt;
using Blocks = std::map<std::array<int, 3>, std::string>;  // of cells that are not air

constexpr Format kBlockFormats[] = {Format::kSchem, Format::kLitematic, Format::kNbt};

OutputOptions to_blocks(Format format, std::vector<std::string> blocks = {}) {
  OutputOptions options = test::to(format);
  options.blocks = std::move(blocks);
  return options;
}

Nbt written(const Grid& grid, const OutputOptions& options, std::string* name = nullptr) {
  const auto bytes = encode(grid, options);
  EXPECT_TRUE(bytes) << (bytes ? "" : bytes.error().message());
  std::string root;
  Nbt nbt = bytes ? test::NbtReader::read_gzip(*bytes, root) : Nbt();
  if (name != nullptr) *name = root;
  return nbt;
}

// The blocks of cells in the order y, z, x by next(), the index of the next cell.
Blocks blocks_in_order(const std::array<int, 3>& size, const std::vector<std::string>& palette,
                       const std::function<size_t()>& next) {
  Blocks blocks;
  for (int y = 0; y < size[1]; ++y) {
    for (int z = 0; z < size[2]; ++z) {
      for (int x = 0; x < size[0]; ++x) {
        const std::string& block = palette.at(next());
        if (block != "minecraft:air") blocks[{x, y, z}] = block;
      }
    }
  }
  return blocks;
}

std::array<int, 3> sides(const Nbt& x, const Nbt& y, const Nbt& z) {
  return {static_cast<int>(x.number()), static_cast<int>(y.number()), static_cast<int>(z.number())};
}

Blocks read_schem(const Nbt& root, std::array<int, 3>& size) {
  const bool is_third = root.members.contains("Schematic");
  const Nbt& schematic = is_third ? root["Schematic"] : root;
  EXPECT_EQ(schematic["Version"].number(), is_third ? 3 : 2);
  const Nbt& holder = is_third ? schematic["Blocks"] : schematic;
  std::vector<std::string> palette(holder["Palette"].members.size());
  for (const auto& [name, index] : holder["Palette"].members) {
    palette.at(static_cast<size_t>(index.number())) = name;
  }
  if (!is_third) {
    EXPECT_EQ(schematic["PaletteMax"].number(), static_cast<int64_t>(palette.size()));
  }
  const std::vector<int64_t>& data = holder[is_third ? "Data" : "BlockData"].numbers;
  size = sides(schematic["Width"], schematic["Height"], schematic["Length"]);
  size_t at = 0;
  Blocks blocks = blocks_in_order(size, palette, [&] {
    size_t value = 0;
    for (unsigned shift = 0;; shift += 7) {
      const auto byte = static_cast<uint8_t>(data.at(at++));
      value |= size_t{byte & 127u} << shift;
      if (byte < 128) return value;
    }
  });
  EXPECT_EQ(at, data.size());
  return blocks;
}

std::vector<std::string> palette_names(const Nbt& list) {
  std::vector<std::string> names;
  for (const Nbt& state : list.items) names.push_back(state["Name"].text);
  return names;
}

// The index of bits [i * bits, (i + 1) * bits), bit by bit.
size_t unpacked(const std::vector<int64_t>& longs, size_t i, unsigned bits) {
  size_t value = 0;
  for (unsigned k = 0; k < bits; ++k) {
    const size_t bit = i * bits + k;
    value |= static_cast<size_t>(static_cast<uint64_t>(longs.at(bit / 64)) >> (bit % 64) & 1) << k;
  }
  return value;
}

Blocks read_litematic(const Nbt& root, std::array<int, 3>& size) {
  EXPECT_EQ(root["Version"].number(), 6);
  const Nbt& region = root["Regions"]["voxeld grid"];
  size = sides(region["Size"]["x"], region["Size"]["y"], region["Size"]["z"]);
  const std::vector<std::string> palette = palette_names(region["BlockStatePalette"]);
  unsigned bits = 2;
  while ((size_t{1} << bits) < palette.size()) ++bits;
  const std::vector<int64_t>& longs = region["BlockStates"].numbers;
  size_t cell = 0;
  Blocks blocks = blocks_in_order(size, palette, [&] { return unpacked(longs, cell++, bits); });
  EXPECT_EQ(longs.size(), (cell * bits + 63) / 64);
  const Nbt& metadata = root["Metadata"];
  EXPECT_EQ(metadata["TotalVolume"].number(), static_cast<int64_t>(cell));
  EXPECT_EQ(metadata["TotalBlocks"].number(), static_cast<int64_t>(blocks.size()));
  EXPECT_EQ(sides(metadata["EnclosingSize"]["x"], metadata["EnclosingSize"]["y"],
                  metadata["EnclosingSize"]["z"]),
            size);
  return blocks;
}

Blocks read_structure(const Nbt& root, std::array<int, 3>& size) {
  const std::vector<std::string> palette = palette_names(root["palette"]);
  for (size_t c = 0; c < 3; ++c) size[c] = static_cast<int>(root["size"].items.at(c).number());
  Blocks blocks;
  for (const Nbt& block : root["blocks"].items) {
    const std::vector<Nbt>& at = block["pos"].items;
    const std::string& name = palette.at(static_cast<size_t>(block["state"].number()));
    EXPECT_TRUE(blocks.emplace(sides(at.at(0), at.at(1), at.at(2)), name).second);
  }
  return blocks;
}

Blocks blocks_of(const Grid& grid, const OutputOptions& options) {
  const Nbt root = written(grid, options);
  std::array<int, 3> size{};
  Blocks blocks = options.format == Format::kSchem       ? read_schem(root, size)
                  : options.format == Format::kLitematic ? read_litematic(root, size)
                                                         : read_structure(root, size);
  EXPECT_EQ(size, (std::array{grid.spec.dims.x, grid.spec.dims.y, grid.spec.dims.z}));
  return blocks;
}

std::string nearest_block(const Rgb& color) {
  const Lab lab = oklab(color);
  const auto distance = [&](const MinecraftBlock& block) {
    const Lab other = oklab(block.color);
    double sum = 0;
    for (size_t c = 0; c < 3; ++c) sum += (lab[c] - other[c]) * (lab[c] - other[c]);
    return sum;
  };
  const auto best = std::ranges::min_element(minecraft_blocks(), {}, distance);
  return "minecraft:" + std::string(best->name);
}

Blocks expected_blocks(const Grid& grid) {
  Blocks blocks;
  const std::string other = nearest_block(mean_color(grid));
  for (const SparseTile& tile : grid.tiles) {
    for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
      const uint8_t* c = voxel == kNoAttributes ? nullptr : &tile.color[4 * voxel];
      blocks[{x, y, z}] = c == nullptr ? other : nearest_block({c[0], c[1], c[2]});
    });
  }
  return blocks;
}

// A voxel of each of the first `count` blocks' own colours, the k-th of them k times.
Grid grid_of_block_colors(size_t count) {
  std::vector<test::TestVoxel> voxels;
  for (size_t k = 1; k <= count; ++k) {
    const auto [r, g, b] = minecraft_blocks()[k - 1].color;
    for (size_t i = 0; i < k; ++i) {
      voxels.push_back({{static_cast<int>(i), static_cast<int>(k % 16), static_cast<int>(k / 16)},
                        {r, g, b, 255},
                        {}});
    }
  }
  return test::grid_of({150, 16, 10}, voxels, true, false);
}

Grid two_stones_and_a_gap() {
  Grid grid = test::grid_of({3, 1, 1}, {{{0, 0, 0}, {}, {}}, {{2, 0, 0}, {}, {}}}, false, false);
  grid.spec.origin_world = {0, 0, 0};
  grid.spec.voxel_size = {1, 1, 1};
  grid.meta = GridMeta();
  return grid;
}

TEST(Minecraft, every_cell_has_the_block_nearest_to_its_colour) {
  const Grid grids[] = {test::random_grid(3, {21, 17, 13}, 900, true, false),
                        test::random_grid(4, {300, 9, 270}, 2000, true, false),
                        test::grid_with_a_full_brick(true, false)};
  for (const Grid& grid : grids) {
    const Blocks expected = expected_blocks(grid);
    for (const Format format : kBlockFormats) {
      EXPECT_EQ(blocks_of(grid, to_blocks(format)), expected) << format_name(format);
    }
    OutputOptions third = to_blocks(Format::kSchem);
    third.schem_version = 3;
    EXPECT_EQ(blocks_of(grid, third), expected);
  }
}

TEST(Minecraft, voxels_inside_of_a_solid_have_the_block_of_the_mean_colour) {
  const Grid grid = test::grid_of(
      {16, 16, 16}, {{.cell = {0, 0, 0}, .color = {200, 10, 10, 255}}, {.cell = {1, 0, 0}}},
      ChannelSet{.color = true});
  const std::string red = nearest_block({200, 10, 10});
  const Blocks expected = {{{0, 0, 0}, red}, {{1, 0, 0}, red}};
  for (const Format format : kBlockFormats) {
    for (const Dither dither : {Dither::kNone, Dither::kError}) {
      OutputOptions options = to_blocks(format);
      options.dither = dither;
      EXPECT_EQ(blocks_of(grid, options), expected) << format_name(format);
    }
  }
}

TEST(Minecraft, pieces_of_a_large_grid_fit_together) {
  // 1.4 million cells with rows that no piece's end falls between.
  Grid grid = test::random_grid(6, {131, 103, 107}, 4000, true, false);
  // A full node of 32 cells on a side across the end of the first piece, which is in layer 74.
  std::erase_if(grid.tiles[0].full, [](const FullNode&) { return true; });
  SparseTile& tile = grid.tiles[0];
  std::vector<test::TestVoxel> outside;
  for_each_voxel(tile, [&](int x, int y, int z, size_t voxel) {
    const bool is_inside = x / 32 == 2 && y / 32 == 2 && z / 32 == 2;
    const uint8_t* c = &tile.color[4 * voxel];
    if (!is_inside) outside.push_back({{x, y, z}, {c[0], c[1], c[2], c[3]}, {}});
  });
  grid = test::grid_of({131, 103, 107}, outside, true, false);
  grid.tiles[0].full = {{morton_encode(8, 8, 8), 2}};
  const Blocks expected = expected_blocks(grid);
  for (const Format format : kBlockFormats) {
    EXPECT_EQ(blocks_of(grid, to_blocks(format)), expected) << format_name(format);
  }
}

TEST(Minecraft, palettes_above_127_entries_have_varints_of_two_bytes) {
  for (const size_t count : {1u, 126u, 127u, 128u, 143u}) {
    ASSERT_LE(count, minecraft_blocks().size());
    const Grid grid = grid_of_block_colors(count);
    const Nbt root = written(grid, to_blocks(Format::kSchem));
    const auto& palette = root["Palette"].members;
    ASSERT_EQ(palette.size(), count + 1);  // and air
    // The rarest blocks, of 1, 2, … voxels, have the highest indices.
    const size_t longer = palette.size() > 128 ? palette.size() - 128 : 0;
    EXPECT_EQ(root["BlockData"].numbers.size(), 150 * 16 * 10 + longer * (longer + 1) / 2);
    const std::string first = "minecraft:" + std::string(minecraft_blocks()[0].name);
    EXPECT_EQ(palette.at(first).number(), static_cast<int64_t>(count));
    std::array<int, 3> size{};
    const Blocks expected = expected_blocks(grid);
    EXPECT_EQ(read_schem(root, size), expected);
    EXPECT_EQ(blocks_of(grid, to_blocks(Format::kLitematic)), expected);
    EXPECT_EQ(blocks_of(grid, to_blocks(Format::kNbt)), expected);
  }
}

TEST(Minecraft, indices_have_as_many_bits_as_the_palette_needs_and_at_least_two) {
  const std::pair<size_t, unsigned> cases[] = {{1, 2},   {2, 2},   {4, 2},   {5, 3},
                                               {8, 3},   {9, 4},   {16, 4},  {17, 5},
                                               {128, 7}, {129, 8}, {144, 8}, {256, 8}};
  for (const auto& [names, bits] : cases) EXPECT_EQ(minecraft::index_bits(names), bits) << names;
}

TEST(Minecraft, packed_indices_span_longs) {
  std::mt19937 random(9);
  for (unsigned bits = 2; bits <= 8; ++bits) {
    for (const size_t count : {1, 12, 13, 63, 64, 65, 127, 128, 1000}) {
      std::vector<uint8_t> indices(count), bytes = {1, 2, 3};
      for (uint8_t& index : indices) {
        // Long runs of air among others.
        index =
            count > 200 && random() % 100 != 0 ? 0 : static_cast<uint8_t>(random() % (1u << bits));
      }
      minecraft::pack_indices(indices, bits, bytes);
      ASSERT_EQ(bytes.size(), (count * bits + 63) / 64 * 8);
      std::vector<int64_t> longs;
      for (size_t i = 0; i < bytes.size(); i += 8) {
        uint64_t value = 0;
        for (size_t k = 0; k < 8; ++k) value = value << 8 | bytes[i + k];
        longs.push_back(static_cast<int64_t>(value));
      }
      for (size_t i = 0; i < count; ++i) {
        ASSERT_EQ(unpacked(longs, i, bits), indices[i]) << bits << " " << count << " " << i;
      }
      for (size_t bit = count * bits; bit < 64 * longs.size(); ++bit) {
        EXPECT_EQ(static_cast<uint64_t>(longs[bit / 64]) >> (bit % 64) & 1, 0u);
      }
    }
  }
}

TEST(Minecraft, a_tiny_schem_has_these_bytes) {
  const auto bytes = encode(two_stones_and_a_gap(), to_blocks(Format::kSchem));
  ASSERT_TRUE(bytes);
  EXPECT_EQ(hex_text(std::span(*bytes).first(10)), "1f8b08000000000000ff");
  const std::vector<uint8_t> raw = test::gunzipped(*bytes);
  using namespace std::string_literals;
  const std::string one = "\x3f\xf0\0\0\0\0\0\0"s, zero(8, '\0');
  const std::string expected =
      "\x0a\0\x09Schematic"s
      "\x03\0\x07Version\0\0\0\x02"s
      "\x03\0\x0b"
      "DataVersion\0\0\x0b\x9f"s
      "\x0a\0\x08Metadata"s
      "\x08\0\x04Name\0\x0bvoxeld grid"s
      "\x08\0\x06"
      "Author\0\x06voxeld"s
      "\x03\0\x09WEOffsetX\0\0\0\0"s
      "\x03\0\x09WEOffsetY\0\0\0\0"s
      "\x03\0\x09WEOffsetZ\0\0\0\0"s
      "\x0a\0\x06voxeld"s
      "\x09\0\x06origin\x06\0\0\0\x03"s +
      zero + zero + zero + "\x09\0\x0avoxel_size\x06\0\0\0\x03"s + one + one + one +
      "\0\0"s
      "\x02\0\x05Width\0\x03"s
      "\x02\0\x06Height\0\x01"s
      "\x02\0\x06Length\0\x01"s
      "\x0b\0\x06Offset\0\0\0\x03\0\0\0\0\0\0\0\0\0\0\0\0"s
      "\x03\0\x0aPaletteMax\0\0\0\x02"s
      "\x0a\0\x07Palette"s
      "\x03\0\x0dminecraft:air\0\0\0\0"s
      "\x03\0\x0fminecraft:stone\0\0\0\x01"s
      "\0"s
      "\x07\0\x09"
      "BlockData\0\0\0\x03\x01\0\x01"s
      "\x09\0\x0d"
      "BlockEntities\0\0\0\0\0"s
      "\0"s;
  EXPECT_EQ(std::string(raw.begin(), raw.end()), expected);
}

TEST(Minecraft, a_tiny_litematic_and_structure_have_these_bytes_of_blocks) {
  const auto raw_of = [](Format format) {
    const auto bytes = encode(two_stones_and_a_gap(), to_blocks(format));
    EXPECT_TRUE(bytes);
    const std::vector<uint8_t> raw = test::gunzipped(*bytes);
    return std::string(raw.begin(), raw.end());
  };
  using namespace std::string_literals;
  EXPECT_NE(raw_of(Format::kLitematic)
                .find("\x09\0\x11"
                      "BlockStatePalette\x0a\0\0\0\x02"
                      "\x08\0\x04Name\0\x0dminecraft:air\0"
                      "\x08\0\x04Name\0\x0fminecraft:stone\0"
                      "\x0c\0\x0b"
                      "BlockStates\0\0\0\x01\0\0\0\0\0\0\0\x11"
                      "\x09\0\x08"
                      "Entities\0\0\0\0\0"
                      "\x09\0\x0cTileEntities\0\0\0\0\0"
                      "\x09\0\x11PendingBlockTicks\0\0\0\0\0"
                      "\x09\0\x11PendingFluidTicks\0\0\0\0\0\0\0\0"s),
            std::string::npos);
  EXPECT_NE(
      raw_of(Format::kNbt)
          .find("\x09\0\x04size\x03\0\0\0\x03\0\0\0\x03\0\0\0\x01\0\0\0\x01"
                "\x09\0\x07palette\x0a\0\0\0\x01\x08\0\x04Name\0\x0fminecraft:stone\0"
                "\x09\0\x06"
                "blocks\x0a\0\0\0\x02"
                "\x09\0\x03pos\x03\0\0\0\x03\0\0\0\0\0\0\0\0\0\0\0\0\x03\0\x05state\0\0\0\0\0"
                "\x09\0\x03pos\x03\0\0\0\x03\0\0\0\x02\0\0\0\0\0\0\0\0\x03\0\x05state\0\0\0\0\0"
                "\x09\0\x08"
                "entities\0\0\0\0\0\0"s),
      std::string::npos);
}

TEST(Minecraft, files_name_their_version_and_author_and_carry_the_place) {
  Grid grid = two_stones_and_a_gap();
  grid.spec.origin_world = {-1.5, 0.25, 1e10};
  grid.spec.voxel_size = {0.5, 0.25, 0.125};
  grid.meta = GridMeta::parse(R"({"units":"mm"})");
  std::string name;
  const Nbt second = written(grid, to_blocks(Format::kSchem), &name);
  EXPECT_EQ(name, "Schematic");
  OutputOptions options = to_blocks(Format::kSchem);
  options.schem_version = 3;
  const Nbt third = written(grid, options, &name);
  EXPECT_EQ(name, "");
  EXPECT_FALSE(third["Schematic"]["Metadata"].members.contains("WEOffsetX"));
  const Nbt litematic = written(grid, to_blocks(Format::kLitematic), &name);
  EXPECT_EQ(name, "");
  EXPECT_EQ(litematic["Metadata"]["TimeCreated"].number(), 0);
  EXPECT_EQ(litematic["Metadata"]["RegionCount"].number(), 1);
  const Nbt structure = written(grid, to_blocks(Format::kNbt), &name);
  EXPECT_EQ(name, "");
  EXPECT_EQ(structure["author"].text, "voxeld");
  for (const auto& [version, metadata] :
       {std::pair(&second["DataVersion"], &second["Metadata"]),
        std::pair(&third["Schematic"]["DataVersion"], &third["Schematic"]["Metadata"]),
        std::pair(&litematic["MinecraftDataVersion"], &litematic["Metadata"]),
        std::pair(&structure["DataVersion"], &structure)}) {
    EXPECT_EQ(version->number(), 2975);
    if (metadata != &structure) {
      EXPECT_EQ((*metadata)["Author"].text, "voxeld");
      EXPECT_EQ((*metadata)["Name"].text, "voxeld grid");
    }
    const Nbt& place = (*metadata)["voxeld"];
    EXPECT_EQ(place["units"].text, "mm");
    for (int c = 0; c < 3; ++c) {
      const auto i = static_cast<size_t>(c);
      EXPECT_EQ(place["origin"].items.at(i).real, grid.spec.origin_world[c]);
      EXPECT_EQ(place["voxel_size"].items.at(i).real, grid.spec.voxel_size[c]);
    }
  }
}

TEST(Minecraft, a_grid_without_colours_is_of_stone_or_of_the_greyest_block_that_there_is) {
  const Grid grid = test::random_grid(2, {9, 9, 9}, 60, false, true);
  for (const Format format : kBlockFormats) {
    for (const auto& [names, block] :
         {std::pair<std::vector<std::string>, std::string>{{}, "stone"},
          {{"wool", "minecraft:stone"}, "stone"},
          {{"terracotta", "quartz", "diorite"}, "diorite"}}) {
      const Blocks blocks = blocks_of(grid, to_blocks(format, names));
      EXPECT_EQ(blocks.size(), grid.voxel_count());
      for (const auto& [cell, name] : blocks) EXPECT_EQ(name, "minecraft:" + block);
    }
  }
}

TEST(Minecraft, ids_give_blocks_where_there_are_no_colours) {
  std::vector<test::TestVoxel> voxels;
  for (int i = 0; i < 6; ++i) {
    test::TestVoxel voxel{{i, 0, 0}, {}, {}};
    voxel.label = static_cast<uint16_t>(i);
    voxels.push_back(voxel);
  }
  const Grid grid = test::grid_of({6, 1, 1}, voxels, {.label = true});
  const Blocks blocks = blocks_of(grid, to_blocks(Format::kSchem));
  for (int i = 0; i < 6; ++i) {
    EXPECT_EQ(blocks.at({i, 0, 0}), nearest_block(id_color(static_cast<uint16_t>(i))));
  }
  EXPECT_NE(blocks.at({1, 0, 0}), blocks.at({2, 0, 0}));
  EXPECT_TRUE(block_warnings(grid, Format::kSchem).empty() ||
              block_warnings(grid, Format::kSchem)[0].code != "lost-channels");
}

TEST(Minecraft, blocks_are_those_that_are_named_and_dither_mixes_them) {
  const Grid grid = test::random_grid(3, {21, 17, 13}, 900, true, false);
  for (const Dither dither : {Dither::kNone, Dither::kBayer, Dither::kError}) {
    OutputOptions options = to_blocks(Format::kSchem, {"concrete", "stone_bricks"});
    options.dither = dither;
    std::map<std::string, size_t> counts;
    for (const auto& [cell, name] : blocks_of(grid, options)) ++counts[name];
    EXPECT_GT(counts.size(), 10u);
    for (const auto& [name, count] : counts) {
      EXPECT_TRUE(name.ends_with("_concrete") || name == "minecraft:stone_bricks") << name;
    }
  }
  OutputOptions dithered = to_blocks(Format::kSchem);
  dithered.dither = Dither::kError;
  EXPECT_NE(blocks_of(grid, dithered), blocks_of(grid, to_blocks(Format::kSchem)));
}

TEST(Minecraft, an_empty_grid_is_air) {
  Grid grid;
  grid.spec.dims = {5, 4, 3};
  for (const Format format : kBlockFormats) {
    EXPECT_TRUE(blocks_of(grid, to_blocks(format)).empty()) << format_name(format);
  }
}

TEST(Minecraft, equal_grids_give_equal_bytes) {
  const Grid grid = test::random_grid(6, {131, 103, 107}, 4000, true, false);
  for (const Format format : kBlockFormats) {
    for (const Dither dither : {Dither::kNone, Dither::kBayer, Dither::kError}) {
      OutputOptions options = to_blocks(format);
      options.dither = dither;
      EXPECT_EQ(encode(grid, options).value(), encode(grid, options).value());
    }
  }
}

TEST(Minecraft, more_cells_than_nbt_counts_are_refused_before_anything_is_computed) {
  GridSpec spec;
  spec.dims = {2048, 1024, 1024};  // 2^31
  for (const Format format : {Format::kSchem, Format::kLitematic}) {
    const Status status = check_encodable(spec, test::to(format));
    ASSERT_FALSE(status);
    EXPECT_EQ(status.error().code, ErrorCode::kGridTooLarge);
    EXPECT_EQ(status.error().message(),
              std::string(format_name(format)) +
                  ": too many cells: expected at most 2147483647, got 2147483648");
  }
  EXPECT_TRUE(check_encodable(spec, test::to(Format::kNbt)));
  spec.dims = {2048, 1024, 1023};
  for (const Format format : kBlockFormats) EXPECT_TRUE(check_encodable(spec, test::to(format)));
  EXPECT_EQ(minecraft::check_count(Format::kSchem, "bytes of blocks", 1u << 31, 0x7fffffff)
                .error()
                .message(),
            "schem: too many bytes of blocks: expected at most 2147483647, got 2147483648");
}

TEST(Minecraft, more_blocks_than_a_structure_may_have_are_refused_before_they_are_written) {
  Grid grid;
  grid.spec.dims = {5 * limits::kTileSide, limits::kTileSide, limits::kTileSide};
  for (int x = 0; x < 5; ++x) {
    SparseTile tile;
    tile.coord = {x, 0, 0};
    tile.full = {{0, x < 4 ? kTileLevels : 0}};
    grid.tiles.push_back(tile);
  }
  EXPECT_EQ(encode(grid, test::to(Format::kNbt)).error().message(),
            "nbt: too many blocks for a structure: expected at most 67108864, got 67109376");
}

std::map<std::string, std::string> warnings_of(const Grid& grid, Format format) {
  std::map<std::string, std::string> texts;
  for (const Warning& warning : encode_warnings(grid, test::to(format))) {
    texts[warning.code] = warning.detail;
  }
  return texts;
}

TEST(Minecraft, warnings_name_what_a_file_cannot_hold) {
  using Texts = std::map<std::string, std::string>;
  Grid plain = two_stones_and_a_gap();
  for (const Format format : kBlockFormats) EXPECT_EQ(warnings_of(plain, format), Texts());
  plain.meta = GridMeta::parse(R"({"units":"m"})");
  EXPECT_EQ(warnings_of(plain, Format::kSchem), Texts());
  plain.spec.dims = {49, 385, 3};
  EXPECT_EQ(warnings_of(plain, Format::kLitematic),
            (Texts{{"outside-world", "litematic: a world is 384 blocks high, the grid 385"}}));
  EXPECT_EQ(warnings_of(plain, Format::kNbt),
            (Texts{{"outside-world", "nbt: a world is 384 blocks high, the grid 385"},
                   {"large-structure",
                    "nbt: a structure block loads at most 48 x 48 x 48 "
                    "blocks, the grid has 49 x 385 x 3"}}));
  const Grid rich = test::grid_of({9, 9, 9}, {{{0, 0, 0}, {1, 2, 3, 128}, {}}},
                                  {.color = true, .normal = true, .coverage = true});
  EXPECT_EQ(
      warnings_of(rich, Format::kSchem),
      (Texts{{"lost-channels", "schem: blocks have no place for normal, coverage"},
             {"lost-alpha", "schem: blocks have no alpha"},
             {"not-metres", "schem: a block is 1 m, a voxel of this grid 0.5 x 0.25 x 0.125 mm"}}));
}

TEST(Minecraft, a_voxel_of_a_metre_in_any_unit_has_no_warning) {
  Grid grid;
  grid.spec.dims = {4, 4, 4};
  for (const auto& [units, size] : {std::pair{"m", 1.0},
                                    {"cm", 100.0},
                                    {"mm", 1000.0},
                                    {"ft", 1 / 0.3048},
                                    {"in", 1 / 0.0254}}) {
    grid.meta = GridMeta::parse(std::string(R"({"units":")") + units + "\"}");
    grid.spec.voxel_size = glm::dvec3(size);
    EXPECT_EQ(warnings_of(grid, Format::kSchem).size(), 0u) << units;
    grid.spec.voxel_size.y *= 1.001;
    EXPECT_EQ(warnings_of(grid, Format::kSchem).size(), 1u) << units;
  }
}

}  // namespace
}  // namespace voxeld
