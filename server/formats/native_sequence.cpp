#include "server/formats/native_sequence.h"

#include <optional>
#include <string>
#include <system_error>
#include <utility>
#include <vector>

#include "proto/container/grid_streams.h"
#include "server/base/disk/file.h"
#include "server/base/disk/mapped_pages.h"
#include "server/formats/formats.h"
#include "server/grid/tile_source.h"

namespace voxeld {
namespace {

bool same_place(const GridHeader& a, const GridHeader& b) {
  return a.dims == b.dims && a.origin == b.origin && a.voxel_size == b.voxel_size &&
         a.channels == b.channels;
}

// The end of the batch that begins with tile `begin`.
size_t batch_end(const GridReader& reader, size_t begin) {
  const uint64_t voxel_bytes = 1 + attribute_bytes(reader.header().channels);
  size_t end = begin;
  for (uint64_t bytes = 0; end < reader.tile_count(); ++end) {
    bytes += reader.tile_voxel_count(end) * voxel_bytes;
    if (end > begin && bytes > NativeSequence::kBatchBytesMax) break;
  }
  return end;
}

Error of_frame(size_t frame, Error error) {
  if (error.code != ErrorCode::kCancelled) {
    error.detail = "frame " + std::to_string(frame) + ": " + error.detail;
  }
  return error;
}

}  // namespace

NativeSequence::NativeSequence(SequenceWriter writer, OutputFile file, GridHeader header,
                               std::filesystem::path path)
    : writer_(std::move(writer)),
      file_(std::move(file)),
      header_(std::move(header)),
      path_(std::move(path)) {}

NativeSequence::~NativeSequence() {
  std::error_code ignored;
  if (!is_finished_) std::filesystem::remove(path_, ignored);
}

Result<std::unique_ptr<NativeSequence>> NativeSequence::create(const Grid& common, double fps,
                                                               Codec codec,
                                                               const std::filesystem::path& path) {
  GridHeader header = container_header(common);
  header.codecs = StreamCodecs::all(codec);
  VOXELD_ASSIGN(SequenceWriter writer, SequenceWriter::open(header, fps));
  VOXELD_ASSIGN(OutputFile file, OutputFile::create(path));
  std::unique_ptr<NativeSequence> sequence(
      new NativeSequence(std::move(writer), std::move(file), std::move(header), path));
  VOXELD_TRY(sequence->file_.append(sequence->writer_.front()));
  return sequence;
}

Status NativeSequence::add(double time_s, std::span<const SparseTile> tiles) {
  VOXELD_ASSIGN(const std::vector<uint8_t> bytes, writer_.add(time_s, tiles));
  ++frames_;
  return file_.append(bytes);
}

Status NativeSequence::add_container(double time_s, const std::filesystem::path& container,
                                     const BeforeTiles& before_tiles) {
  VOXELD_TRY(writer_.begin_frame(time_s));
  Status added = add_tiles_of(container, before_tiles);
  if (!added) return of_frame(frames_, std::move(added).error());
  writer_.end_frame();
  ++frames_;
  return {};
}

Status NativeSequence::add_tiles_of(const std::filesystem::path& container,
                                    const BeforeTiles& before_tiles) {
  VOXELD_ASSIGN(const MappedFile file, MappedFile::open(container));
  VOXELD_ASSIGN(const GridReader reader, GridReader::open(file.bytes()));
  if (!same_place(reader.header(), header_)) {
    return Error{ErrorCode::kInternal, "the container of another place, or with other channels", "",
                 ""};
  }
  size_t begin = 0;
  do {  // runs once if there are no tiles
    if (before_tiles) VOXELD_TRY(before_tiles(begin, reader.tile_count()));
    const size_t end = batch_end(reader, begin);
    VOXELD_TRY(add_batch(file.bytes(), reader, begin, end));
    if (end < reader.tile_count()) drop_mapped_pages(file.bytes());
    begin = end;
  } while (begin < reader.tile_count());
  return {};
}

Status NativeSequence::add_batch(std::span<const uint8_t> bytes, const GridReader& reader,
                                 size_t begin, size_t end) {
  const StreamCodecs fast = StreamCodecs::all(Codec::kFast);  // as a reader sees it: absent
                                                              // channels are fast too
  std::vector<uint8_t> out;
  if (header_.codecs == fast && reader.header().codecs == fast) {
    std::vector<StoredTile> tiles;
    for (size_t i = begin; i < end; ++i) tiles.push_back(stored_tile(bytes, reader, i));
    VOXELD_ASSIGN(out, writer_.add_stored(tiles));
  } else {
    VOXELD_ASSIGN(const std::vector<SparseTile> tiles,
                  read_tiles(ContainerTiles(reader), begin, end));
    VOXELD_ASSIGN(out, writer_.add_tiles(tiles));
  }
  return file_.append(out);
}

Status NativeSequence::finish() {
  VOXELD_ASSIGN(const SequenceWriter::End end, writer_.finish());
  VOXELD_TRY(file_.append(end.index));
  VOXELD_TRY(file_.replace(0, end.header));
  is_finished_ = true;
  return {};
}

Status write_native_sequence(const FrameSource& source, const OutputOptions& options,
                             const std::filesystem::path& path) {
  VOXELD_ASSIGN(const auto sequence,
                NativeSequence::create(source.common(), source.fps(), options.codec, path));
  for (size_t i = 0; i < source.frame_count(); ++i) {
    const double time_s = source.time_s(i);
    if (const auto container = source.container(i)) {
      const auto before = [&](size_t done, size_t total) {
        return source.before_tiles(done, total);
      };
      VOXELD_TRY(sequence->add_container(time_s, *container, before));
    } else {
      VOXELD_ASSIGN(const Grid frame, source.frame(i));
      VOXELD_TRY(sequence->add(time_s, frame.tiles));
    }
  }
  return sequence->finish();
}

}  // namespace voxeld
