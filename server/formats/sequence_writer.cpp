#include "server/formats/sequence_writer.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "proto/canonical_tile.h"
#include "proto/grid_layout.h"
#include "proto/grid_writer.h"
#include "proto/octree_codec.h"
#include "proto/parallel.h"
#include "proto/stream_codec.h"
#include "proto/tile_streams.h"
#include "server/base/sha256.h"

namespace voxeld {

using grid_layout::padded;
using grid_layout::put;
using namespace sequence_layout;

namespace {

Error internal(const std::string& detail) {
  return {ErrorCode::kInternal, "sequence container: " + detail, "", ""};
}

constexpr StreamKind stream_kind(size_t kind) {
  return kind == 0 ? StreamKind::kOctree : StreamKind::kPlanes;
}

// A difference costs readers another stream: it has to be smaller than 15/16 of the whole.
bool is_worth_it(size_t difference_bytes, size_t plain_bytes) {
  return difference_bytes < plain_bytes - plain_bytes / 16;
}

// The lists of a container end where memory does, but numbers have 32 bits.
bool has_room(uint64_t count, size_t more) {
  return count + more < kNoStream;
}

}  // namespace

// Sources of one tile share its canonical form. What is known of a stream already is stored once.
struct SequenceWriter::Source {
  std::shared_ptr<const SparseTile> tile;  // null: no such stream
  Place place;
  std::string key;
  Contents contents;  // what codec fast compresses
  uint32_t number = kNoStream;
  bool is_new = false;
  // Of those that are new:
  uint32_t base = kNoStream;
  Contents base_contents;
  std::vector<uint8_t> plain, difference;
};

SequenceWriter::SequenceWriter(GridHeader header, double fps, const SequenceWriterOptions& options)
    : header_(std::move(header)),
      fps_(fps),
      options_(options),
      offset_(kSequenceHeaderBytes + padded(header_.meta_json.size())) {}

Result<SequenceWriter> SequenceWriter::open(GridHeader header, double fps,
                                            const SequenceWriterOptions& options) {
  if (const Status status = grid_layout::check_header(header, 16); !status) {
    return internal(status.error().message());
  }
  if (header.meta_json.size() > grid_layout::kMetaBytesMax) return internal("meta is too long");
  if (!std::isfinite(fps) || fps < 0) return internal("frames per second");
  if (options.chain_max < 1 || options.chain_max > kStreamChainMax) return internal("chain_max");
  return SequenceWriter(std::move(header), fps + 0.0, options);  // -0 becomes 0
}

std::vector<uint8_t> SequenceWriter::front() const {
  std::vector<uint8_t> out(kSequenceHeaderBytes + padded(header_.meta_json.size()));
  std::memcpy(out.data() + kSequenceHeaderBytes, header_.meta_json.data(),
              header_.meta_json.size());
  return out;
}

Codec SequenceWriter::codec(size_t kind) const {
  return kind == 0 ? header_.codecs.octree : header_.codecs.channels[kind - 1];
}

Status SequenceWriter::check_next(double time_s, std::span<const SparseTile> tiles) const {
  if (frames_.size() >= static_cast<size_t>(limits::kFramesMax)) return internal("too many frames");
  if (!std::isfinite(time_s) || (!frames_.empty() && time_s < frames_.back().time_s)) {
    return internal("times go back");
  }
  const auto order = [](const SparseTile& tile) { return grid_layout::tile_order(tile.coord); };
  if (std::ranges::adjacent_find(tiles, std::ranges::greater_equal{}, order) != tiles.end()) {
    return internal("tiles are not in ascending Morton order");
  }
  if (!has_room(tiles_.size(), tiles.size()) ||
      !has_room(streams_.size(), tiles.size() * kStreamKinds)) {
    return internal("too many tiles");
  }
  return {};
}

// The sources of one tile: kStreamKinds from `sources` on.
Status SequenceWriter::prepare(const SparseTile& tile, Source* sources) const {
  VOXELD_TRY(check_tile(tile, header_));
  if (tile.empty()) return internal("an empty tile");
  SparseTile copy;
  const SparseTile& canonical = canonical_form(tile, copy);
  std::shared_ptr<const SparseTile> shared(
      &canonical == &tile ? std::shared_ptr<const SparseTile>(std::shared_ptr<void>(), &tile)
                          : std::make_shared<const SparseTile>(std::move(copy)));
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    const bool exists =
        kind == 0 || (header_.channels.has(kChannels[kind - 1].channel) && !shared->masks.empty());
    if (!exists) continue;
    Source& source = sources[kind];
    source.tile = shared;
    source.place = {grid_layout::tile_order(tile.coord), kind};
    source.contents = std::make_shared<const std::vector<uint8_t>>(
        kind == 0 ? octree_from_tile(*shared)
                  : raw_channel_stream(*shared, kChannels[kind - 1].channel));
    source.key = std::to_string(kind) + sha256_id(*source.contents);
    // Codec small tells a channel in the order and by the neighbours that the octree gives.
    if (kind > 0 && codec(kind) == Codec::kSmall) source.key += sources[0].key;
  }
  return {};
}

