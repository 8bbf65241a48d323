// Native containers that are written while tiles arrive, and the sink that feeds them.
#pragma once

#include <cstdint>
#include <filesystem>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "proto/container/grid_writer.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/base/disk/file.h"
#include "server/grid/content_hash.h"
#include "server/voxel/tiles/tile_sink.h"

namespace voxeld {

class TileParts;

// Tiles are also kept in memory up to this size: a client that voxelizes a mesh mostly looks at it
// next.
inline constexpr size_t kKeptTileBytesMax = size_t{512} << 20;

// Writes one container. Holds a few encoded tiles in memory; more go to a file beside `path` until
// finish().
class GridFile {
 public:
  static constexpr size_t kPendingBytesMax = size_t{32} << 20;

  // pending_bytes_max: bytes of encoded tiles in memory.
  GridFile(std::filesystem::path path, Codec codec, size_t pending_bytes_max = kPendingBytesMax)
      : path_(std::move(path)), codec_(codec), pending_bytes_max_(pending_bytes_max) {}
  ~GridFile();
  GridFile(const GridFile&) = delete;
  GridFile& operator=(const GridFile&) = delete;

  Status begin(const Grid& grid);
  // Encodes the tiles, a few at a time in parallel.
  Status add(std::span<const SparseTile> tiles);
  // Adds tiles of a container with the same channels and codecs.
  Status add_encoded(std::span<const EncodedTile> tiles);
  // Writes the file at path().
  Status finish(const GridMeta& meta);
  // Starts the parts: the first begins with the next tile.
  Status begin_parts();
  // Writes a container of the tiles added since the last part.
  Status write_part(const std::filesystem::path& path, const std::string& meta_json);
  const GridHeader& header() const { return writer_->header(); }

  const std::filesystem::path& path() const { return path_; }
  uint64_t voxel_count() const { return writer_->voxel_count(); }

 private:
  Status store(const EncodedTile& tile);
  Status spill();
  std::filesystem::path spill_path() const { return path_.string() + ".tiles"; }

  std::filesystem::path path_;
  Codec codec_;
  size_t pending_bytes_max_;
  std::optional<GridWriter> writer_, part_;
  std::vector<uint8_t> pending_;  // after those in the file
  UniqueFd spilled_;
  uint64_t spilled_bytes_ = 0;
  uint64_t part_begin_ = 0;  // of the tiles' bytes
};

// The sink of a voxelize task: containers in one or two codecs, the content hash, and the grid
// itself if it is wanted or small.
class GridOutput : public TileSink {
 public:
  // keep: holds all tiles at any size; otherwise only while they need at most kept_bytes_max.
  // parts: stores the first file's tiles for a later attempt; null: does not.
  GridOutput(std::vector<GridFile*> files, bool keep, size_t kept_bytes_max = kKeptTileBytesMax,
             TileParts* parts = nullptr)
      : files_(std::move(files)), keep_(keep), kept_bytes_max_(kept_bytes_max), parts_(parts) {}

  Status begin(const Grid& grid) override;
  Status add(std::vector<SparseTile> tiles) override;
  bool keeps_tiles() const override { return keep_; }
  Result<size_t> resume(size_t steps) override;
  Status reached(size_t steps_done) override;
  // Call it once, after the last tile.
  std::string finish_hash() { return hasher_->finish(); }

  const Grid& grid() const { return grid_; }  // has tiles only if has_tiles()
  Grid take_grid() { return std::move(grid_); }
  bool has_tiles() const { return has_tiles_; }
  uint64_t voxel_count() const { return files_.front()->voxel_count(); }
  double encode_ms() const { return encode_ms_; }

 private:
  // Hashes and keeps tiles that all files have already.
  void note(std::vector<SparseTile> tiles);

  std::vector<GridFile*> files_;
  bool keep_;
  size_t kept_bytes_max_;
  TileParts* parts_;
  Grid grid_;
  std::optional<ContentHasher> hasher_;
  size_t kept_bytes_ = 0;
  bool has_tiles_ = true;
  double encode_ms_ = 0;
};

}  // namespace voxeld
