#include "server/formats/npy/sparse_array.h"

#include <algorithm>
#include <array>
#include <cstring>
#include <string>
#include <utility>

#include "proto/codec/tile_runs.h"
#include "proto/limits.h"
#include "server/base/cancel_point.h"
#include "server/formats/npy/npy_array.h"
#include "server/formats/npy/sample_writers.h"

namespace voxeld {
namespace {

constexpr size_t kAxes = 3;
constexpr std::string_view kCoordDescr = "<i4";

// The cells of a word of a mask: 4x4x4 voxels in Morton order.
constexpr auto kWordCells = [] {
  std::array<std::array<int32_t, kAxes>, 64> cells{};
  for (uint32_t i = 0; i < cells.size(); ++i) {
    const auto at = morton_decode(i);
    for (size_t c = 0; c < kAxes; ++c) cells[i][c] = static_cast<int32_t>(at[c]);
  }
  return cells;
}();

template <bool has_frame>
void fill_coords(const VoxelPieces& voxels, size_t piece, int32_t frame, uint8_t* out) {
  constexpr size_t kColumns = kAxes + (has_frame ? 1 : 0);
  std::array<int32_t, kColumns> row{};
  if constexpr (has_frame) row[0] = frame;
  voxels.for_each_brick(
      piece, [&](const SparseTile& tile, uint32_t morton, const BrickMask& mask, size_t) {
        const std::array<int32_t, kAxes> brick = brick_cell(tile, morton);
        for (uint32_t w = 0; w < mask.words.size(); ++w) {
          const auto word = morton_decode(w);
          std::array<int32_t, kAxes> base{};
          for (size_t c = 0; c < kAxes; ++c) base[c] = brick[c] + static_cast<int32_t>(4 * word[c]);
          for (uint64_t bits = mask.words[w]; bits != 0; bits &= bits - 1) {
            const auto& cell = kWordCells[static_cast<size_t>(std::countr_zero(bits))];
            for (size_t c = 0; c < kAxes; ++c) row[kColumns - kAxes + c] = base[c] + cell[c];
            std::memcpy(out, row.data(), sizeof row);
            out += sizeof row;
          }
        }
      });
}

template <typename Writer>
void fill_rows(const Writer& writer, const VoxelPieces& voxels, size_t piece,
               std::span<uint8_t> bytes) {
  writer.background(bytes);
  uint8_t* out = bytes.data();
  voxels.for_each_brick(
      piece, [&](const SparseTile& tile, uint32_t, const BrickMask& mask, size_t attribute) {
        size_t count = 0;
        for (const uint64_t word : mask.words) count += static_cast<size_t>(std::popcount(word));
        if (attribute == kNoAttributes) {
          writer.run(out, count);
        } else {
          for (size_t i = 0; i < count; ++i) {
            writer.cell(out + i * Writer::kCellBytes, tile, attribute + i, 0);
          }
        }
        out += count * Writer::kCellBytes;
      });
}

// In layout sparse all components of a voxel are one row, whatever the order of axes.
std::vector<uint8_t> header_of(std::string_view descr, uint64_t voxels, size_t columns) {
  std::vector<int64_t> shape = {static_cast<int64_t>(voxels)};
  if (columns > 1) shape.push_back(static_cast<int64_t>(columns));
  return npy_header(descr, false, shape);
}

}  // namespace

const BrickMask VoxelPieces::kFullMask = [] {
  BrickMask mask;
  mask.words.fill(~uint64_t{0});
  return mask;
}();

VoxelPieces::VoxelPieces(const Grid& grid) : grid_(&grid) {
  Piece piece;
  uint64_t voxels = 0;
  Place next;
  uint32_t tile = 0;
  const auto count = [&](const SparseTile&, uint32_t, const BrickMask& mask, size_t) {
    for (const uint64_t word : mask.words) voxels += static_cast<uint64_t>(std::popcount(word));
  };
  while (step(next, count)) {
    if (next.tile != tile) cancel_point();
    tile = next.tile;
    ++piece.bricks;
    if (voxels - piece.voxels < kPieceVoxels) continue;
    pieces_.push_back(piece);
    piece = {next, 0, voxels};
  }
  if (piece.bricks > 0) pieces_.push_back(piece);
  pieces_.push_back({next, 0, voxels});
}

SparseArray SparseArray::coords(const VoxelPieces& voxels, std::optional<int32_t> frame) {
  const size_t row_bytes = sizeof(int32_t) * (kAxes + (frame ? 1 : 0));
  const VoxelPieces* const pieces = &voxels;
  return {voxels, row_bytes, Repeats::rows(row_bytes),
          [pieces, frame](size_t piece, std::span<uint8_t> bytes) {
            frame ? fill_coords<true>(*pieces, piece, *frame, bytes.data())
                  : fill_coords<false>(*pieces, piece, 0, bytes.data());
          }};
}

SparseArray::SparseArray(const VoxelPieces& voxels, Channel channel, const OutputOptions& options)
    : voxels_(&voxels), row_bytes_(0), repeats_(Repeats::anywhere()) {
  const VoxelPieces* const pieces = &voxels;
  with_sample_writer(voxels.grid(), channel, options, /*is_planar=*/false, [&](auto writer) {
    row_bytes_ = decltype(writer)::kCellBytes;
    fill_ = [pieces, writer](size_t piece, std::span<uint8_t> bytes) {
      fill_rows(writer, *pieces, piece, bytes);
    };
  });
  if (row_bytes_ == 1) repeats_ = Repeats::runs();
}

std::vector<uint8_t> coords_header(uint64_t voxels, bool has_frame) {
  return header_of(kCoordDescr, voxels, kAxes + (has_frame ? 1 : 0));
}

std::vector<uint8_t> rows_header(uint64_t voxels, Channel channel, const OutputOptions& options) {
  const NpyType type = npy_type(channel, options);
  return header_of(type.descr, voxels, type.components);
}

Status check_sparse(uint64_t voxels, Format format) {
  if (voxels <= limits::kSparseVoxelsMax) return {};
  return Error{ErrorCode::kGridTooLarge,
               std::string(format_name(format)) + ": too many voxels for sparse arrays",
               "at most " + std::to_string(limits::kSparseVoxelsMax) + " voxels",
               std::to_string(voxels)};
}

}  // namespace voxeld