// Gives every source its number: that of an equal stream, or the next one.
void SequenceWriter::find_known(std::vector<Source>& sources) {
  auto next = static_cast<uint32_t>(streams_.size());
  for (Source& source : sources) {
    if (source.tile == nullptr) continue;
    const auto [known, is_new] = number_of_.try_emplace(source.key, next);
    source.number = known->second;
    source.is_new = is_new;
    if (!is_new) continue;
    ++next;
    if (codec(source.place.second) == Codec::kFast) find_base(source);
  }
}

// What the place had in the last frame; where the chain is too long by then, what it began with.
void SequenceWriter::find_base(Source& source) const {
  const auto before = kept_.find(source.place);
  if (before == kept_.end() || options_.chain_max == 1) return;
  const Kept& kept = before->second;
  const Stream& stream = streams_[kept.number];
  const bool is_long = stream.chain >= options_.chain_max;
  if (is_long && kept.root == nullptr) return;
  source.base = is_long ? stream.root : kept.number;
  source.base_contents = is_long ? kept.root : kept.contents;
}

Status SequenceWriter::encode(Source& source, bool as_difference) const {
  const size_t kind = source.place.second;
  if (as_difference) {
    VOXELD_ASSIGN(source.difference,
                  compress_stream(stream_kind(kind), *source.contents, *source.base_contents));
  } else if (codec(kind) == Codec::kFast) {
    VOXELD_ASSIGN(source.plain, compress_stream(stream_kind(kind), *source.contents));
  } else if (kind == 0) {
    VOXELD_ASSIGN(source.plain, encode_octree_stream(*source.tile, Codec::kSmall));
  } else {
    VOXELD_ASSIGN(source.plain,
                  encode_channel_stream(*source.tile, kChannels[kind - 1].channel, Codec::kSmall));
  }
  return {};
}

Status SequenceWriter::encode_all(std::vector<Source>& sources) const {
  std::vector<std::pair<Source*, bool>> work;  // the source, and whether as a difference
  for (Source& source : sources) {
    if (!source.is_new) continue;
    work.emplace_back(&source, false);
    if (source.base != kNoStream) work.emplace_back(&source, true);
  }
  std::vector<Status> done(work.size());
  for_each_parallel(work.size(),
                    [&](size_t i) { done[i] = encode(*work[i].first, work[i].second); });
  for (const Status& status : done) VOXELD_TRY(status);
  return {};
}

void SequenceWriter::store(Source& source, std::vector<uint8_t>& out) {
  if (!source.is_new) return;
  if (source.base != kNoStream && !is_worth_it(source.difference.size(), source.plain.size())) {
    source.base = kNoStream;
  }
  const bool is_plain = source.base == kNoStream;
  const std::vector<uint8_t>& bytes = is_plain ? source.plain : source.difference;
  const Stream base = is_plain ? Stream{0, 0, 0, 0, source.number} : streams_[source.base];
  streams_.push_back(
      {offset_, static_cast<uint32_t>(bytes.size()), source.base, base.chain + 1, base.root});
  offset_ += bytes.size();
  out.insert(out.end(), bytes.begin(), bytes.end());
}

// Remembers the frame's contents for the next one.
void SequenceWriter::keep(std::vector<Source>& sources) {
  std::map<Place, Kept> kept;
  size_t bytes = 0;
  for (Source& source : sources) {
    if (source.tile == nullptr || codec(source.place.second) != Codec::kFast) continue;
    const Stream& stream = streams_[source.number];
    Kept now = {source.number, std::move(source.contents), nullptr};
    const auto before = kept_.find(source.place);
    if (stream.root == source.number) {
      now.root = now.contents;
    } else if (before != kept_.end() && streams_[before->second.number].root == stream.root) {
      now.root = before->second.root;
    }
    bytes += now.contents->size();
    if (now.root != nullptr && now.root != now.contents) bytes += now.root->size();
    if (bytes > options_.kept_bytes_max) break;
    kept.emplace(source.place, std::move(now));
  }
  kept_ = std::move(kept);
}

