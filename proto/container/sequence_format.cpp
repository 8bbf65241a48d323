#include "proto/container/sequence_format.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "proto/codec/octree_codec.h"
#include "proto/container/grid_layout.h"
#include "proto/container/sequence_layout.h"

namespace voxeld {

using grid_layout::get;
using grid_layout::padded;
using namespace sequence_layout;

Status SequenceReader::read_header() {
  if (bytes_.size() < kSequenceHeaderBytes) {
    return broken_sequence(bytes_.size(), "the header is cut off",
                           std::to_string(kSequenceHeaderBytes) + " bytes",
                           std::to_string(bytes_.size()));
  }
  if (std::memcmp(bytes_.data(), kSequenceMagic, sizeof kSequenceMagic) != 0) {
    return broken_sequence(0, "not a sequence container", "the magic VOXSEQ", "other bytes");
  }
  const auto version = get<uint32_t>(bytes_, 8), channels = get<uint32_t>(bytes_, 12);
  if (version != kSequenceVersion) {
    return broken_sequence(8, "version", std::to_string(kSequenceVersion), std::to_string(version));
  }
  if ((channels >> kChannelCount) != 0) return broken_sequence(12, "unknown channels");
  header_.channels = channels_of_bits(channels);
  header_.dims = get<std::array<int32_t, 3>>(bytes_, 16);
  header_.origin = get<std::array<double, 3>>(bytes_, 32);
  header_.voxel_size = get<std::array<double, 3>>(bytes_, 56);
  if (Status status = grid_layout::check_header(header_, 16); !status) {
    return broken_stream(16, status.error());
  }
  if (get<uint32_t>(bytes_, 28) != grid_layout::kTileLog2) {
    return broken_sequence(28, "tile side", "8", "another");
  }
  fps_ = get<double>(bytes_, 88);
  if (!std::isfinite(fps_) || fps_ < 0 || std::signbit(fps_)) {
    return broken_sequence(88, "frames per second", "a finite number, 0 or more",
                           std::to_string(fps_));
  }
  const auto total = get<uint64_t>(bytes_, 96);
  if (total != bytes_.size()) {
    return broken_sequence(96, "length", std::to_string(total) + " bytes",
                           std::to_string(bytes_.size()));
  }
  VOXELD_TRY(read_codecs());
  if (bytes_[kReservedByte] != 0)
    return broken_sequence(kReservedByte, "reserved byte", "0", "another");
  return {};
}

Status SequenceReader::read_codecs() {
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    const bool exists = kind == 0 || header_.channels.has(kChannels[kind - 1].channel);
    const size_t at = grid_layout::kCodecsByte + kind;
    const uint8_t codec = bytes_[at];
    if (codec > (exists ? 1 : 0)) {
      return broken_sequence(at, "codec of a stream", exists ? "0 or 1" : "0",
                             std::to_string(codec));
    }
    Codec& place = kind == 0 ? header_.codecs.octree : header_.codecs.channels[kind - 1];
    place = codec == 1 ? Codec::kSmall : Codec::kFast;
  }
  return {};
}

Status SequenceReader::read_meta(size_t meta_bytes) {
  const size_t end = kSequenceHeaderBytes + padded(meta_bytes);
  if (meta_bytes > grid_layout::kMetaBytesMax || end > bytes_.size()) {
    return broken_sequence(84, "meta is cut off");
  }
  header_.meta_json.assign(reinterpret_cast<const char*>(bytes_.data()) + kSequenceHeaderBytes,
                           meta_bytes);
  for (size_t i = kSequenceHeaderBytes + meta_bytes; i < end; ++i) {
    if (bytes_[i] != 0) return broken_sequence(i, "padding", "0", std::to_string(bytes_[i]));
  }
  return {};
}

// Reads the index. All sizes are 32-bit counts times small constants, so no sum of them wraps.
Status SequenceReader::read_index(uint64_t index) {
  const auto frames = get<uint32_t>(bytes_, 80), tiles = get<uint32_t>(bytes_, 120),
             streams = get<uint32_t>(bytes_, 124);
  if (frames == 0 || frames > limits::kFramesMax) {
    return broken_sequence(80, "frame count", "1 to " + std::to_string(limits::kFramesMax),
                           std::to_string(frames));
  }
  const size_t data = kSequenceHeaderBytes + padded(get<uint32_t>(bytes_, 84));
  if (index % 8 != 0 || index < data || index > bytes_.size()) {
    return broken_sequence(
        112, "offset of the index",
        "a multiple of 8 from " + std::to_string(data) + " to " + std::to_string(bytes_.size()),
        std::to_string(index));
  }
  const uint64_t frames_bytes = uint64_t{frames} * kFrameBytes,
                 tiles_bytes = uint64_t{tiles} * tile_bytes(header_.channels),
                 streams_bytes = uint64_t{streams} * kStreamBytes,
                 expected = frames_bytes + tiles_bytes + streams_bytes;
  if (bytes_.size() - index != expected) {
    return broken_sequence(index, "bytes of the index", std::to_string(expected),
                           std::to_string(bytes_.size() - index));
  }
  streams_.reserve(streams);
  VOXELD_TRY(read_tiles(index + frames_bytes, tiles));
  if (streams_.size() != streams) {
    return broken_sequence(124, "streams that tiles have", std::to_string(streams),
                           std::to_string(streams_.size()));
  }
  VOXELD_TRY(read_frames(index, frames));
  return read_streams(index + frames_bytes + tiles_bytes, streams, index);
}

