// Sizes and speeds of the geometry codecs: small_codec_bench [--repeat N] GRID.voxg... prints one
// line per container: bits per voxel of `fast` (octree bytes and zstd) and of `small`, and how many
// million voxels per second one core encodes and decodes with each; medians of the runs.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <string>
#include <vector>

#include "proto/grid_format.h"
#include "proto/octree_codec.h"
#include "proto/octree_small.h"
#include "proto/stream_codec.h"
#include "server/base/file.h"
#include "server/base/stopwatch.h"

namespace voxeld {
namespace {

struct Codec {
  const char* name;
  std::vector<uint8_t> (*encode)(const SparseTile& tile);
  bool (*decode)(std::span<const uint8_t> bytes, SparseTile& tile);
};

std::vector<uint8_t> encode_fast(const SparseTile& tile) {
  auto bytes = compress_stream(octree_from_tile(tile));
  return bytes ? *std::move(bytes) : std::vector<uint8_t>{};
}
bool decode_fast(std::span<const uint8_t> bytes, SparseTile& tile) {
  const auto octree = decompress_stream(bytes, kOctreeBytesMax);
  return octree && tile_from_octree(*octree, false, tile).ok();
}
bool decode_small(std::span<const uint8_t> bytes, SparseTile& tile) {
  return decode_octree_small(bytes, false, tile).ok();
}

constexpr Codec kCodecs[] = {{"fast", encode_fast, decode_fast},
                             {"small", encode_octree_small, decode_small}};

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

// Bits per voxel and speeds of one codec on all tiles; false when a tile does not come back.
bool measure(const Codec& codec, const std::vector<SparseTile>& tiles, uint64_t voxels,
             int repeat) {
  std::vector<double> encode_ms, decode_ms;
  size_t bytes = 0;
  for (int run = 0; run < repeat; ++run) {
    std::vector<std::vector<uint8_t>> encoded;
    Stopwatch encode_watch;
    for (const SparseTile& tile : tiles) encoded.push_back(codec.encode(tile));
    encode_ms.push_back(encode_watch.lap());
    std::vector<SparseTile> decoded(tiles.size());
    Stopwatch decode_watch;
    for (size_t i = 0; i < tiles.size(); ++i) {
      decoded[i].coord = tiles[i].coord;
      if (!codec.decode(encoded[i], decoded[i])) return false;
    }
    decode_ms.push_back(decode_watch.lap());
    if (decoded != tiles) return false;
    bytes = 0;
    for (const auto& tile : encoded) bytes += tile.size();
  }
  const auto count = static_cast<double>(voxels);
  std::printf("  %s %.3f b/voxel, %zu bytes, encode %.1f, decode %.1f Mvoxel/s", codec.name,
              8.0 * static_cast<double>(bytes) / count, bytes, count / median(encode_ms) / 1000,
              count / median(decode_ms) / 1000);
  return true;
}

bool measure_container(const std::string& path, int repeat) {
  const auto bytes = read_file(path);
  if (!bytes) return false;
  const auto reader =
      GridReader::open({reinterpret_cast<const uint8_t*>(bytes->data()), bytes->size()});
  if (!reader) return false;
  std::vector<SparseTile> tiles;
  for (size_t i = 0; i < reader->tile_count(); ++i) {
    auto tile = reader->decode_tile(i);
    if (!tile) return false;
    tile->color.clear();
    tile->normal.clear();
    tiles.push_back(*std::move(tile));
  }
  std::printf("%-20s %9llu voxels %3zu tiles", path.substr(path.rfind('/') + 1).c_str(),
              static_cast<unsigned long long>(reader->voxel_count()), tiles.size());
  for (const Codec& codec : kCodecs) {
    if (!measure(codec, tiles, reader->voxel_count(), repeat)) return false;
  }
  std::printf("\n");
  return true;
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  int repeat = 5;
  for (int i = 1; i < argc; ++i) {
    if (std::strcmp(argv[i], "--repeat") == 0 && i + 1 < argc) {
      repeat = std::max(1, std::atoi(argv[++i]));
    } else if (!voxeld::measure_container(argv[i], repeat)) {
      std::fprintf(stderr, "%s: not a container, or a codec failed\n", argv[i]);
      return 1;
    }
  }
  return 0;
}
