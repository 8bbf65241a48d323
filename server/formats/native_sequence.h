// The native container of a sequence as a file that grows frame by frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "proto/container/grid_format.h"
#include "proto/options/options.h"
#include "proto/result.h"
#include "server/formats/output_file.h"
#include "server/formats/sequence_writer.h"
#include "server/grid/grid.h"

namespace voxeld {

class NativeSequence {
 public:
  // Bytes of tile contents in memory at once, plus one tile.
  static constexpr size_t kBatchBytesMax = size_t{64} << 20;
  // Called before tiles are read, with the number read of this frame and their total. Its error
  // ends the writing.
  using BeforeTiles = std::function<Status(size_t done, size_t total)>;

  // `common`: placement, channels and meta of all frames. Errors: those of OutputFile and
  // SequenceWriter::open().
  static Result<std::unique_ptr<NativeSequence>> create(const Grid& common, double fps, Codec codec,
                                                        const std::filesystem::path& path);
  // Removes the file unless it was finished.
  ~NativeSequence();
  NativeSequence(const NativeSequence&) = delete;
  NativeSequence& operator=(const NativeSequence&) = delete;

  // Adds a frame. After an error no frame can follow. Errors: those of SequenceWriter;
  // storage-full.
  Status add(double time_s, std::span<const SparseTile> tiles);
  // Adds the grid of a native container, a batch of tiles at a time. Its streams are copied if the
  // codecs agree; otherwise they are decoded. Errors: those of the container, prefixed with the
  // frame's number from 0: "frame 7: grid container, byte 96: ...".
  Status add_container(double time_s, const std::filesystem::path& container,
                       const BeforeTiles& before_tiles = {});
  Status finish();

 private:
  NativeSequence(SequenceWriter writer, OutputFile file, GridHeader header,
                 std::filesystem::path path);
  Status add_tiles_of(const std::filesystem::path& container, const BeforeTiles& before_tiles);
  Status add_batch(std::span<const uint8_t> bytes, const GridReader& reader, size_t begin,
                   size_t end);

  SequenceWriter writer_;
  OutputFile file_;
  const GridHeader header_;  // of every frame; its meta is the sequence's
  const std::filesystem::path path_;
  size_t frames_ = 0;
  bool is_finished_ = false;
};

}  // namespace voxeld
