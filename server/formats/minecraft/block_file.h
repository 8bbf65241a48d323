// Parts that the files of all Minecraft formats share, and what they cannot hold.
#pragma once

#include <cstdint>
#include <string>
#include <string_view>
#include <vector>

#include "proto/messages/job.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/formats/minecraft/nbt_writer.h"
#include "server/grid/grid.h"

namespace voxeld::minecraft {

inline constexpr std::string_view kAuthor = "voxeld", kName = "voxeld grid";

// Cells of a schem or litematic, whose tags count them in 31 bits. More: grid-too-large.
inline constexpr int64_t kNbtCountMax = 0x7fffffff;
// Blocks of a structure, each with a record of 36 bytes. More: grid-too-large.
inline constexpr uint64_t kStructureBlocksMax = uint64_t{1} << 26;
// Cells on a side that a structure block of the game loads. More: a warning.
inline constexpr int kStructureSideMax = 48;
// Height of a world since the game's version 1.18. More: a warning.
inline constexpr int kWorldHeight = 384;

// Adds the compound "voxeld": origin and voxel_size (lists of double) and units, which readers of
// Minecraft pass over.
void add_placement(NbtWriter& out, const Grid& grid);

// Errors: grid-too-large for more cells than a file of the format can count.
Status check_cells(const GridSpec& spec, Format format);
// Errors: grid-too-large for a count of `what` ("bytes") above the limit.
Status check_count(Format format, std::string_view what, uint64_t count, uint64_t count_max);

// Warnings: "lost-channels" names the channels that blocks have no place for; "lost-alpha" is for
// transparent voxels; "not-metres" for voxels that are not 1 m, where the grid has units;
// "outside-world" for a grid higher than a world; "large-structure" for one that no structure block
// loads. A grid without tiles, that of a sequence, has no lost-alpha.
std::vector<Warning> block_warnings(const Grid& grid, Format format);

}  // namespace voxeld::minecraft
