// Writes the sequence container (proto/sequence_format.h) frame by frame: the index is in memory,
// and what the next frame's streams may be differences to.
#pragma once

#include <array>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <unordered_map>
#include <utility>
#include <vector>

#include "proto/grid_format.h"
#include "proto/grid_streams.h"
#include "proto/result.h"
#include "proto/sequence_format.h"
#include "proto/sequence_layout.h"

namespace voxeld {

// How a container is written; read, all are the same.
struct SequenceWriterOptions {
  // Streams that a reader needs for one, 1..kStreamChainMax; 1: no differences.
  uint32_t chain_max = kStreamChainMax;
  // Contents of the last frame that are remembered; tiles beyond are written whole.
  size_t kept_bytes_max = size_t{1} << 30;
};

class SequenceWriter {
 public:
  // `header`: as of every frame's grid, with the sequence's meta; fps as in the container. Errors:
  // internal, for a header that no container can have.
  static Result<SequenceWriter> open(GridHeader header, double fps,
                                     const SequenceWriterOptions& options = {});

  // What the file begins with; the first kSequenceHeaderBytes of it are replaced at the end.
  std::vector<uint8_t> front() const;
  // Encodes the next frame, on all cores, and returns what follows in the file. Tiles ascend in
  // Morton order of coord. Errors: internal, for tiles that no grid container can have, times that
  // go back, and more than limits::kFramesMax frames.
  Result<std::vector<uint8_t>> add(double time_s, std::span<const SparseTile> tiles);

  // The same in parts, for frames that need not be in memory at once: tiles ascend over all parts,
  // and end_frame() comes last. After an error of a part the writer is of no use.
  Status begin_frame(double time_s);
  Result<std::vector<uint8_t>> add_tiles(std::span<const SparseTile> tiles);
  // Takes over the streams of a container, whose codecs are those of this header: all fast. The
  // file is that of add_tiles() for the decoded tiles. Each stream is decompressed, for its
  // checksum, its length, and as what differences are told of; that nodes and voxels are where the
  // grid may have them is what only decoding finds out. Errors: bad-request, for streams that are
  // broken or disagree with their tile; internal, as add_tiles() and for a codec that is not fast.
  Result<std::vector<uint8_t>> add_stored(std::span<const StoredTile> tiles);
  void end_frame();
  struct End {
    std::vector<uint8_t> header;  // at the beginning of the file
    std::vector<uint8_t> index;   // the last that follows
  };
  // Errors: internal, when there is no frame.
  Result<End> finish() const;

 private:
  using Contents = std::shared_ptr<const std::vector<uint8_t>>;
  struct Frame {
    double time_s;
    uint64_t voxel_count;
    uint32_t first_tile, tile_count;
  };
  struct Tile {
    std::array<int32_t, 3> coord{};
    uint32_t brick_count = 0;
    uint64_t voxel_count = 0;
    std::array<uint32_t, sequence_layout::kStreamKinds> streams{};
  };
  struct Stream {
    uint64_t offset;
    uint32_t bytes, base, chain, root;  // root: where the chain begins
  };
  // A place whose differences do not win: they are not tried in the next frames.
  struct Tries {
    uint32_t rest = 0, left = 0;  // frames, after the last try and from now on
  };
  // What a place (tile and kind) had in the last frame.
  struct Kept {
    uint32_t number = sequence_layout::kNoStream;
    Contents contents;
    Contents root;  // of the stream's chain; null where it is not known any more
    Tries tries;
  };
  using Place = std::pair<uint32_t, size_t>;  // tile_order() and kind
  struct Source;                              // one stream of the part at work

  SequenceWriter(GridHeader header, double fps, const SequenceWriterOptions& options);
  Codec codec(size_t kind) const;
  bool has_stream(size_t kind, uint32_t brick_count) const;
  Status check_order(std::span<const std::array<int32_t, 3>> coords) const;
  Status prepare(const SparseTile& tile, Tile& entry, Source* sources) const;
  Status prepare(const StoredTile& tile, Tile& entry, Source* sources) const;
  template <typename AnyTile>
  Result<std::vector<uint8_t>> add_part(std::span<const AnyTile> tiles);
  void find_known(std::vector<Source>& sources);
  void find_base(Source& source) const;
  Status encode(Source& source, bool as_difference) const;
  Status encode_all(std::vector<Source>& sources) const;
  void store(Source& source, std::vector<uint8_t>& out);
  void keep(Source& source);
  std::vector<uint8_t> header(uint64_t index, uint64_t bytes) const;
  void put_tile(std::vector<uint8_t>& out, size_t at, const Tile& tile) const;

  GridHeader header_;
  double fps_;
  SequenceWriterOptions options_;
  std::vector<Frame> frames_;
  std::vector<Tile> tiles_;
  std::vector<Stream> streams_;
  std::unordered_map<std::string, uint32_t> number_of_;  // kind and hash of contents -> stream
  std::unordered_map<std::string, Frame> frame_of_;      // hash of its tiles' entries -> frame
  std::map<Place, Kept> kept_;       // of the last frame, but places that this one has had
  std::map<Place, Kept> next_kept_;  // of this frame
  size_t next_kept_bytes_ = 0;
  Frame frame_{};    // the one at work
  uint64_t offset_;  // of what comes next
};

}  // namespace voxeld
