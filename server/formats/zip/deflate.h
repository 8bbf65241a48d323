// Deflate (RFC 1951) for arrays that are mostly zeros.
//
// Voxels of a surface are one cell in a hundred of a dense array. Deflate spends a token on each
// 258 bytes of a run, so the floor is reading the bytes once; zlib and libdeflate hash positions
// within runs as well, and take 10 to 20 times as long for a file that is no smaller.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxeld {

// The repetitions that a Deflater looks for.
struct Repeats {
  enum Kind { kRuns, kRows, kAnywhere };
  Kind kind;
  size_t row_bytes = 0;  // of kRows: at most 32768

  // The same byte again, for cells of one byte: any other reference is longer than what it stands
  // for.
  static constexpr Repeats runs() { return {kRuns}; }
  // The bytes of the row above, for tables whose columns change slowly.
  static constexpr Repeats rows(size_t row_bytes) { return {kRows, row_bytes}; }
  static constexpr Repeats anywhere() { return {kAnywhere}; }
};

class Deflater {
 public:
  static constexpr size_t kBlockBytesMax = size_t{1} << 24;
  static constexpr size_t kRepeatBytesMax = 258;  // of one repetition

  // Encodes one block, at most kBlockBytesMax bytes, and ends it at a byte: encoded blocks, one
  // after the other, are one stream once stream_end() follows. Blocks refer to nothing before them.
  // Returns bytes that are valid until the next call.
  std::span<const uint8_t> block(std::span<const uint8_t> bytes, const Repeats& repeats);

  // The last, empty block of a stream.
  static std::span<const uint8_t> stream_end();

 private:
  static constexpr size_t kLiteralCodes = 286, kDistanceCodes = 30;
  static constexpr int kHashBits = 14;

  // `length` bytes again, from the block's only distance back, then a byte or kNone.
  struct Step {
    uint16_t length;
    uint16_t literal;
  };
  // `length` bytes again from `distance` back; distance 0: the byte `length`.
  struct Token {
    uint16_t length;
    uint16_t distance;
  };

  void begin_steps(size_t bytes);
  void add_step(size_t length, size_t literal);
  size_t add_long_repeat(size_t length);
  void finish_steps(size_t repeated, size_t distance);
  void find_runs(std::span<const uint8_t> bytes);
  void find_rows(std::span<const uint8_t> bytes, size_t row_bytes);
  void add_literal(uint8_t byte);
  void add_repeat(size_t length, size_t distance);
  void find_anywhere(std::span<const uint8_t> bytes);
  void write(size_t only_distance);

  // Blocks whose repetitions have one distance:
  std::vector<Step> steps_;
  size_t step_count_ = 0;
  std::array<uint32_t, kRepeatBytesMax + 1> step_lengths_{};
  // Other blocks:
  std::vector<Token> tokens_;
  std::array<uint32_t, kLiteralCodes> literal_counts_{};
  std::array<uint32_t, kDistanceCodes> distance_counts_{};
  std::array<uint32_t, size_t{1} << kHashBits> last_{};  // position + 1 of four bytes, by hash
  std::vector<uint8_t> out_;
};

}  // namespace voxeld
