// Writes the game's own structures, .nbt: a gzip of NBT (nbt_writer.h).
//
//   ""
//     DataVersion   int
//     author        text
//     size          list of int: x, y, z
//     palette       list of { Name }
//     blocks        list of { pos: list of int x, y, z; state: int, an index into palette }
//     entities      list, empty
//
// Only occupied cells are blocks: loading a structure leaves the world's blocks at empty cells.
// Blocks are in Morton order.
#include <array>
#include <cstring>

#include "proto/codec/tile_runs.h"
#include "proto/minecraft_blocks.h"
#include "server/base/check.h"
#include "server/formats/formats.h"
#include "server/formats/minecraft/block_choice.h"
#include "server/formats/minecraft/block_file.h"
#include "server/formats/npy/sparse_array.h"
#include "server/formats/output_file.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld {
namespace {

using minecraft::NbtTag;
using minecraft::NbtWriter;

// The record of one block, and where its numbers are: big-endian, 4 bytes each.
constexpr size_t kRecordBytes = 36, kPositionByte = 11, kStateByte = 31;
using Record = std::array<uint8_t, kRecordBytes>;

Record empty_record() {
  NbtWriter out;
  out.add_int_list("pos", std::array<int32_t, 3>{});
  out.add_int("state", 0);
  out.end();
  Record record{};
  VOXELD_CHECK(out.bytes().size() == record.size(), "nbt: the length of a block is wrong");
  std::memcpy(record.data(), out.bytes().data(), record.size());
  return record;
}

void put_number(uint8_t* at, uint32_t value) {
  for (int i = 0; i < 4; ++i) at[i] = static_cast<uint8_t>(value >> (24 - 8 * i));
}

void fill_records(const VoxelPieces& voxels, size_t piece, const VoxelEntries& entries,
                  std::vector<uint8_t>& bytes) {
  static const Record kEmpty = empty_record();
  bytes.resize(static_cast<size_t>(voxels.begin(piece + 1) - voxels.begin(piece)) * kRecordBytes);
  uint8_t* out = bytes.data();
  const SparseTile* const tiles = voxels.grid().tiles.data();
  voxels.for_each_brick(
      piece, [&](const SparseTile& tile, uint32_t morton, const BrickMask& mask, size_t voxel) {
        const auto tile_number = static_cast<size_t>(&tile - tiles);
        const std::array<int32_t, 3> brick = brick_cell(tile, morton);
        for (uint32_t w = 0; w < mask.words.size(); ++w) {
          for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
            const auto cell = morton_decode(w * 64 + static_cast<uint32_t>(std::countr_zero(bits)));
            std::memcpy(out, kEmpty.data(), kRecordBytes);
            for (size_t c = 0; c < 3; ++c) {
              put_number(out + kPositionByte + 4 * c, static_cast<uint32_t>(brick[c]) + cell[c]);
            }
            put_number(out + kStateByte, entries.of(tile_number, voxel) - 1u);  // without air
            out += kRecordBytes;
            if (voxel != kNoAttributes) ++voxel;
          }
        }
      });
}

}  // namespace

Status encode_nbt(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  VOXELD_TRY(minecraft::check_count(Format::kNbt, "blocks for a structure", grid.voxel_count(),
                                    minecraft::kStructureBlocksMax));
  const minecraft::ChosenBlocks blocks = minecraft::choose_blocks(grid, options);
  const VoxelPieces voxels(grid);
  const glm::ivec3 dims = grid.spec.dims;
  NbtWriter out;
  out.begin("");
  out.add_int("DataVersion", kMinecraftDataVersion);
  out.add_text("author", minecraft::kAuthor);
  minecraft::add_placement(out, grid);
  out.add_int_list("size", std::array<int32_t, 3>{dims.x, dims.y, dims.z});
  out.begin_list("palette", NbtTag::kCompound, static_cast<int32_t>(blocks.names.size() - 1));
  for (size_t i = 1; i < blocks.names.size(); ++i) {
    out.add_text("Name", blocks.names[i]);
    out.end();
  }
  out.begin_list("blocks", NbtTag::kCompound, static_cast<int32_t>(voxels.voxel_count()));
  DeflateStream gzip(file, DeflateStream::Frame::kGzip);
  VOXELD_TRY(gzip.begin());
  VOXELD_TRY(gzip.add(out.bytes()));
  VOXELD_TRY(gzip.add_pieces(
      voxels.count(),
      [&](size_t piece, std::vector<uint8_t>& bytes) {
        fill_records(voxels, piece, blocks.entries, bytes);
      },
      Repeats::rows(kRecordBytes)));
  out.clear();
  out.add_empty_list("entities");
  out.end();
  VOXELD_TRY(gzip.add(out.bytes()));
  return gzip.finish();
}

}  // namespace voxeld
