// Sizes and speeds of the container's codecs: small_codec_bench [--repeat N] [--size N] [--color]
// [--normal] FILE... takes containers (.voxg) and meshes, which pipeline cpu voxelizes, and prints
// for each stream and codec: bits per voxel that it holds, bytes, and how many million voxels and
// megabytes of plain stream (octree bytes, samples) one core encodes and decodes in a second of
// its time; medians of the runs.
#include <algorithm>
#include <cstdio>
#include <cstdlib>
#include <ctime>
#include <functional>
#include <string>
#include <vector>

#include "proto/codec/octree_codec.h"
#include "proto/container/grid_format.h"
#include "proto/container/tile_streams.h"
#include "server/base/disk/file.h"
#include "server/grid/grid.h"
#include "server/scene/load.h"
#include "server/voxel/voxelize.h"

namespace voxeld {
namespace {

struct Arguments {
  int repeat = 5;
  VoxelizeOptions options;
  std::vector<std::string> files;
};

Arguments parse(int argc, char** argv) {
  Arguments arguments;
  arguments.options.pipeline = PipelineChoice::kCpu;
  arguments.options.color = ColorMode::kAverage;
  arguments.options.channels.emplace();
  for (int i = 1; i < argc; ++i) {
    const std::string text = argv[i];
    const auto number = [&] { return i + 1 < argc ? std::max(1, std::atoi(argv[++i])) : 1; };
    if (text == "--repeat") {
      arguments.repeat = number();
    } else if (text == "--size") {
      arguments.options.placement.size = number();
    } else if (text == "--color") {
      arguments.options.channels->color = true;
    } else if (text == "--normal") {
      arguments.options.channels->normal = true;
    } else {
      arguments.files.push_back(text);
    }
  }
  return arguments;
}

// CPU time of this process, so that other processes on the machine do not count.
double cpu_ms() {
  return 1000.0 * static_cast<double>(std::clock()) / CLOCKS_PER_SEC;
}

// One kind of stream: what it is without compression, and how it goes there and back.
struct Stream {
  const char* name;
  std::function<size_t(const SparseTile& tile)> plain_bytes;
  std::function<size_t(const SparseTile& tile)> voxels;
  std::function<Result<std::vector<uint8_t>>(const SparseTile& tile, Codec codec)> encode;
  // `tile` has all but this stream's part.
  std::function<Status(std::span<const uint8_t> bytes, Codec codec, SparseTile& tile)> decode;
};

double median(std::vector<double> values) {
  std::ranges::sort(values);
  return values[values.size() / 2];
}

Status decode_all(const Stream& stream, Codec codec, const std::vector<std::vector<uint8_t>>& bytes,
                  std::vector<SparseTile>& tiles) {
  for (size_t i = 0; i < tiles.size(); ++i) VOXELD_TRY(stream.decode(bytes[i], codec, tiles[i]));
  return {};
}

Status measure(const Stream& stream, Codec codec, const std::vector<SparseTile>& tiles,
               int repeat) {
  std::vector<double> encode_ms, decode_ms;
  size_t bytes = 0, plain = 0, voxels = 0;
  for (int run = 0; run < repeat; ++run) {
    std::vector<std::vector<uint8_t>> encoded;
    const double encode_start = cpu_ms();
    for (const SparseTile& tile : tiles) {
      VOXELD_ASSIGN(std::vector<uint8_t> one, stream.encode(tile, codec));
      encoded.push_back(std::move(one));
    }
    encode_ms.push_back(cpu_ms() - encode_start);
    std::vector<SparseTile> decoded = tiles;
    const double decode_start = cpu_ms();
    VOXELD_TRY(decode_all(stream, codec, encoded, decoded));
    decode_ms.push_back(cpu_ms() - decode_start);
    if (decoded != tiles) return Error{ErrorCode::kInternal, "a tile did not come back", "", ""};
    bytes = 0;
    for (const auto& tile : encoded) bytes += tile.size();
  }
  for (const SparseTile& tile : tiles) {
    plain += stream.plain_bytes(tile);
    voxels += stream.voxels(tile);
  }
  const auto speed = [&](double amount, const std::vector<double>& ms) {
    return amount / median(ms) / 1000;
  };
  const auto count = static_cast<double>(voxels), size = static_cast<double>(plain);
  std::printf(
      "  %-7s %-5s %7.3f bits/voxel %10zu bytes  encode %7.2f Mvoxel/s %7.2f MB/s  "
      "decode %7.2f Mvoxel/s %7.2f MB/s\n",
      stream.name, codec == Codec::kFast ? "fast" : "small",
      8.0 * static_cast<double>(bytes) / count, bytes, speed(count, encode_ms),
      speed(size, encode_ms), speed(count, decode_ms), speed(size, decode_ms));
  std::fflush(stdout);
  return {};
}

std::vector<Stream> streams_of(const Grid& grid) {
  const bool has_attributes = grid.channels.any();
  std::vector<Stream> streams = {
      {"octree", [](const SparseTile& tile) { return octree_from_tile(tile).size(); },
       [](const SparseTile& tile) { return tile.voxel_count(); }, encode_octree_stream,
       [=](std::span<const uint8_t> bytes, Codec codec, SparseTile& tile) {
         return decode_octree_stream(bytes, codec, has_attributes, tile);
       }}};
  const auto voxels = [](const SparseTile& tile) { return tile.attribute_count(); };
  for (const ChannelInfo& info : kChannels) {
    const Channel channel = info.channel;
    if (!grid.channels.has(channel)) continue;
    streams.push_back({info.name.data(),
                       [=](const SparseTile& tile) { return channel_bytes(tile, channel).size(); },
                       voxels,
                       [=](const SparseTile& tile, Codec codec) {
                         return encode_channel_stream(tile, channel, codec);
                       },
                       [=](std::span<const uint8_t> bytes, Codec codec, SparseTile& tile) {
                         return decode_channel_stream(bytes, channel, codec, tile);
                       }});
  }
  return streams;
}

Result<Grid> load_grid(const std::string& path, const VoxelizeOptions& options) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(path));
  if (path.ends_with(".voxg")) return grid_from_container(file.bytes());
  VOXELD_ASSIGN(const Scene scene, load_scene(path, file.bytes()));
  return Voxelizer(nullptr).voxelize(scene, options, {}, nullptr);
}

Status run(const std::string& path, const Arguments& arguments) {
  VOXELD_ASSIGN(const Grid grid, load_grid(path, arguments.options));
  std::printf("%s: %d x %d x %d, %llu voxels, %zu tiles\n", path.c_str(), grid.spec.dims.x,
              grid.spec.dims.y, grid.spec.dims.z,
              static_cast<unsigned long long>(grid.voxel_count()), grid.tiles.size());
  for (const Stream& stream : streams_of(grid)) {
    std::vector<SparseTile> tiles;
    for (const SparseTile& tile : grid.tiles) {
      if (stream.voxels(tile) > 0) tiles.push_back(tile);
    }
    for (const Codec codec : {Codec::kFast, Codec::kSmall}) {
      VOXELD_TRY(measure(stream, codec, tiles, arguments.repeat));
    }
  }
  return {};
}

}  // namespace
}  // namespace voxeld

int main(int argc, char** argv) {
  const voxeld::Arguments arguments = voxeld::parse(argc, argv);
  for (const std::string& path : arguments.files) {
    if (const auto status = voxeld::run(path, arguments); !status) {
      std::fprintf(stderr, "%s: %s\n", path.c_str(), status.error().message().c_str());
      return 1;
    }
  }
  return 0;
}
