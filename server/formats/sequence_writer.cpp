#include "server/formats/sequence_writer.h"

#include <algorithm>
#include <cmath>
#include <cstring>

#include "proto/container/grid_layout.h"
#include "proto/thread_pool.h"
#include "server/base/sha256.h"
#include "server/formats/sequence_source.h"

namespace voxeld {

using grid_layout::padded;
using grid_layout::put;
using namespace sequence_layout;

namespace {

// A difference makes readers decode a further stream, so it must be smaller than 15/16 of the
// whole.
bool is_worth_it(size_t difference_bytes, size_t plain_bytes) {
  return difference_bytes < plain_bytes - plain_bytes / 16;
}

// The most frames without a try after a failed difference; consecutive failures lead there. For
// slow motion, differences succeed again and again. For fast motion, each try would cost more than
// all other work on the stream.
constexpr uint32_t kRestFramesMax = 3;

// Memory bounds the lists of a container, but numbers have only 32 bits.
bool has_room(uint64_t count, size_t more) {
  return count + more < kNoStream;
}

}  // namespace

SequenceWriter::SequenceWriter(GridHeader header, double fps, const SequenceWriterOptions& options)
    : header_(std::move(header)),
      fps_(fps),
      options_(options),
      offset_(kSequenceHeaderBytes + padded(header_.meta_json.size())) {}

Result<SequenceWriter> SequenceWriter::open(GridHeader header, double fps,
                                            const SequenceWriterOptions& options) {
  if (const Status status = grid_layout::check_header(header, 16); !status) {
    return no_container(status.error().message());
  }
  if (header.meta_json.size() > grid_layout::kMetaBytesMax) return no_container("meta is too long");
  if (!std::isfinite(fps) || fps < 0) return no_container("frames per second");
  if (options.chain_max < 1 || options.chain_max > kStreamChainMax) {
    return no_container("chain_max");
  }
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

Status SequenceWriter::begin_frame(double time_s) {
  if (frames_.size() >= static_cast<size_t>(limits::kFramesMax)) {
    return no_container("too many frames");
  }
  if (!std::isfinite(time_s) || (!frames_.empty() && time_s < frames_.back().time_s)) {
    return no_container("times go back");
  }
  frame_ = {time_s, 0, static_cast<uint32_t>(tiles_.size()), 0};
  next_kept_.clear();
  next_kept_bytes_ = 0;
  return {};
}

// Checks that the tiles follow those of the frame so far.
Status SequenceWriter::check_order(std::span<const std::array<int32_t, 3>> coords) const {
  const bool ascends = std::ranges::adjacent_find(coords, std::ranges::greater_equal{},
                                                  grid_layout::tile_order) == coords.end();
  const bool follows =
      frame_.tile_count == 0 || coords.empty() ||
      grid_layout::tile_order(tiles_.back().coord) < grid_layout::tile_order(coords.front());
  if (!ascends || !follows) return no_container("tiles are not in ascending Morton order");
  if (!has_room(tiles_.size(), coords.size()) ||
      !has_room(streams_.size(), coords.size() * kStreamKinds)) {
    return no_container("too many tiles");
  }
  return {};
}

// Gives every source its number: that of an equal stream, or the next one.
void SequenceWriter::find_known(std::vector<Source>& sources) {
  auto next = static_cast<uint32_t>(streams_.size());
  for (Source& source : sources) {
    if (!source.exists()) continue;
    const auto [known, is_new] = number_of_.try_emplace(source.key, next);
    source.number = known->second;
    source.is_new = is_new;
    if (!is_new) continue;
    ++next;
    if (codec(source.place.second) == Codec::kFast) find_base(source);
  }
}

// The base is the place's stream in the last frame, or the first of its chain if the chain is too
// long.
void SequenceWriter::find_base(Source& source) const {
  const auto before = kept_.find(source.place);
  if (before == kept_.end() || options_.chain_max == 1) return;
  const Kept& kept = before->second;
  const Stream& stream = streams_[kept.number];
  const bool is_long = stream.chain >= options_.chain_max;
  if (kept.tries.left > 0 || (is_long && kept.root == nullptr)) return;
  source.base = is_long ? stream.root : kept.number;
  source.base_contents = is_long ? kept.root : kept.contents;
  source.was_tried = true;
}

void SequenceWriter::store(Source& source, std::vector<uint8_t>& out) {
  if (source.base != kNoStream && !is_worth_it(source.difference.size(), source.whole.size())) {
    source.base = kNoStream;
  }
  const bool is_whole = source.base == kNoStream;
  const std::span<const uint8_t> bytes = is_whole ? source.whole : source.difference;
  const Stream base = is_whole ? Stream{0, 0, 0, 0, source.number} : streams_[source.base];
  streams_.push_back(
      {offset_, static_cast<uint32_t>(bytes.size()), source.base, base.chain + 1, base.root});
  offset_ += bytes.size();
  out.insert(out.end(), bytes.begin(), bytes.end());
}

// Stores the source's contents for the next frame, in place of the last frame's.
void SequenceWriter::keep(Source& source) {
  const auto before = kept_.extract(source.place);
  if (codec(source.place.second) != Codec::kFast) return;
  if (next_kept_bytes_ > options_.kept_bytes_max) return;
  const Stream& stream = streams_[source.number];
  Kept now = {source.number, std::move(source.contents), nullptr, {}};
  if (source.was_tried && source.base == kNoStream) {
    const uint32_t rest = std::min(2 * before.mapped().tries.rest + 1, kRestFramesMax);
    now.tries = {rest, rest};
  } else if (!source.was_tried && !before.empty()) {
    now.tries = before.mapped().tries;
    if (now.tries.left > 0) --now.tries.left;
  }
  if (stream.root == source.number) {
    now.root = now.contents;
  } else if (!before.empty() && streams_[before.mapped().number].root == stream.root) {
    now.root = before.mapped().root;
  }
  next_kept_bytes_ += now.contents->size();
  if (now.root != nullptr && now.root != now.contents) next_kept_bytes_ += now.root->size();
  if (next_kept_bytes_ <= options_.kept_bytes_max) next_kept_.emplace(source.place, std::move(now));
}

template <typename AnyTile>
Result<std::vector<uint8_t>> SequenceWriter::add_part(std::span<const AnyTile> tiles) {
  std::vector<std::array<int32_t, 3>> coords;
  for (const AnyTile& tile : tiles) coords.push_back(tile.coord);
  VOXELD_TRY(check_order(coords));
  std::vector<Tile> entries(tiles.size());
  std::vector<Source> sources(tiles.size() * kStreamKinds);
  std::vector<Status> done(tiles.size());
  ThreadPool::shared().for_each(tiles.size(), [&](size_t i) {
    done[i] = prepare(tiles[i], entries[i], &sources[i * kStreamKinds]);
  });
  for (const Status& status : done) VOXELD_TRY(status);
  find_known(sources);
  VOXELD_TRY(encode_all(sources));
  std::vector<uint8_t> out;
  for (Source& source : sources) {
    if (source.is_new) store(source, out);
  }
  for (size_t i = 0; i < sources.size(); ++i) {
    entries[i / kStreamKinds].streams[i % kStreamKinds] = sources[i].number;
    if (sources[i].exists()) keep(sources[i]);
  }
  for (const Tile& entry : entries) {
    tiles_.push_back(entry);
    frame_.voxel_count += entry.voxel_count;
    ++frame_.tile_count;
  }
  return out;
}

Result<std::vector<uint8_t>> SequenceWriter::add_tiles(std::span<const SparseTile> tiles) {
  return add_part(tiles);
}

Result<std::vector<uint8_t>> SequenceWriter::add_stored(std::span<const StoredTile> tiles) {
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    const bool exists = kind == 0 || header_.channels.has(kChannels[kind - 1].channel);
    if (exists && codec(kind) != Codec::kFast) {
      return no_container("streams are taken over as fast");
    }
  }
  return add_part(tiles);
}

void SequenceWriter::end_frame() {
  kept_ = std::move(next_kept_);
  next_kept_.clear();
  std::string key;
  for (size_t i = frame_.first_tile; i < tiles_.size(); ++i) {
    key += std::to_string(grid_layout::tile_order(tiles_[i].coord)) + ":";
    for (const uint32_t number : tiles_[i].streams) key += std::to_string(number) + ",";
  }
  if (frame_.tile_count > 0) {
    const auto [known, is_new] = frame_of_.try_emplace(sha256_id(key), frame_);
    if (!is_new) {
      tiles_.resize(frame_.first_tile);
      frame_.first_tile = known->second.first_tile;
    }
  }
  frames_.push_back(frame_);
}

Result<std::vector<uint8_t>> SequenceWriter::add(double time_s, std::span<const SparseTile> tiles) {
  VOXELD_TRY(begin_frame(time_s));
  VOXELD_ASSIGN(std::vector<uint8_t> out, add_tiles(tiles));
  end_frame();
  return out;
}

std::vector<uint8_t> SequenceWriter::header(uint64_t index, uint64_t bytes) const {
  std::vector<uint8_t> out(kSequenceHeaderBytes);
  std::memcpy(out.data(), kSequenceMagic, sizeof kSequenceMagic);
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
  if (frames_.empty()) return no_container("no frame");
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
