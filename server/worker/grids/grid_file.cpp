#include "server/worker/grids/grid_file.h"

#include <fcntl.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <system_error>

#include "server/base/cancel_point.h"
#include "server/base/clock.h"
#include "server/base/parallel.h"
#include "server/grid/tile_source.h"
#include "server/worker/grids/tile_parts.h"

namespace voxeld {
namespace {

constexpr size_t kCopyBytes = size_t{4} << 20;

Result<UniqueFd> create(const std::filesystem::path& path) {
  UniqueFd fd(::open(path.c_str(), O_RDWR | O_CREAT | O_TRUNC | O_CLOEXEC, 0600));
  if (!fd.valid()) return errno_error("create", path);
  return fd;
}

// Appends all of `from`, from byte `at` on, to `to`.
Status copy_rest(const UniqueFd& from, off_t at, const UniqueFd& to,
                 const std::filesystem::path& path) {
  std::vector<uint8_t> buffer(kCopyBytes);
  for (;;) {
    const ssize_t count = ::pread(from.get(), buffer.data(), buffer.size(), at);
    if (count < 0 && errno == EINTR) continue;
    if (count < 0) return errno_error("read", path);
    if (count == 0) return {};
    VOXELD_TRY(write_in_pieces(to.get(), std::span(buffer).first(static_cast<size_t>(count))));
    at += count;
  }
}

}  // namespace

GridFile::~GridFile() {
  std::error_code ignored;
  if (spilled_.valid()) std::filesystem::remove(spill_path(), ignored);
}

Status GridFile::begin(const Grid& grid) {
  GridHeader header = container_header(grid);
  header.codecs = StreamCodecs::all(codec_);
  VOXELD_ASSIGN(writer_, GridWriter::open(header));
  VOXELD_ASSIGN(part_, GridWriter::open(std::move(header)));
  return {};
}

// Like encode_tiles(), within the task's CancelScope.
Status GridFile::add(std::span<const SparseTile> tiles) {
  std::vector<Result<EncodedTile>> encoded(tiles.size(), Result<EncodedTile>(EncodedTile()));
  parallel_for(tiles.size(), [&](size_t i) {
    cancel_point();
    if (!tiles[i].empty()) encoded[i] = encode_tile(tiles[i], writer_->header());
  });
  for (Result<EncodedTile>& tile : encoded) {
    if (!tile) return std::move(tile).error();
    if (!tile->octree.empty()) VOXELD_TRY(store(*tile));
  }
  return {};
}

Status GridFile::add_encoded(std::span<const EncodedTile> tiles) {
  for (const EncodedTile& tile : tiles) VOXELD_TRY(store(tile));
  return {};
}

Status GridFile::store(const EncodedTile& tile) {
  VOXELD_TRY(writer_->add(tile));
  VOXELD_TRY(part_->add(tile));
  tile.append_to(pending_);
  return pending_.size() < pending_bytes_max_ ? Status() : spill();
}

Status GridFile::spill() {
  if (!spilled_.valid()) {
    VOXELD_ASSIGN(spilled_, create(spill_path()));
  }
  VOXELD_TRY(write_in_pieces(spilled_.get(), pending_));
  spilled_bytes_ += pending_.size();
  pending_.clear();
  return {};
}

Status GridFile::begin_parts() {
  part_begin_ = spilled_bytes_ + pending_.size();
  VOXELD_ASSIGN(part_, GridWriter::open(writer_->header()));
  return {};
}

Status GridFile::write_part(const std::filesystem::path& path, const std::string& meta_json) {
  VOXELD_ASSIGN(const std::vector<uint8_t> front, part_->finish(meta_json));
  VOXELD_ASSIGN(const UniqueFd file, create(path));
  VOXELD_TRY(write_in_pieces(file.get(), front));
  if (part_begin_ < spilled_bytes_) {
    VOXELD_TRY(copy_rest(spilled_, static_cast<off_t>(part_begin_), file, spill_path()));
  }
  const uint64_t of_pending = std::max(part_begin_, spilled_bytes_) - spilled_bytes_;
  VOXELD_TRY(write_in_pieces(file.get(), std::span(pending_).subspan(of_pending)));
  return begin_parts();
}

Status GridFile::finish(const GridMeta& meta) {
  VOXELD_ASSIGN(const std::vector<uint8_t> front, writer_->finish(meta.text()));
  VOXELD_ASSIGN(const UniqueFd file, create(path_));
  VOXELD_TRY(write_in_pieces(file.get(), front));
  if (spilled_.valid()) VOXELD_TRY(copy_rest(spilled_, 0, file, spill_path()));
  return write_in_pieces(file.get(), pending_);
}

Status GridOutput::begin(const Grid& grid) {
  grid_ = grid;
  hasher_.emplace(grid);
  for (GridFile* file : files_) VOXELD_TRY(file->begin(grid));
  return {};
}

Status GridOutput::add(std::vector<SparseTile> tiles) {
  const Stopwatch watch;
  for (GridFile* file : files_) VOXELD_TRY(file->add(tiles));
  note(std::move(tiles));
  encode_ms_ += watch.ms();
  return {};
}

void GridOutput::note(std::vector<SparseTile> tiles) {
  for (const SparseTile& tile : tiles) {
    cancel_point();
    hasher_->add(tile);
    kept_bytes_ += tile_bytes(tile);
  }
  if (!keep_ && kept_bytes_ > kept_bytes_max_) {
    has_tiles_ = false;
    grid_.tiles = {};
  }
  if (!has_tiles_) return;
  for (SparseTile& tile : tiles) grid_.tiles.push_back(std::move(tile));
}

Result<size_t> GridOutput::resume(size_t steps) {
  if (parts_ == nullptr) return size_t{0};
  // Tiles of parts are already encoded for the first file; encoding would be most of their cost.
  const auto take = [this](std::span<const EncodedTile> encoded,
                           std::vector<SparseTile> tiles) -> Status {
    const Stopwatch watch;
    VOXELD_TRY(files_.front()->add_encoded(encoded));
    for (size_t i = 1; i < files_.size(); ++i) VOXELD_TRY(files_[i]->add(tiles));
    note(std::move(tiles));
    encode_ms_ += watch.ms();
    return {};
  };
  VOXELD_ASSIGN(const size_t done, parts_->load(steps, files_.front()->header(), take));
  VOXELD_TRY(files_.front()->begin_parts());
  return done;
}

Status GridOutput::reached(size_t steps_done) {
  return parts_ == nullptr ? Status() : parts_->reached(*files_.front(), steps_done);
}

}  // namespace voxeld
