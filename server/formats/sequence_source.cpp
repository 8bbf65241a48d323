// Makes the streams of a frame, from tiles or from those of their container.
#include "server/formats/sequence_source.h"

#include <string>
#include <utility>

#include "proto/codec/canonical_tile.h"
#include "proto/codec/octree_codec.h"
#include "proto/codec/stream_codec.h"
#include "proto/container/grid_layout.h"
#include "proto/container/grid_writer.h"
#include "proto/container/tile_streams.h"
#include "proto/thread_pool.h"
#include "server/base/sha256.h"

namespace voxeld {

using namespace sequence_layout;

namespace {

StreamKind kind_of(size_t kind) {
  return kind == 0 ? StreamKind::kOctree : stream_kind(kChannels[kind - 1].channel);
}

// The key of contents that do not depend on another stream.
std::string key_of(size_t kind, const std::vector<uint8_t>& contents) {
  return std::to_string(kind) + sha256_id(contents);
}

std::string counts_text(uint64_t bricks, uint64_t voxels) {
  return std::to_string(bricks) + " bricks and " + std::to_string(voxels) + " voxels";
}

// The contents of a stored stream. The tile has `mask_voxels` voxels with attributes.
Result<std::vector<uint8_t>> stored_contents(const StoredTile& tile, size_t kind,
                                             uint64_t mask_voxels) {
  const size_t expected = kind == 0 ? kOctreeBytesMax : kChannels[kind - 1].bytes() * mask_voxels;
  VOXELD_ASSIGN(std::vector<uint8_t> contents, decompress_stream(tile.streams[kind], expected));
  if (kind == 0 || contents.size() == expected) return contents;
  return Error{ErrorCode::kBadRequest, "grid container, attributes: their bytes",
               std::to_string(expected), std::to_string(contents.size())};
}

// Counts voxels with attributes, and checks that the octree has the tile's counts.
Result<uint64_t> counted_voxels(const StoredTile& tile, const std::vector<uint8_t>& octree) {
  VOXELD_ASSIGN(const OctreeCounts counts, count_octree(octree));
  if (counts.bricks == tile.brick_count && counts.voxels == tile.voxel_count) {
    return counts.mask_voxels;
  }
  return Error{ErrorCode::kBadRequest, "grid container, octree does not match its directory entry",
               counts_text(tile.brick_count, tile.voxel_count),
               counts_text(counts.bricks, counts.voxels)};
}

}  // namespace

// Fills the sources of one tile: kStreamKinds from `sources` on.
Status SequenceWriter::prepare(const SparseTile& tile, Tile& entry, Source* sources) const {
  VOXELD_TRY(check_tile(tile, header_));
  if (tile.empty()) return no_container("an empty tile");
  SparseTile copy;
  const SparseTile& canonical = canonical_form(tile, copy);
  std::shared_ptr<const SparseTile> shared(
      &canonical == &tile ? std::shared_ptr<const SparseTile>(std::shared_ptr<void>(), &tile)
                          : std::make_shared<const SparseTile>(std::move(copy)));
  entry.coord = tile.coord;
  entry.brick_count = static_cast<uint32_t>(shared->masks.size());
  entry.voxel_count = shared->voxel_count();
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    if (!has_stream(kind, entry.brick_count)) continue;
    Source& source = sources[kind];
    source.tile = shared;
    source.place = {grid_layout::tile_order(tile.coord), kind};
    source.contents = std::make_shared<const std::vector<uint8_t>>(
        kind == 0 ? octree_from_tile(*shared)
                  : raw_channel_stream(*shared, kChannels[kind - 1].channel));
    source.key = key_of(kind, *source.contents);
    // Codec small codes a channel in the order and by the neighbours of the octree, so the key
    // includes it.
    if (kind > 0 && codec(kind) == Codec::kSmall) source.key += sources[0].key;
  }
  return {};
}

Status SequenceWriter::prepare(const StoredTile& tile, Tile& entry, Source* sources) const {
  if (!grid_layout::inside(tile.coord, header_.dims)) return no_container("a tile lies outside");
  entry.coord = tile.coord;
  entry.brick_count = tile.brick_count;
  entry.voxel_count = tile.voxel_count;
  uint64_t mask_voxels = 0;
  for (size_t kind = 0; kind < kStreamKinds; ++kind) {
    const bool exists = has_stream(kind, tile.brick_count);
    if (tile.streams[kind].empty() == exists) return no_container("streams of other channels");
    if (!exists) continue;
    Source& source = sources[kind];
    source.place = {grid_layout::tile_order(tile.coord), kind};
    source.whole = tile.streams[kind];
    VOXELD_ASSIGN(std::vector<uint8_t> contents, stored_contents(tile, kind, mask_voxels));
    if (kind == 0) {
      VOXELD_ASSIGN(mask_voxels, counted_voxels(tile, contents));
    }
    source.key = key_of(kind, contents);
    source.contents = std::make_shared<const std::vector<uint8_t>>(std::move(contents));
  }
  return {};
}

bool SequenceWriter::has_stream(size_t kind, uint32_t brick_count) const {
  return kind == 0 || (brick_count > 0 && header_.channels.has(kChannels[kind - 1].channel));
}

Status SequenceWriter::encode(Source& source, bool as_difference) const {
  const size_t kind = source.place.second;
  if (as_difference) {
    VOXELD_ASSIGN(source.difference,
                  compress_stream(kind_of(kind), *source.contents, *source.base_contents));
    return {};
  }
  if (codec(kind) == Codec::kFast) {
    VOXELD_ASSIGN(source.encoded, compress_stream(kind_of(kind), *source.contents));
  } else if (kind == 0) {
    VOXELD_ASSIGN(source.encoded, encode_octree_stream(*source.tile, Codec::kSmall));
  } else {
    VOXELD_ASSIGN(source.encoded,
                  encode_channel_stream(*source.tile, kChannels[kind - 1].channel, Codec::kSmall));
  }
  source.whole = source.encoded;
  return {};
}

// Encodes only streams that the container does not have yet.
Status SequenceWriter::encode_all(std::vector<Source>& sources) const {
  std::vector<std::pair<Source*, bool>> work;  // the source, and whether as a difference
  for (Source& source : sources) {
    if (!source.is_new) continue;
    if (source.whole.empty()) work.emplace_back(&source, false);
    if (source.base != kNoStream) work.emplace_back(&source, true);
  }
  std::vector<Status> done(work.size());
  ThreadPool::shared().for_each(
      work.size(), [&](size_t i) { done[i] = encode(*work[i].first, work[i].second); });
  for (const Status& status : done) VOXELD_TRY(status);
  return {};
}

}  // namespace voxeld