void SequenceWriter::add_tiles(double time_s, std::span<const SparseTile> tiles,
                               const std::vector<Source>& sources) {
  Frame frame = {time_s, 0, static_cast<uint32_t>(tiles_.size()),
                 static_cast<uint32_t>(tiles.size())};
  std::string key;
  for (size_t i = 0; i < tiles.size(); ++i) {
    const Source* first = &sources[i * kStreamKinds];
    Tile& tile = tiles_.emplace_back();
    tile.coord = tiles[i].coord;
    tile.brick_count = static_cast<uint32_t>(first->tile->masks.size());
    tile.voxel_count = first->tile->voxel_count();
    for (size_t kind = 0; kind < kStreamKinds; ++kind) tile.streams[kind] = first[kind].number;
    frame.voxel_count += tile.voxel_count;
    key += std::to_string(grid_layout::tile_order(tile.coord)) + ":";
    for (const uint32_t number : tile.streams) key += std::to_string(number) + ",";
  }
  if (!tiles.empty()) {
    const auto [known, is_new] = frame_of_.try_emplace(sha256_id(key), frame);
    if (!is_new) {
      tiles_.resize(frame.first_tile);
      frame.first_tile = known->second.first_tile;
    }
  }
  frames_.push_back(frame);
}

Result<std::vector<uint8_t>> SequenceWriter::add(double time_s, std::span<const SparseTile> tiles) {
  VOXELD_TRY(check_next(time_s, tiles));
  std::vector<Source> sources(tiles.size() * kStreamKinds);
  std::vector<Status> done(tiles.size());
  for_each_parallel(tiles.size(),
                    [&](size_t i) { done[i] = prepare(tiles[i], &sources[i * kStreamKinds]); });
  for (const Status& status : done) VOXELD_TRY(status);
  find_known(sources);
  VOXELD_TRY(encode_all(sources));
  std::vector<uint8_t> out;
  for (Source& source : sources) store(source, out);
  add_tiles(time_s, tiles, sources);
  keep(sources);
  return out;
}

std::vector<uint8_t> SequenceWriter::header(uint64_t index, uint64_t bytes) const {
  std::vector<uint8_t> out(kSequenceHeaderBytes);
  std::memcpy(out.data(), kMagic, sizeof kMagic);
  put(out, 8, kSequenceVersion);
  put(out, 12, channel_bits(header_.channels));
  put(out, 16, header_.dims);
  put(out, 28, grid_layout::kTileLog2);
  put(out, 32, header_.origin);
  put(out, 56, header_.voxel_size);
  put(out, 80, static_cast<uint32_t>(frames_.size()));
  put(out, 84, static_cast<uint32_t>(header_.meta_json.size()));
  put(out, 88, fps_);
  put(out, 96, bytes);
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    if (kind > 0 && !header_.channels.has(kChannels[kind - 1].channel)) continue;
    put(out, grid_layout::kCodecsByte + kind,
        static_cast<uint8_t>(codec(kind) == Codec::kSmall ? 1 : 0));
  }
  put(out, 112, index);
  put(out, 120, static_cast<uint32_t>(tiles_.size()));
  put(out, 124, static_cast<uint32_t>(streams_.size()));
  return out;
}

void SequenceWriter::put_tile(std::vector<uint8_t>& out, size_t at, const Tile& tile) const {
  put(out, at, tile.coord);
  put(out, at + 12, tile.brick_count);
  put(out, at + 16, tile.voxel_count);
  size_t next = at + kTileStreamsByte;
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    if (kind > 0 && !header_.channels.has(kChannels[kind - 1].channel)) continue;
    put(out, next, tile.streams[kind]);
    next += 4;
  }
}

Result<SequenceWriter::End> SequenceWriter::finish() const {
  if (frames_.empty()) return internal("no frame");
  const size_t entry_bytes = tile_bytes(header_.channels);
  const size_t frames_at = padded(offset_) - offset_;
  const size_t tiles_at = frames_at + kFrameBytes * frames_.size();
  const size_t streams_at = tiles_at + entry_bytes * tiles_.size();
  std::vector<uint8_t> index(streams_at + kStreamBytes * streams_.size());
  for (size_t i = 0; i < frames_.size(); ++i) {
    const size_t at = frames_at + i * kFrameBytes;
    put(index, at, frames_[i].time_s);
    put(index, at + 8, frames_[i].voxel_count);
    put(index, at + 16, frames_[i].first_tile);
    put(index, at + 20, frames_[i].tile_count);
  }
  for (size_t i = 0; i < tiles_.size(); ++i) put_tile(index, tiles_at + i * entry_bytes, tiles_[i]);
  for (size_t i = 0; i < streams_.size(); ++i) {
    const size_t at = streams_at + i * kStreamBytes;
    put(index, at, streams_[i].offset);
    put(index, at + 8, streams_[i].bytes);
    put(index, at + 12, streams_[i].base);
  }
  return End{header(padded(offset_), offset_ + index.size()), std::move(index)};
}

}  // namespace voxeld
