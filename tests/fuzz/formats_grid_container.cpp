// The native container. The first byte says what the rest is: a container as it is; one whose
// length in the header is made to agree, so that the checks behind it are reached; the octree of a
// tile (after a byte that says whether there are attributes), without the checksum that random
// bytes never have; a zstd stream; or cells of a grid that must come back from its container.
// Seeds: the containers of write_sample DIR, each after a zero byte.
#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <cstring>
#include <span>
#include <vector>

#include "proto/codec/canonical_tile.h"
#include "proto/codec/octree_codec.h"
#include "proto/codec/stream_codec.h"
#include "server/base/check.h"
#include "server/formats/formats.h"
#include "server/grid/content_hash.h"
#include "tests/unit/proto/tile_maker.h"

namespace {

using Bytes = std::span<const uint8_t>;

void container(Bytes bytes) {
  const auto grid = voxeld::grid_from_container(bytes);
  if (!grid) {
    VOXELD_CHECK(grid.error().code == voxeld::ErrorCode::kBadRequest, "input is a bad request");
    return;
  }
  const auto written = voxeld::encode(*grid, {});
  VOXELD_CHECK(written.ok(), "what is read can be written");
  const auto again = voxeld::grid_from_container(*written);
  VOXELD_CHECK(again.ok() && voxeld::content_hash(*again) == voxeld::content_hash(*grid),
               "what is written is the same grid");
}

void container_of_its_length(Bytes bytes) {
  std::vector<uint8_t> fixed(bytes.begin(), bytes.end());
  const uint64_t length = fixed.size();
  if (length >= voxeld::kGridHeaderBytes) std::memcpy(fixed.data() + 96, &length, sizeof length);
  container(fixed);
}

void octree(Bytes bytes) {
  if (bytes.empty()) return;
  voxeld::SparseTile tile;
  const bool has_attributes = (bytes[0] & 1) != 0;
  bytes = bytes.subspan(1);
  if (!voxeld::tile_from_octree(bytes, has_attributes, tile)) return;
  VOXELD_CHECK(voxeld::is_canonical(tile, has_attributes), "a tile is canonical");
  const auto back = voxeld::octree_from_tile(tile);
  VOXELD_CHECK(std::equal(back.begin(), back.end(), bytes.begin(), bytes.end()),
               "a tile has one octree");
}

void stream(Bytes bytes) {
  constexpr size_t kMax = 4096;
  if (const auto raw = voxeld::decompress_stream(bytes, kMax)) {
    VOXELD_CHECK(raw->size() <= kMax, "no stream is longer than asked for");
  }
  const auto stored = voxeld::compress_stream(voxeld::StreamKind::kOctree, bytes);
  VOXELD_CHECK(stored.ok(), "any bytes can be compressed");
  const auto back = voxeld::decompress_stream(*stored, bytes.size());
  VOXELD_CHECK(back.ok() && std::equal(back->begin(), back->end(), bytes.begin(), bytes.end()),
               "bytes come back");
}

// Six bytes a voxel: 16 bits of each coordinate; attributes are made from them.
void cells(Bytes bytes) {
  constexpr int kSides[3] = {2048, 700, 300};
  std::vector<voxeld::test::TestVoxel> voxels;
  for (; bytes.size() >= 6; bytes = bytes.subspan(6)) {
    auto& voxel = voxels.emplace_back();
    for (size_t c = 0; c < 3; ++c) {
      voxel.cell[c] = (bytes[2 * c] | bytes[2 * c + 1] << 8) % kSides[c];
      voxel.color[c] = bytes[2 * c];
      voxel.normal[c] = static_cast<int8_t>(bytes[2 * c + 1]);
    }
    voxel.material = static_cast<uint16_t>(bytes[0] << 8 | bytes[1]);
    voxel.label = bytes[2];
    voxel.distance = static_cast<int16_t>(bytes[3] << 8 | bytes[4]);
    voxel.coverage = bytes[5];
  }
  voxeld::Grid grid;
  grid.spec.dims = {kSides[0], kSides[1], kSides[2]};
  grid.channels = voxeld::channels_of_bits(voxeld::test::kChannelSets - 1);
  grid.tiles = voxeld::test::tiles_of(voxels, grid.channels);
  voxeld::normalize_tiles(grid);
  const auto written = voxeld::encode(grid, {});
  VOXELD_CHECK(written.ok(), "a grid can be written");
  const auto back = voxeld::grid_from_container(*written);
  VOXELD_CHECK(back.ok() && back->tiles == grid.tiles, "a grid comes back");
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size == 0) return 0;
  const Bytes rest(data + 1, size - 1);
  switch (data[0] % 5) {
    case 0:
      container(rest);
      break;
    case 1:
      container_of_its_length(rest);
      break;
    case 2:
      octree(rest);
      break;
    case 3:
      stream(rest);
      break;
    default:
      cells(rest);
  }
  return 0;
}