Status SequenceReader::read_frames(size_t at, size_t count) {
  const size_t tiles_at = at + count * kFrameBytes;
  uint32_t next_tile = 0;
  frames_.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    const uint32_t first = next_tile;
    VOXELD_TRY(read_frame(at + i * kFrameBytes, next_tile));
    // Tiles shared with an earlier frame were checked with that frame.
    if (next_tile != first) VOXELD_TRY(check_frame(at + i * kFrameBytes, tiles_at));
  }
  if (next_tile != tiles_.size()) {
    return broken_sequence(120, "tiles that frames have", std::to_string(tiles_.size()),
                           std::to_string(next_tile));
  }
  return {};
}

Status SequenceReader::read_frame(size_t at, uint32_t& next_tile) {
  const Frame frame = {get<double>(bytes_, at), get<uint64_t>(bytes_, at + 8),
                       get<uint32_t>(bytes_, at + 16), get<uint32_t>(bytes_, at + 20)};
  if (!std::isfinite(frame.time_s) || (!frames_.empty() && frame.time_s < frames_.back().time_s)) {
    return broken_sequence(at, "time of a frame", "a finite number, none before the last frame's",
                           std::to_string(frame.time_s));
  }
  const auto earlier = std::ranges::find_if(frames_, [&](const Frame& other) {
    return other.tile_count != 0 && other.first_tile == frame.first_tile;
  });
  if (earlier != frames_.end()) {
    if (earlier->tile_count != frame.tile_count || earlier->voxel_count != frame.voxel_count) {
      return broken_sequence(at + 8, "a frame differs from the one whose tiles it has");
    }
  } else if (frame.first_tile != next_tile || frame.tile_count > tiles_.size() - next_tile) {
    return broken_sequence(
        at + 16, "tiles of a frame", "from number " + std::to_string(next_tile) + " on",
        std::to_string(frame.tile_count) + " from number " + std::to_string(frame.first_tile));
  } else if (frame.tile_count == 0 && frame.voxel_count != 0) {
    return broken_sequence(at + 8, "voxel count of a frame", "0",
                           std::to_string(frame.voxel_count));
  } else {
    next_tile += frame.tile_count;
  }
  frames_.push_back(frame);
  return {};
}

// Checks the order and the voxel count of the last frame's tiles.
Status SequenceReader::check_frame(size_t at, size_t tiles_at) const {
  const Frame& entry = frames_.back();
  uint64_t voxels = 0;
  for (uint32_t i = entry.first_tile; i < entry.first_tile + entry.tile_count; ++i) {
    voxels += tiles_[i].voxel_count;
    if (i > entry.first_tile &&
        grid_layout::tile_order(tiles_[i - 1].coord) >= grid_layout::tile_order(tiles_[i].coord)) {
      return broken_sequence(tiles_at + i * tile_bytes(header_.channels),
                             "tiles of a frame are not in ascending Morton order");
    }
  }
  if (voxels == entry.voxel_count) return {};
  return broken_sequence(at + 8, "voxel count of a frame", std::to_string(voxels),
                         std::to_string(entry.voxel_count));
}

Status SequenceReader::read_tiles(size_t at, size_t count) {
  tiles_.reserve(count);
  for (size_t i = 0; i < count; ++i) {
    VOXELD_ASSIGN(const Tile tile, read_tile(at + i * tile_bytes(header_.channels)));
    tiles_.push_back(tile);
  }
  return {};
}

