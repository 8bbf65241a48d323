#include "server/formats/zarr/chunks.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <cstring>
#include <string>
#include <vector>

#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/npy/sample_writers.h"
#include "server/formats/volume/volume_array.h"
#include "server/formats/volume/volume_facts.h"
#include "server/formats/zarr/metadata.h"
#include "server/formats/zip/deflate_stream.h"

namespace voxeld::zarr {
namespace {

constexpr size_t kSide = kChunkSide, kBrick = limits::kBrickSide;
constexpr size_t kChunkCells = kSide * kSide * kSide;
constexpr uint32_t kChunkBricks = (kChunkSide / limits::kBrickSide) *
                                  (kChunkSide / limits::kBrickSide) *
                                  (kChunkSide / limits::kBrickSide);
constexpr size_t kBatchChunks = 64;  // deflated together

// The place of each bit of a brick's mask among a chunk's cells, x fastest.
constexpr std::array<uint16_t, 512> kCells = [] {
  std::array<uint16_t, 512> cells{};
  for (uint32_t i = 0; i < cells.size(); ++i) {
    const auto [x, y, z] = morton_decode(i);
    cells[i] = static_cast<uint16_t>((z * kSide + y) * kSide + x);
  }
  return cells;
}();

struct ChunkBrick {
  size_t cell;            // the first of the chunk's cells that it has
  const BrickMask* mask;  // null: full, without attributes
  size_t voxel;           // the first with attributes
};

// A chunk with voxels.
struct TileChunk {
  const SparseTile* tile;
  std::array<uint32_t, 3> place;  // in chunks of the grid: x, y, z
  std::vector<ChunkBrick> bricks;
};

void add_tile_chunks(const SparseTile& tile, std::vector<TileChunk>& chunks) {
  constexpr uint32_t kAlong = limits::kTileSide / kChunkSide;
  uint32_t last = UINT32_MAX;
  for_each_brick(tile, [&](uint32_t morton, const BrickMask& mask, size_t first) {
    if (morton / kChunkBricks != last) {
      last = morton / kChunkBricks;
      const auto in_tile = morton_decode(last);
      TileChunk chunk{&tile, {}, {}};
      for (size_t c = 0; c < 3; ++c) {
        chunk.place[c] = static_cast<uint32_t>(tile.coord[c]) * kAlong + in_tile[c];
      }
      chunks.push_back(std::move(chunk));
    }
    const auto [x, y, z] = morton_decode(morton % kChunkBricks);
    const bool is_full = first == kNoAttributes;
    chunks.back().bricks.push_back(
        {((z * kSide + y) * kSide + x) * kBrick, is_full ? nullptr : &mask, first});
  });
}

template <typename Writer>
void fill_brick(const Writer& writer, const SparseTile& tile, const ChunkBrick& brick,
                uint8_t* chunk) {
  constexpr size_t kCellBytes = Writer::kCellBytes;
  uint8_t* const begin = chunk + brick.cell * kCellBytes;
  if (brick.mask == nullptr) {
    for (size_t row = 0; row < kBrick * kBrick; ++row) {
      const size_t cell = (row / kBrick * kSide + row % kBrick) * kSide;
      writer.run(begin + cell * kCellBytes, kBrick);
    }
    return;
  }
  size_t voxel = brick.voxel;
  for (size_t w = 0; w < brick.mask->words.size(); ++w) {
    for (uint64_t bits = brick.mask->words[w]; bits != 0; bits &= bits - 1) {
      const size_t cell = kCells[64 * w + static_cast<size_t>(std::countr_zero(bits))];
      writer.cell(begin + cell * kCellBytes, tile, voxel++, 0);
    }
  }
}

// Distances of NumPy arrays become those of volumes.
void scale_distances(std::span<uint8_t> bytes, double scale) {
  if (scale == 1.0) return;
  for (size_t at = 0; at < bytes.size(); at += sizeof(float)) {
    float distance = 0;
    std::memcpy(&distance, &bytes[at], sizeof distance);
    put(&bytes[at], static_cast<float>(distance * scale));
  }
}

// Makes the chunks of one level.
class ChunkMaker {
 public:
  ChunkMaker(const Grid& level, float far_voxels, const OutputOptions& options)
      : level_(level),
        far_voxels_(far_voxels),
        options_(options),
        distance_scale_(volume::distance_scale(level)) {}

