// The native container of a sequence as a file that grows frame by frame.
#pragma once

#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <functional>
#include <memory>
#include <span>

#include "proto/grid_format.h"
#include "proto/options.h"
#include "proto/result.h"
#include "server/formats/sequence_file.h"
#include "server/formats/sequence_writer.h"
#include "server/grid/grid.h"

namespace voxeld {

class NativeSequence {
 public:
  // Contents of the tiles of a container that are in memory at once, and one tile more.
  static constexpr size_t kBatchBytesMax = size_t{64} << 20;
  // Before tiles are read: how many of the frame's have been, and how many there are. Its error
  // ends the writing.
  using BeforeTiles = std::function<Status(size_t done, size_t total)>;

  // `common`: place, channels and meta of all frames. Errors: those of SequenceFile and
  // SequenceWriter::open().
  static Result<std::unique_ptr<NativeSequence>> create(const Grid& common, double fps, Codec codec,
                                                        const std::filesystem::path& path);
  // Removes the file, but not one that was finished.
  ~NativeSequence();
  NativeSequence(const NativeSequence&) = delete;
  NativeSequence& operator=(const NativeSequence&) = delete;

  // After an error of these no frame can follow. Errors: those of SequenceWriter; storage-full.
  Status add(double time_s, std::span<const SparseTile> tiles);
  // The grid that a native container holds, a batch of tiles at a time. Its streams are taken over
  // where the sequence's codec is theirs, else they are decoded. Errors: those of the container, in
  // words that begin with the frame's number, from 0: "frame 7: grid container, byte 96: ...".
  Status add_container(double time_s, const std::filesystem::path& container,
                       const BeforeTiles& before_tiles = {});
  Status finish();

 private:
  NativeSequence(SequenceWriter writer, SequenceFile file, GridHeader header,
                 std::filesystem::path path);
  Status add_tiles_of(const std::filesystem::path& container, const BeforeTiles& before_tiles);
  Status add_batch(std::span<const uint8_t> bytes, const GridReader& reader, size_t begin,
                   size_t end);

  SequenceWriter writer_;
  SequenceFile file_;
  const GridHeader header_;  // of every frame; its meta is the sequence's
  const std::filesystem::path path_;
  size_t frames_ = 0;
  bool is_finished_ = false;
};

}  // namespace voxeld
