// Writes the sequence container (proto/container/sequence_format.h) frame by frame. In memory are
// the index and the streams that the next frame's may be differences to.
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

#include "proto/container/grid_format.h"
#include "proto/container/grid_streams.h"
#include "proto/container/sequence_format.h"
#include "proto/container/sequence_layout.h"
#include "proto/result.h"

namespace voxeld {

// Options of writing; readers handle all of them alike.
struct SequenceWriterOptions {
  // Streams that a reader decodes for one, 1..kStreamChainMax; 1: no differences.
  uint32_t chain_max = kStreamChainMax;
  // Bytes of the last frame's contents in memory; further tiles are written whole.
  size_t kept_bytes_max = size_t{1} << 30;
};

class SequenceWriter {
 public:
  // `header`: that of every frame's grid, with the sequence's meta; fps as in the container.
  // Errors: internal for a header that no container can have.
  static Result<SequenceWriter> open(GridHeader header, double fps,
                                     const SequenceWriterOptions& options = {});

  // The beginning of the file. Its first kSequenceHeaderBytes are replaced at the end.
  std::vector<uint8_t> front() const;
  // Encodes the next frame on all cores and returns the bytes that follow in the file. Tiles must
  // ascend in Morton order of coord. Errors: internal for tiles that no grid container can have,
  // times that go back, and more than limits::kFramesMax frames.
  Result<std::vector<uint8_t>> add(double time_s, std::span<const SparseTile> tiles);

  // Adds a frame in parts, so it need not be in memory at once. Tiles ascend over all parts, and
  // end_frame() comes last. After an error of a part the writer is unusable.
  Status begin_frame(double time_s);
  Result<std::vector<uint8_t>> add_tiles(std::span<const SparseTile> tiles);
  // Copies the streams of a container. Its codecs must be those of this header, all fast. The file
  // equals that of add_tiles() for the decoded tiles. Each stream is decompressed for its checksum,
  // its length, and as the base of differences. Only decoding would check that nodes and voxels are
  // inside the grid. Errors: bad-request for streams that are broken or disagree with their tile;
  // internal as add_tiles(), and for a codec that is not fast.
  Result<std::vector<uint8_t>> add_stored(std::span<const StoredTile> tiles);
  void end_frame();
  struct End {
    std::vector<uint8_t> header;  // the last bytes of the file
    std::vector<uint8_t> index;   // the last that follows
  };
  // Errors: internal if there is no frame.
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
    uint32_t bytes, base, chain, root;  // root: the first stream of the chain
  };
  // A place whose differences failed, so none is tried in the next frames.
  struct Tries {
    uint32_t rest = 0, left = 0;  // frames: after the last try, and from now on
  };
  // The stream of a place (tile and kind) in the last frame.
  struct Kept {
    uint32_t number = sequence_layout::kNoStream;
    Contents contents;
    Contents root;  // of the chain's first stream; null if no longer in memory
    Tries tries;
  };
  using Place = std::pair<uint32_t, size_t>;  // tile_order() and kind
  struct Source;                              // one stream of the current part

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
  std::map<Place, Kept> kept_;       // of the last frame, without places that this frame has
                                     // reached
  std::map<Place, Kept> next_kept_;  // of this frame
  size_t next_kept_bytes_ = 0;
  Frame frame_{};    // the current one
  uint64_t offset_;  // of the next stream
};

}  // namespace voxeld