  // The chunk of a channel as gzip; empty if it has only the fill value.
  std::vector<uint8_t> made(const TileChunk& chunk, std::optional<Channel> channel) const {
    static thread_local std::vector<uint8_t> bytes;
    bool is_distance = false;
    with_sample_writer(level_, channel, options_, false, [&](auto writer) {
      bytes.resize(kChunkCells * decltype(writer)::kCellBytes);
      if constexpr (requires { writer.inside; }) {
        is_distance = true;
        writer.inside = -static_cast<float>(far_voxels_ * writer.unit);
        writer.outside = NAN;
      }
      writer.background(bytes);
      for (const ChunkBrick& brick : chunk.bricks) {
        fill_brick(writer, *chunk.tile, brick, bytes.data());
      }
    });
    if (is_distance) {
      scale_distances(bytes, distance_scale_);
    } else if (std::ranges::all_of(bytes, [](uint8_t byte) { return byte == 0; })) {
      return {};
    }
    const bool is_byte = bytes.size() == kChunkCells;
    return gzip_stream(bytes, is_byte ? Repeats::runs() : Repeats::anywhere());
  }

 private:
  const Grid& level_;  // without tiles
  float far_voxels_;
  const OutputOptions& options_;
  double distance_scale_;
};

}  // namespace

Result<float> farthest_distance(const TileSource& source) {
  if (!source.grid().channels.distance) return 0.0F;
  int steps = 1;
  VOXELD_TRY(for_each_batch(source, [&](const std::vector<SparseTile>& tiles) -> Status {
    for (const SparseTile& tile : tiles) {
      for (const int16_t distance : tile.distance) {
        steps = std::max(steps, std::abs(int{distance}));
      }
    }
    return {};
  }));
  return static_cast<float>(steps) / static_cast<float>(kDistanceSteps);
}

Status add_chunks(ZipWriter& zip, const TileSource& tiles, int level, std::optional<size_t> frame,
                  float far_voxels, const OutputOptions& options) {
  std::vector<std::optional<Channel>> channels = {std::nullopt};
  for (const ChannelInfo& info : kChannels) {
    if (tiles.grid().channels.has(info.channel)) channels.emplace_back(info.channel);
  }
  const ChunkMaker maker(tiles.grid(), far_voxels, options);
  const auto add_batch = [&](const std::vector<SparseTile>& batch) -> Status {
    std::vector<TileChunk> chunks;
    for (const SparseTile& tile : batch) add_tile_chunks(tile, chunks);
    const size_t count = chunks.size() * channels.size();
    for (size_t begin = 0; begin < count; begin += kBatchChunks) {
      std::vector<std::vector<uint8_t>> made(std::min(kBatchChunks, count - begin));
      ThreadPool::shared().for_each(made.size(), [&](size_t i) {
        cancel_point();  // on the calling thread
        const size_t at = begin + i;
        made[i] = maker.made(chunks[at % chunks.size()], channels[at / chunks.size()]);
      });
      for (size_t i = 0; i < made.size(); ++i) {
        if (made[i].empty()) continue;
        const TileChunk& chunk = chunks[(begin + i) % chunks.size()];
        const std::optional<Channel> channel = channels[(begin + i) / chunks.size()];
        const bool has_components = volume::array_type(channel, options).components > 1;
        const std::string key = chunk_key(chunk.place, frame, has_components, options.zarr_version);
        VOXELD_TRY(zip.store(array_path(channel, level) + "/" + key, made[i]));
      }
    }
    return {};
  };
  return for_each_batch(tiles, add_batch);
}

}  // namespace voxeld::zarr
