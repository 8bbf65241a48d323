// Writes Sponge schematics: version 2, or 3 by schem_version. A gzip of NBT (nbt_writer.h):
//
//   version 2: "Schematic"               version 3: "" { "Schematic"
//     Version, DataVersion  int            the same
//     Metadata              compound       the same, without WEOffset
//     Width, Height, Length short: x, y, z the same
//     Offset                int array: 0   the same
//     PaletteMax            int            Blocks {
//     Palette               compound         Palette
//     BlockData             byte array       Data
//     BlockEntities         list, empty      BlockEntities }
//
// Palette gives each block its index as an int. The data are the indices of all cells in the order
// y, z, x, x fastest, as varints: 7 bits a byte, the lowest first, bit 7 set where another byte
// follows. Index 0 is air.
#include <algorithm>
#include <array>
#include <cstring>

#include "proto/minecraft_blocks.h"
#include "server/base/check.h"
#include "server/formats/formats.h"
#include "server/formats/minecraft/block_cells.h"
#include "server/formats/minecraft/block_choice.h"
#include "server/formats/minecraft/block_file.h"
#include "server/formats/output_file.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld {
namespace {

using minecraft::NbtTag;
using minecraft::NbtWriter;

constexpr size_t kOneByteIndices = 128;  // of a varint
constexpr std::array<int32_t, 3> kNoOffset{};

uint64_t varint_bytes(const minecraft::ChosenBlocks& blocks) {
  uint64_t bytes = 0;
  for (size_t i = 0; i < blocks.cells.size(); ++i) {
    bytes += blocks.cells[i] * (i < kOneByteIndices ? 1 : 2);
  }
  return bytes;
}

// Replaces indices by their varints.
void expand_varints(std::vector<uint8_t>& indices) {
  static thread_local std::vector<uint8_t> longer;
  longer.resize(2 * indices.size());
  size_t size = 0;
  for (const uint8_t index : indices) {
    longer[size++] = index;
    if (index >= kOneByteIndices) longer[size++] = 1;  // the first byte has bit 7 set already
  }
  indices.assign(longer.begin(), longer.begin() + static_cast<ptrdiff_t>(size));
}

void add_schem_metadata(NbtWriter& out, const Grid& grid, int version) {
  out.begin("Metadata");
  out.add_text("Name", minecraft::kName);
  out.add_text("Author", minecraft::kAuthor);
  if (version == 2) {
    for (const char* const name : {"WEOffsetX", "WEOffsetY", "WEOffsetZ"}) out.add_int(name, 0);
  }
  minecraft::add_placement(out, grid);
  out.end();
}

// All up to the data of the blocks.
void add_schem_head(NbtWriter& out, const Grid& grid, const minecraft::ChosenBlocks& blocks,
                    int version) {
  const glm::ivec3 dims = grid.spec.dims;
  if (version == 3) out.begin("");
  out.begin("Schematic");
  out.add_int("Version", version);
  out.add_int("DataVersion", kMinecraftDataVersion);
  add_schem_metadata(out, grid, version);
  out.add_short("Width", static_cast<uint16_t>(dims.x));
  out.add_short("Height", static_cast<uint16_t>(dims.y));
  out.add_short("Length", static_cast<uint16_t>(dims.z));
  out.add_ints("Offset", kNoOffset);
  const auto count = static_cast<int32_t>(blocks.names.size());
  if (version == 3) {
    out.begin("Blocks");
  } else {
    out.add_int("PaletteMax", count);
  }
  out.begin("Palette");
  for (int32_t i = 0; i < count; ++i) out.add_int(blocks.names[static_cast<size_t>(i)], i);
  out.end();
}

}  // namespace

Status encode_schem(const Grid& grid, const OutputOptions& options, OutputFile& file) {
  const int version = options.schem_version;
  const minecraft::ChosenBlocks blocks = minecraft::choose_blocks(grid, options);
  const uint64_t data_bytes = varint_bytes(blocks);
  VOXELD_TRY(minecraft::check_count(Format::kSchem, "bytes of blocks", data_bytes,
                                    static_cast<uint64_t>(minecraft::kNbtCountMax)));
  NbtWriter out;
  add_schem_head(out, grid, blocks, version);
  out.begin_array(NbtTag::kByteArray, version == 3 ? "Data" : "BlockData",
                  static_cast<int32_t>(data_bytes));
  DeflateStream gzip(file, DeflateStream::Frame::kGzip);
  VOXELD_TRY(gzip.begin());
  VOXELD_TRY(gzip.add(out.bytes()));

  const minecraft::BlockCells cells(grid, blocks.entries);
  const bool is_expanded = blocks.names.size() > kOneByteIndices;
  const uint64_t begin = gzip.raw_bytes();
  VOXELD_TRY(gzip.add_pieces(
      cells.piece_count(),
      [&](size_t piece, std::vector<uint8_t>& bytes) {
        cells.fill(piece, bytes);
        if (is_expanded) expand_varints(bytes);
      },
      Repeats::runs()));
  VOXELD_CHECK(gzip.raw_bytes() - begin == data_bytes, "schem: the length of the data is wrong");

  out.clear();
  out.add_empty_list("BlockEntities");
  if (version == 3) out.end();  // Blocks
  out.end();
  if (version == 3) out.end();  // the unnamed root
  VOXELD_TRY(gzip.add(out.bytes()));
  return gzip.finish();
}

}  // namespace voxeld