Result<SequenceReader::Tile> SequenceReader::read_tile(size_t at) {
  Tile tile;
  tile.coord = get<std::array<int32_t, 3>>(bytes_, at);
  tile.brick_count = get<uint32_t>(bytes_, at + 12);
  tile.voxel_count = get<uint64_t>(bytes_, at + 16);
  if (!grid_layout::inside(tile.coord, header_.dims)) {
    return broken_sequence(at, "tile coord is outside the grid");
  }
  if (tile.brick_count > grid_layout::kTileBricksMax) {
    return broken_sequence(at + 12, "brick count",
                           "0 to " + std::to_string(grid_layout::kTileBricksMax),
                           std::to_string(tile.brick_count));
  }
  if (tile.voxel_count == 0 || tile.voxel_count > grid_layout::kTileVoxelsMax) {
    return broken_sequence(at + 16, "voxel count",
                           "1 to " + std::to_string(grid_layout::kTileVoxelsMax),
                           std::to_string(tile.voxel_count));
  }
  tile.streams.fill(kNoStream);
  size_t next = at + kTileStreamsByte;
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    if (kind > 0 && !header_.channels.has(kChannels[kind - 1].channel)) continue;
    tile.streams[kind] = get<uint32_t>(bytes_, next);
    VOXELD_TRY(note_stream(next, kind, tile));
    next += 4;
  }
  if (next < at + tile_bytes(header_.channels) && get<uint32_t>(bytes_, next) != 0) {
    return broken_sequence(next, "reserved bytes", "0", "others");
  }
  return tile;
}

// Records the stream's kind: the first tile that has the stream decides it.
Status SequenceReader::note_stream(size_t at, size_t kind, const Tile& tile) {
  const uint32_t number = tile.streams[kind];
  if (kind > 0 && tile.brick_count == 0) {
    if (number == kNoStream) return {};
    return broken_sequence(at, "stream of a tile without bricks", "none", std::to_string(number));
  }
  if (number < streams_.size()) {
    if (streams_[number].kind == kind) return {};
    return broken_sequence(at, "a tile has a stream of another kind");
  }
  if (number != streams_.size()) {
    return broken_sequence(at, "number of a stream", "at most " + std::to_string(streams_.size()),
                           std::to_string(number));
  }
  Stream& stream = streams_.emplace_back();
  stream.kind = kind;
  const uint64_t voxels =
      std::min<uint64_t>(tile.voxel_count, uint64_t{tile.brick_count} * sizeof(BrickMask) * 8);
  stream.raw_max = kind == 0 ? kOctreeBytesMax : kChannels[kind - 1].bytes() * voxels;
  return {};
}

Status SequenceReader::read_streams(size_t at, size_t count, uint64_t end) {
  uint64_t offset = kSequenceHeaderBytes + padded(header_.meta_json.size());
  for (size_t i = 0; i < count; ++i) {
    VOXELD_TRY(read_stream(at + i * kStreamBytes, i, offset));
    offset += streams_[i].bytes;
    if (offset > end)
      return broken_sequence(at + i * kStreamBytes, "a stream lies beyond the index");
  }
  if (padded(offset) != end) return broken_sequence(offset, "bytes after the last stream");
  for (; offset < end; ++offset) {
    if (bytes_[offset] != 0)
      return broken_sequence(offset, "padding", "0", std::to_string(bytes_[offset]));
  }
  return {};
}

Status SequenceReader::read_stream(size_t at, size_t number, uint64_t offset) {
  Stream& stream = streams_[number];
  stream.offset = get<uint64_t>(bytes_, at);
  stream.bytes = get<uint32_t>(bytes_, at + 8);
  stream.base = get<uint32_t>(bytes_, at + 12);
  if (stream.offset != offset) {
    return broken_sequence(at, "offset of a stream", std::to_string(offset),
                           std::to_string(stream.offset));
  }
  if (stream.bytes == 0) return broken_sequence(at + 8, "bytes of a stream", "1 or more", "0");
  if (stream.base == kNoStream) return {};
  if (stream.base >= number || streams_[stream.base].kind != stream.kind || is_small(stream.kind)) {
    return broken_sequence(at + 12, "what a stream is a difference to",
                           "an earlier one of its kind and of codec fast",
                           std::to_string(stream.base));
  }
  stream.chain = streams_[stream.base].chain + 1;
  if (stream.chain <= kStreamChainMax) return {};
  return broken_sequence(at + 12, "streams that are read for one",
                         "at most " + std::to_string(kStreamChainMax),
                         std::to_string(stream.chain));
}

Result<SequenceReader> SequenceReader::open(std::span<const uint8_t> bytes) {
  SequenceReader reader;
  reader.bytes_ = bytes;
  VOXELD_TRY(reader.read_header());
  VOXELD_TRY(reader.read_meta(get<uint32_t>(bytes, 84)));
  VOXELD_TRY(reader.read_index(get<uint64_t>(bytes, 112)));
  return reader;
}

bool SequenceReader::same_tiles(size_t frame, size_t other) const {
  const Frame &a = frames_[frame], &b = frames_[other];
  return a.tile_count == b.tile_count && (a.tile_count == 0 || a.first_tile == b.first_tile);
}

}  // namespace voxeld
