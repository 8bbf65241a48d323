// Writes Litematica's .litematic, version 6: a gzip of NBT (nbt_writer.h) with one region.
//
//   ""
//     MinecraftDataVersion, Version, SubVersion   int
//     Metadata   Name, Author, Description, EnclosingSize { x, y, z }, RegionCount, TotalBlocks,
//                TotalVolume, TimeCreated and TimeModified (0)
//     Regions { "voxeld grid"
//       Position, Size       compounds x, y, z
//       BlockStatePalette    list of { Name }, the first is air
//       BlockStates          long array: pack_indices(), cells in the order y, z, x, x fastest
//       Entities, TileEntities, PendingBlockTicks, PendingFluidTicks   lists, empty }
#include "server/formats/minecraft/litematic.h"

#include <algorithm>
#include <bit>

#include "proto/minecraft_blocks.h"
#include "server/formats/formats.h"
#include "server/formats/minecraft/block_cells.h"
#include "server/formats/minecraft/block_choice.h"
#include "server/formats/minecraft/block_file.h"
#include "server/formats/output_file.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld {
namespace minecraft {
namespace {

constexpr unsigned kLongBits = 64;
constexpr size_t kLongBytes = 8;
constexpr int kLitematicVersion = 6, kLitematicSubVersion = 1;

// Packs at most 64 indices from the beginning of a long on.
void pack_group(std::span<const uint8_t> indices, unsigned bits, uint8_t* out) {
  uint64_t word = 0;
  unsigned filled = 0;
  const auto put = [&] {
    for (size_t i = 0; i < kLongBytes; ++i) *out++ = static_cast<uint8_t>(word >> (56 - 8 * i));
  };
  for (const uint64_t index : indices) {
    word |= index << filled;
    filled += bits;
    if (filled < kLongBits) continue;
    put();
    filled -= kLongBits;
    word = filled == 0 ? 0 : index >> (bits - filled);
  }
  if (filled > 0) put();
}

void add_sides(NbtWriter& out, std::string_view name, const glm::ivec3& sides) {
  out.begin(name);
  out.add_int("x", sides.x);
  out.add_int("y", sides.y);
  out.add_int("z", sides.z);
  out.end();
}

// All up to the longs.
void add_litematic_head(NbtWriter& out, const Grid& grid, const ChosenBlocks& blocks) {
  const glm::ivec3 dims = grid.spec.dims;
  out.begin("");
  out.add_int("MinecraftDataVersion", kMinecraftDataVersion);
  out.add_int("Version", kLitematicVersion);
  out.add_int("SubVersion", kLitematicSubVersion);
  out.begin("Metadata");
  out.add_text("Name", kName);
  out.add_text("Author", kAuthor);
  out.add_text("Description", "");
  add_sides(out, "EnclosingSize", dims);
  out.add_int("RegionCount", 1);
  out.add_int("TotalBlocks", static_cast<int32_t>(blocks.block_count()));
  out.add_int("TotalVolume", static_cast<int32_t>(grid.spec.cell_count()));
  out.add_long("TimeCreated", 0);
  out.add_long("TimeModified", 0);
  add_placement(out, grid);
  out.end();
  out.begin("Regions");
  out.begin(kName);
  add_sides(out, "Position", glm::ivec3(0));
  add_sides(out, "Size", dims);
  out.begin_list("BlockStatePalette", NbtTag::kCompound, static_cast<int32_t>(blocks.names.size()));
  for (const std::string& name : blocks.names) {
    out.add_text("Name", name);
    out.end();
  }
}

}  // namespace

unsigned index_bits(size_t names) {
  return std::max(2u, static_cast<unsigned>(std::bit_width(names - 1)));
}

void pack_indices(std::span<const uint8_t> indices, unsigned bits, std::vector<uint8_t>& bytes) {
  bytes.assign((indices.size() * bits + kLongBits - 1) / kLongBits * kLongBytes, 0);
  // 64 indices are as many longs as an index has bits.
  for (size_t i = 0; i < indices.size(); i += kLongBits) {
    const auto group = indices.subspan(i, std::min<size_t>(kLongBits, indices.size() - i));
    const bool is_air = std::ranges::all_of(group, [](uint8_t index) { return index == 0; });
    if (!is_air) pack_group(group, bits, bytes.data() + i / kLongBits * bits * kLongBytes);
  }
}

}  // namespace minecraft

Status encode_litematic(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  const minecraft::ChosenBlocks blocks = minecraft::choose_blocks(grid, options);
  const minecraft::BlockCells cells(grid, blocks.entries);
  const unsigned bits = minecraft::index_bits(blocks.names.size());
  const uint64_t longs = (cells.cell_count() * bits + 63) / 64;  // at most 2^28
  minecraft::NbtWriter out;
  minecraft::add_litematic_head(out, grid, blocks);
  out.begin_array(minecraft::NbtTag::kLongArray, "BlockStates", static_cast<int32_t>(longs));
  DeflateStream gzip(file, DeflateStream::Frame::kGzip);
  VOXELD_TRY(gzip.begin());
  VOXELD_TRY(gzip.add(out.bytes()));
  VOXELD_TRY(gzip.add_pieces(
      cells.piece_count(),
      [&](size_t piece, std::vector<uint8_t>& bytes) {
        static thread_local std::vector<uint8_t> indices;
        cells.fill(piece, indices);
        minecraft::pack_indices(indices, bits, bytes);
      },
      Repeats::anywhere()));
  out.clear();
  for (const char* const name :
       {"Entities", "TileEntities", "PendingBlockTicks", "PendingFluidTicks"}) {
    out.add_empty_list(name);
  }
  for (int open = 0; open < 3; ++open) out.end();  // the region, Regions, the root
  VOXELD_TRY(gzip.add(out.bytes()));
  return gzip.finish();
}

}  // namespace voxeld
