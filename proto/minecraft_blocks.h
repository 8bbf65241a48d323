// Blocks of Minecraft that stand for colours: the ones that the option `blocks` names, and from
// which the encoders choose.
#pragma once

#include <array>
#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "proto/output_format.h"
#include "proto/result.h"

namespace voxeld {

// A full, opaque cube without block states. None falls, gives light, or needs water or power.
struct MinecraftBlock {
  std::string_view name;         // "white_concrete", without "minecraft:"
  std::string_view group;        // "concrete"
  std::array<uint8_t, 3> color;  // sRGB, the mean of its sides as an estimate
};

// The game's version whose blocks these are: Java Edition 1.18.2. Later games convert its files.
inline constexpr int kMinecraftDataVersion = 2975;

// All blocks, group by group.
std::span<const MinecraftBlock> minecraft_blocks();
// The names of the groups, in the order of the blocks.
std::span<const std::string_view> minecraft_block_groups();

// Whether files of the format hold blocks.
constexpr bool holds_blocks(Format format) {
  return format == Format::kSchem || format == Format::kLitematic || format == Format::kNbt;
}

// Names of groups and blocks in their canonical form: groups before blocks, both in the order of
// minecraft_blocks(), each once, and no block of a group that is named. A name of both is the
// group's; "minecraft:stone" is always the block. Errors: invalid-option with the option's name,
// the groups and the nearest name for an unknown one.
Result<std::vector<std::string>> canonical_block_names(std::string_view option,
                                                       std::span<const std::string_view> names);
// The blocks of canonical names, in the order of minecraft_blocks(); of no names: all.
std::vector<MinecraftBlock> blocks_named(std::span<const std::string> names);

}  // namespace voxeld
