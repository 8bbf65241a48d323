// Decodes frames of a sequence container that SequenceReader::open() has checked.
#include <algorithm>
#include <iterator>
#include <utility>

#include "proto/codec/octree_codec.h"
#include "proto/codec/stream_codec.h"
#include "proto/container/grid_layout.h"
#include "proto/container/sequence_format.h"
#include "proto/container/sequence_layout.h"
#include "proto/container/tile_streams.h"
#include "proto/thread_pool.h"

namespace voxeld {

using namespace sequence_layout;

bool SequenceReader::is_small(size_t kind) const {
  const Codec codec = kind == 0 ? header_.codecs.octree : header_.codecs.channels[kind - 1];
  return codec == Codec::kSmall;
}

std::span<const uint8_t> SequenceReader::stored(const Stream& stream) const {
  return bytes_.subspan(stream.offset, stream.bytes);
}

// Starts at the nearest stream in the chain that is known or is no difference, then applies one
// difference after the other.
Result<std::shared_ptr<const std::vector<uint8_t>>> SequenceReader::raw_stream(
    uint32_t number, const RawStreams* kept) const {
  std::shared_ptr<const std::vector<uint8_t>> raw;
  std::vector<uint32_t> chain;
  for (uint32_t next = number; raw == nullptr && next != kNoStream; next = streams_[next].base) {
    const auto known = kept == nullptr ? RawStreams::const_iterator() : kept->find(next);
    if (kept != nullptr && known != kept->end()) {
      raw = known->second;
    } else {
      chain.push_back(next);
    }
  }
  for (auto next = chain.rbegin(); next != chain.rend(); ++next) {
    const Stream& stream = streams_[*next];
    const std::span<const uint8_t> prefix = raw ? std::span(*raw) : std::span<const uint8_t>();
    auto contents = decompress_stream(stored(stream), stream.raw_max, prefix);
    if (!contents) return broken_stream(stream.offset, std::move(contents).error());
    raw = std::make_shared<const std::vector<uint8_t>>(*std::move(contents));
  }
  return raw;
}

Result<RawStreams> SequenceReader::raw_streams(std::span<const Tile> tiles,
                                               const RawStreams* kept) const {
  std::vector<uint32_t> numbers;
  for (const Tile& tile : tiles) {
    for (size_t kind = 0; kind < kStreamKinds; ++kind) {
      if (tile.streams[kind] != kNoStream && !is_small(kind)) numbers.push_back(tile.streams[kind]);
    }
  }
  std::ranges::sort(numbers);
  numbers.erase(std::unique(numbers.begin(), numbers.end()), numbers.end());
  std::vector<std::shared_ptr<const std::vector<uint8_t>>> contents(numbers.size());
  std::vector<Status> done(numbers.size());
  ThreadPool::shared().for_each(numbers.size(), [&](size_t i) {
    auto raw = raw_stream(numbers[i], kept);
    if (raw) {
      contents[i] = *std::move(raw);
    } else {
      done[i] = std::move(raw).error();
    }
  });
  RawStreams streams;
  for (size_t i = 0; i < numbers.size(); ++i) {
    VOXELD_TRY(std::move(done[i]));
    streams.emplace_hint(streams.end(), numbers[i], std::move(contents[i]));
  }
  return streams;
}

Status SequenceReader::decode_octree(const Tile& entry, const RawStreams& raw,
                                     SparseTile& tile) const {
  const Stream& stream = streams_[entry.streams[0]];
  const bool has_attributes = header_.channels.any();
  Status status = is_small(0)
                      ? decode_octree_stream(stored(stream), Codec::kSmall, has_attributes, tile)
                      : tile_from_octree(*raw.at(entry.streams[0]), has_attributes, tile);
  if (!status) return broken_stream(stream.offset, std::move(status).error());
  const size_t voxels = tile.voxel_count();
  if (tile.masks.size() != entry.brick_count || voxels != entry.voxel_count) {
    return broken_sequence(stream.offset, "octree does not match its tile",
                           std::to_string(entry.brick_count) + " bricks and " +
                               std::to_string(entry.voxel_count) + " voxels",
                           std::to_string(tile.masks.size()) + " and " + std::to_string(voxels));
  }
  status = grid_layout::check_cells(tile, header_.dims);
  return status ? Status() : broken_stream(stream.offset, std::move(status).error());
}

Status SequenceReader::decode_channel(const Tile& entry, size_t kind, const RawStreams& raw,
                                      SparseTile& tile) const {
  const Stream& stream = streams_[entry.streams[kind]];
  const Channel channel = kChannels[kind - 1].channel;
  Status status = is_small(kind)
                      ? decode_channel_stream(stored(stream), channel, Codec::kSmall, tile)
                      : set_raw_channel_stream(*raw.at(entry.streams[kind]), channel, tile);
  return status ? Status() : broken_stream(stream.offset, std::move(status).error());
}

Result<SparseTile> SequenceReader::decode_tile(const Tile& entry, const RawStreams& raw) const {
  SparseTile tile;
  tile.coord = entry.coord;
  VOXELD_TRY(decode_octree(entry, raw, tile));
  for (size_t kind = 1; kind < kStreamKinds; ++kind) {
    if (entry.streams[kind] != kNoStream) VOXELD_TRY(decode_channel(entry, kind, raw, tile));
  }
  return tile;
}

Result<std::vector<SparseTile>> SequenceReader::decode_frame(size_t frame, RawStreams* kept) const {
  const std::span<const Tile> entries =
      std::span(tiles_).subspan(frames_[frame].first_tile, frames_[frame].tile_count);
  VOXELD_ASSIGN(RawStreams raw, raw_streams(entries, kept));
  std::vector<SparseTile> tiles(entries.size());
  std::vector<Status> done(entries.size());
  ThreadPool::shared().for_each(entries.size(), [&](size_t i) {
    auto tile = decode_tile(entries[i], raw);
    if (tile) {
      tiles[i] = *std::move(tile);
    } else {
      done[i] = std::move(tile).error();
    }
  });
  for (const Status& status : done) VOXELD_TRY(status);
  if (kept != nullptr) *kept = std::move(raw);
  return tiles;
}

}  // namespace voxeld
