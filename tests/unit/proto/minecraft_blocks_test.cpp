#include "proto/minecraft_blocks.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <map>
#include <set>

namespace voxeld {
namespace {

size_t count_of(std::string_view group) {
  return static_cast<size_t>(std::ranges::count(minecraft_blocks(), group, &MinecraftBlock::group));
}

TEST(MinecraftBlocks, are_enough_for_indices_of_two_bytes_and_few_enough_for_one_byte_each) {
  EXPECT_GT(minecraft_blocks().size(), 127u);
  EXPECT_LT(minecraft_blocks().size(), 255u);
}

TEST(MinecraftBlocks, have_names_and_colours_of_their_own_and_groups_that_are_whole) {
  std::set<std::string_view> names;
  std::set<std::array<uint8_t, 3>> colors;
  for (const MinecraftBlock& block : minecraft_blocks()) {
    EXPECT_TRUE(names.insert(block.name).second) << block.name;
    EXPECT_TRUE(colors.insert(block.color).second) << block.name;
    EXPECT_EQ(block.name.find_first_not_of("abcdefghijklmnopqrstuvwxyz_"), std::string_view::npos);
    for (const uint8_t component : block.color) EXPECT_EQ(component % 5, 0) << block.name;
  }
  std::set<std::string_view> groups(minecraft_block_groups().begin(),
                                    minecraft_block_groups().end());
  EXPECT_EQ(groups.size(), minecraft_block_groups().size());
}

TEST(MinecraftBlocks, of_dyes_are_complete_and_none_falls) {
  EXPECT_EQ(count_of("concrete"), 16u);
  EXPECT_EQ(count_of("wool"), 16u);
  EXPECT_EQ(count_of("terracotta"), 17u);
  for (const MinecraftBlock& block : minecraft_blocks()) {
    EXPECT_EQ(block.name.find("powder"), std::string_view::npos);
    EXPECT_EQ(block.name.find("glazed"), std::string_view::npos);
    EXPECT_TRUE(block.name != "sand" && block.name != "red_sand" && block.name != "gravel");
  }
}

TEST(MinecraftBlocks, are_found_by_group_by_name_and_all_by_none) {
  const auto named = [](std::vector<std::string> names) {
    std::vector<std::string_view> found;
    for (const MinecraftBlock& block : blocks_named(names)) found.push_back(block.name);
    return found;
  };
  EXPECT_EQ(named({}).size(), minecraft_blocks().size());
  EXPECT_EQ(
      named({"end", "red_wool"}),
      (std::vector<std::string_view>{"red_wool", "end_stone", "end_stone_bricks", "purpur_block"}));
  EXPECT_EQ(named({"stone"}).size(), count_of("stone"));
  EXPECT_EQ(named({"minecraft:stone"}), std::vector<std::string_view>{"stone"});
  EXPECT_EQ(named({"terracotta"}).size(), 17u);
}

}  // namespace
}  // namespace voxeld
