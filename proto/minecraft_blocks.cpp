#include "proto/minecraft_blocks.h"

#include <algorithm>
#include <set>

#include "proto/text/client_texts.h"
#include "proto/text/near_miss.h"

namespace voxeld {
namespace {

constexpr std::string_view kNamespace = "minecraft:";

// The colours are this project's estimates of how the sides look in daylight with the game's own
// textures, rounded to multiples of 5. They are not measured, and no file of the game is part of
// them.
constexpr MinecraftBlock kBlocks[] = {
    {"white_concrete", "concrete", {205, 210, 210}},
    {"orange_concrete", "concrete", {225, 95, 0}},
    {"magenta_concrete", "concrete", {170, 50, 160}},
    {"light_blue_concrete", "concrete", {35, 135, 200}},
    {"yellow_concrete", "concrete", {240, 175, 20}},
    {"lime_concrete", "concrete", {95, 170, 25}},
    {"pink_concrete", "concrete", {215, 100, 145}},
    {"gray_concrete", "concrete", {55, 60, 60}},
    {"light_gray_concrete", "concrete", {125, 125, 115}},
    {"cyan_concrete", "concrete", {20, 120, 135}},
    {"purple_concrete", "concrete", {100, 30, 155}},
    {"blue_concrete", "concrete", {45, 45, 145}},
    {"brown_concrete", "concrete", {95, 60, 30}},
    {"green_concrete", "concrete", {75, 90, 35}},
    {"red_concrete", "concrete", {140, 35, 35}},
    {"black_concrete", "concrete", {10, 10, 15}},
    {"terracotta", "terracotta", {150, 95, 65}},
    {"white_terracotta", "terracotta", {210, 180, 160}},
    {"orange_terracotta", "terracotta", {160, 85, 40}},
    {"magenta_terracotta", "terracotta", {150, 90, 110}},
    {"light_blue_terracotta", "terracotta", {115, 110, 140}},
    {"yellow_terracotta", "terracotta", {185, 135, 35}},
    {"lime_terracotta", "terracotta", {105, 120, 55}},
    {"pink_terracotta", "terracotta", {160, 80, 80}},
    {"gray_terracotta", "terracotta", {60, 40, 35}},
    {"light_gray_terracotta", "terracotta", {135, 105, 100}},
    {"cyan_terracotta", "terracotta", {85, 90, 90}},
    {"purple_terracotta", "terracotta", {120, 70, 85}},
    {"blue_terracotta", "terracotta", {75, 60, 90}},
    {"brown_terracotta", "terracotta", {75, 50, 35}},
    {"green_terracotta", "terracotta", {75, 85, 40}},
    {"red_terracotta", "terracotta", {145, 60, 45}},
    {"black_terracotta", "terracotta", {35, 25, 15}},
    {"white_wool", "wool", {235, 235, 235}},
    {"orange_wool", "wool", {240, 120, 20}},
    {"magenta_wool", "wool", {190, 70, 180}},
    {"light_blue_wool", "wool", {60, 175, 215}},
    {"yellow_wool", "wool", {250, 200, 40}},
    {"lime_wool", "wool", {110, 185, 25}},
    {"pink_wool", "wool", {240, 140, 170}},
    {"gray_wool", "wool", {60, 70, 70}},
    {"light_gray_wool", "wool", {140, 140, 135}},
    {"cyan_wool", "wool", {20, 140, 145}},
    {"purple_wool", "wool", {120, 40, 170}},
    {"blue_wool", "wool", {55, 55, 155}},
    {"brown_wool", "wool", {115, 70, 40}},
    {"green_wool", "wool", {85, 110, 25}},
    {"red_wool", "wool", {160, 40, 35}},
    {"black_wool", "wool", {20, 20, 25}},
    {"oak_planks", "planks", {160, 130, 80}},
    {"spruce_planks", "planks", {115, 85, 50}},
    {"birch_planks", "planks", {190, 175, 120}},
    {"jungle_planks", "planks", {160, 115, 80}},
    {"acacia_planks", "planks", {170, 90, 50}},
    {"dark_oak_planks", "planks", {65, 45, 20}},
    {"crimson_planks", "planks", {100, 50, 70}},
    {"warped_planks", "planks", {45, 105, 100}},
    {"stone", "stone", {125, 125, 125}},
    {"smooth_stone", "stone", {160, 160, 160}},
    {"cobblestone", "stone", {130, 125, 125}},
    {"mossy_cobblestone", "stone", {110, 120, 95}},
    {"stone_bricks", "stone", {120, 120, 120}},
    {"mossy_stone_bricks", "stone", {115, 120, 105}},
    {"cracked_stone_bricks", "stone", {120, 115, 115}},
    {"granite", "stone", {150, 105, 85}},
    {"polished_granite", "stone", {155, 105, 90}},
    {"diorite", "stone", {190, 190, 190}},
    {"polished_diorite", "stone", {195, 195, 195}},
    {"andesite", "stone", {135, 135, 135}},
    {"polished_andesite", "stone", {130, 135, 135}},
    {"calcite", "stone", {225, 225, 220}},
    {"tuff", "stone", {110, 110, 100}},
    {"dripstone_block", "stone", {135, 110, 95}},
    {"bricks", "stone", {150, 100, 85}},
    {"cobbled_deepslate", "deepslate", {75, 75, 80}},
    {"polished_deepslate", "deepslate", {70, 70, 75}},
    {"deepslate_bricks", "deepslate", {70, 70, 70}},
    {"cracked_deepslate_bricks", "deepslate", {65, 65, 65}},
    {"deepslate_tiles", "deepslate", {55, 55, 55}},
    {"cracked_deepslate_tiles", "deepslate", {50, 50, 55}},
    {"chiseled_deepslate", "deepslate", {55, 55, 60}},
    {"blackstone", "blackstone", {40, 35, 40}},
    {"polished_blackstone", "blackstone", {55, 50, 55}},
    {"polished_blackstone_bricks", "blackstone", {50, 45, 50}},
    {"cracked_polished_blackstone_bricks", "blackstone", {45, 40, 45}},
    {"gilded_blackstone", "blackstone", {55, 45, 40}},
    {"smooth_basalt", "blackstone", {70, 70, 80}},
    {"obsidian", "blackstone", {15, 10, 25}},
    {"sandstone", "sandstone", {215, 205, 155}},
    {"smooth_sandstone", "sandstone", {225, 215, 170}},
    {"cut_sandstone", "sandstone", {220, 205, 160}},
    {"red_sandstone", "sandstone", {185, 100, 30}},
    {"smooth_red_sandstone", "sandstone", {180, 95, 30}},
    {"cut_red_sandstone", "sandstone", {190, 100, 35}},
    {"netherrack", "nether", {95, 40, 40}},
    {"nether_bricks", "nether", {45, 20, 25}},
    {"cracked_nether_bricks", "nether", {40, 20, 25}},
    {"chiseled_nether_bricks", "nether", {50, 25, 30}},
    {"red_nether_bricks", "nether", {70, 5, 10}},
    {"nether_wart_block", "nether", {115, 0, 0}},
    {"warped_wart_block", "nether", {20, 120, 120}},
    {"soul_soil", "nether", {75, 55, 45}},
    {"end_stone", "end", {220, 225, 160}},
    {"end_stone_bricks", "end", {220, 225, 165}},
    {"purpur_block", "end", {170, 125, 170}},
    {"prismarine", "prismarine", {100, 155, 150}},
    {"prismarine_bricks", "prismarine", {100, 170, 160}},
    {"dark_prismarine", "prismarine", {50, 90, 75}},
    {"quartz_block", "quartz", {235, 230, 225}},
    {"smooth_quartz", "quartz", {235, 230, 220}},
    {"quartz_bricks", "quartz", {235, 225, 220}},
    {"chiseled_quartz_block", "quartz", {230, 225, 220}},
    {"iron_block", "mineral", {220, 220, 220}},
    {"gold_block", "mineral", {245, 210, 60}},
    {"diamond_block", "mineral", {100, 235, 230}},
    {"emerald_block", "mineral", {40, 205, 90}},
    {"lapis_block", "mineral", {30, 65, 140}},
    {"coal_block", "mineral", {15, 15, 15}},
    {"netherite_block", "mineral", {65, 60, 65}},
    {"amethyst_block", "mineral", {135, 95, 190}},
    {"raw_iron_block", "mineral", {165, 135, 105}},
    {"raw_gold_block", "mineral", {220, 170, 45}},
    {"raw_copper_block", "mineral", {155, 105, 80}},
    {"waxed_copper_block", "copper", {190, 110, 80}},
    {"waxed_exposed_copper", "copper", {160, 125, 105}},
    {"waxed_weathered_copper", "copper", {110, 155, 110}},
    {"waxed_oxidized_copper", "copper", {80, 160, 130}},
    {"waxed_cut_copper", "copper", {190, 105, 80}},
    {"waxed_exposed_cut_copper", "copper", {155, 120, 100}},
    {"waxed_weathered_cut_copper", "copper", {110, 145, 110}},
    {"waxed_oxidized_cut_copper", "copper", {80, 155, 125}},
    {"dirt", "earth", {135, 95, 65}},
    {"coarse_dirt", "earth", {120, 85, 60}},
    {"rooted_dirt", "earth", {145, 105, 75}},
    {"clay", "earth", {160, 165, 180}},
    {"moss_block", "earth", {90, 110, 45}},
    {"snow_block", "earth", {250, 255, 255}},
    {"packed_ice", "earth", {140, 180, 250}},
    {"blue_ice", "earth", {115, 170, 250}},
    {"pumpkin", "plant", {195, 115, 25}},
    {"melon", "plant", {115, 145, 30}},
    {"dried_kelp_block", "plant", {50, 60, 40}},
    {"honeycomb_block", "plant", {230, 150, 30}},
};

bool is_block(std::string_view name) {
  return std::ranges::find(kBlocks, name, &MinecraftBlock::name) != std::end(kBlocks);
}

bool is_group(std::string_view name) {
  return std::ranges::find(kBlocks, name, &MinecraftBlock::group) != std::end(kBlocks);
}

Error unknown_block(std::string_view option, std::string_view name) {
  std::string expected = "names of blocks or of groups:";
  std::vector<std::string_view> known;
  for (const std::string_view group : minecraft_block_groups()) {
    expected += (known.empty() ? " " : ", ") + std::string(group);
    known.push_back(group);
  }
  for (const MinecraftBlock& block : kBlocks) known.push_back(block.name);
  if (const std::string_view near = near_miss(name, known); !near.empty()) {
    expected += "; did you mean '" + std::string(near) + "'?";
  }
  return {ErrorCode::kInvalidOption, std::string(option), expected, echoed(name)};
}

}  // namespace

std::span<const MinecraftBlock> minecraft_blocks() {
  return kBlocks;
}

std::span<const std::string_view> minecraft_block_groups() {
  static const std::vector<std::string_view> groups = [] {
    std::vector<std::string_view> all;
    for (const MinecraftBlock& block : kBlocks) {
      if (all.empty() || all.back() != block.group) all.push_back(block.group);
    }
    return all;
  }();
  return groups;
}

Result<std::vector<std::string>> canonical_block_names(std::string_view option,
                                                       std::span<const std::string_view> names) {
  std::set<std::string_view> groups, blocks;
  for (const std::string_view given : names) {
    const bool is_prefixed = given.starts_with(kNamespace);
    const std::string_view name = given.substr(is_prefixed ? kNamespace.size() : 0);
    if (!is_prefixed && is_group(name)) {
      groups.insert(name);
    } else if (is_block(name)) {
      blocks.insert(name);
    } else {
      return unknown_block(option, given);
    }
  }
  std::vector<std::string> canonical;
  for (const std::string_view group : minecraft_block_groups()) {
    if (groups.contains(group)) canonical.emplace_back(group);
  }
  for (const MinecraftBlock& block : kBlocks) {
    if (!blocks.contains(block.name) || groups.contains(block.group)) continue;
    canonical.push_back(std::string(is_group(block.name) ? kNamespace : "") +
                        std::string(block.name));
  }
  return canonical;
}

std::vector<MinecraftBlock> blocks_named(std::span<const std::string> names) {
  std::vector<MinecraftBlock> found;
  for (const MinecraftBlock& block : kBlocks) {
    const bool is_named = std::ranges::any_of(names, [&](std::string_view name) {
      if (name.starts_with(kNamespace)) return name.substr(kNamespace.size()) == block.name;
      return name == block.group || (name == block.name && !is_group(name));
    });
    if (names.empty() || is_named) found.push_back(block);
  }
  return found;
}

}  // namespace voxeld
