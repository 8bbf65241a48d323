// Dense samples of any type and order as sparse tiles. A cell is occupied if its sample is at least
// a threshold, or if its colour is one.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string_view>
#include <utility>
#include <vector>

#include "proto/codec/sparse_tile.h"
#include "proto/result.h"
#include "server/volumes/dense_cells.h"

namespace voxeld::volumes {

enum class SampleType {
  kBool,  // a byte; 1 for any but 0
  kInt8,
  kUint8,
  kInt16,
  kUint16,
  kInt32,
  kUint32,
  kInt64,
  kUint64,
  kFloat16,
  kFloat32,
  kFloat64
};

size_t sample_bytes(SampleType type);

// An array of samples without gaps.
struct SampleArray {
  CellOrder order;
  std::array<bool, 3> is_mirrored{};  // the last cell of the axis comes first; fastest axis first
  SampleType type = SampleType::kUint8;
  bool is_big_endian = false;
  // 1; or colours of 3 or 4 samples, uint8 in sRGB or float32 in linear light, alpha linear. A
  // colour is occupied if alpha or, without alpha, any component is not 0; of floats, above 0.
  size_t components = 1;
  bool is_planar = false;  // components lie in arrays after each other, else beside each other
  double threshold = 0;    // the least sample of a voxel; NaN is none

  bool has_color() const { return components > 1; }
  uint64_t cell_count() const;
  uint64_t bytes() const;
};

// The occupied cells of a row.
struct RowCells {
  std::vector<std::pair<uint32_t, uint64_t>> words;  // number in the row, bits that are not 0
  std::vector<CellColor> colors;                     // of all bits
};

// A row of an array: where the samples of its first cell lie, and the bytes to the next ones.
struct SampleRow {
  const uint8_t* first = nullptr;
  ptrdiff_t cell_step = 0, component_step = 0;
  size_t cells = 0;
  size_t components = 1;
  double threshold = 0;
};
// Replaces `cells` by the occupied cells of a row.
using ScanRow = void (*)(const SampleRow& row, RowCells& cells);
ScanRow row_scanner(const SampleArray& array);

// The tiles of samples in memory; `samples` has array.bytes(). Errors: grid-too-large for more than
// limits::kSparseVoxelsMax voxels.
Result<std::vector<SparseTile>> tiles_of_samples(const SampleArray& array, std::string_view name,
                                                 std::span<const uint8_t> samples);

// The same of samples that come piece by piece, and are not planar.
class SampleStream {
 public:
  SampleStream(const SampleArray& array, std::string_view name);

  // Takes the next bytes; in all at most array.bytes(). Errors: as finish().
  Status add(std::span<const uint8_t> bytes);
  // Needs all bytes. Errors: as tiles_of_samples().
  Result<std::vector<SparseTile>> finish();

 private:
  // Occupied words of a block of rows that are still to become bricks.
  struct Word {
    uint32_t plane, row, word;
    uint32_t bits_low, bits_high;
  };
  struct Recorded {
    size_t block = 0;
    std::vector<Word> words;
    std::vector<CellColor> colors;
  };

  Status add_row(const uint8_t* row);
  // Ends the block of planes that rows were added to.
  void end_slab();
  void store();

  SampleArray array_;
  std::string_view name_;
  ScanRow scan_;
  DenseCells cells_;
  size_t row_bytes_;
  std::vector<uint8_t> partial_row_;
  uint32_t next_plane_ = 0, next_row_ = 0;  // in the order of the file
  std::optional<uint32_t> slab_;
  RowCells row_cells_;
  std::vector<Recorded> slab_blocks_, ended_blocks_;
  uint64_t waiting_voxels_ = 0;
};

}  // namespace voxeld::volumes
