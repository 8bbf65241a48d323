// Writes Qubicle's .qb, version 1.1.0.0. Numbers are u32 little-endian.
//
//   01 01 00 00          version
//   0 0 1 0 M            RGBA; orientation 0; run lengths; no visibility of faces; M matrices
//   each matrix:
//     u8, text           name
//     u32[3], i32[3]     size, and place of its min corner
//     each plane of z    colours, x fastest, then y; runs of more than 3 equal ones as 2, count,
//                        colour; ended by 6
//
// A colour is R, G, B, A in this order of bytes: A is 255 for a voxel, and 0 for an empty cell, all
// of whose bytes are 0. Readers (goxel, vengi) take the axes of orientation 0 as x, y up, z, and
// mirror those of orientation 1; a test compares with goxel. A grid of at most 256 cells to a side
// is one matrix; a larger one has one for each tile with voxels. Grids without colours have one for
// each id, as a .vox has.
#include <algorithm>
#include <array>
#include <bit>
#include <string>
#include <vector>

#include "proto/codec/tile_runs.h"
#include "proto/limits.h"
#include "proto/thread_pool.h"
#include "server/base/cancel_point.h"
#include "server/formats/formats.h"
#include "server/formats/mesh/voxel_colors.h"
#include "server/formats/output_file.h"

namespace voxeld::qubicle {
namespace {

constexpr int32_t kMatrixSide = limits::kTileSide;
constexpr uint32_t kRunCode = 2, kPlaneEnd = 6;
constexpr size_t kPlainMax = 3;  // equal colours that are no longer than a run
constexpr size_t kBrick = limits::kBrickSide;
constexpr uint32_t kOpaque = uint32_t{0xff} << 24;

void append_u32(std::vector<uint8_t>& out, uint32_t value) {
  for (unsigned i = 0; i < 4; ++i) out.push_back(static_cast<uint8_t>(value >> (8 * i)));
}

void append_runs(std::vector<uint8_t>& out, std::span<const uint32_t> colors) {
  for (size_t begin = 0; begin < colors.size();) {
    const uint32_t color = colors[begin];
    size_t end = begin + 1;
    while (end < colors.size() && colors[end] == color) ++end;
    const size_t count = end - begin;
    if (count > kPlainMax) {
      append_u32(out, kRunCode);
      append_u32(out, static_cast<uint32_t>(count));
      append_u32(out, color);
    } else {
      for (size_t i = 0; i < count; ++i) append_u32(out, color);
    }
    begin = end;
  }
}

// The part of the grid in a tile. tile: null if it has no voxels.
struct QbMatrix {
  const SparseTile* tile;
  std::array<int32_t, 3> begin, size;  // cells of the grid
};

std::vector<QbMatrix> matrices_of(const Grid& grid) {
  const std::array<int32_t, 3> dims = {grid.spec.dims.x, grid.spec.dims.y, grid.spec.dims.z};
  const auto matrix = [&](const SparseTile* tile, const std::array<int32_t, 3>& coord) {
    QbMatrix made{tile, {}, {}};
    for (size_t c = 0; c < 3; ++c) {
      made.begin[c] = coord[c] * kMatrixSide;
      made.size[c] = std::min(kMatrixSide, dims[c] - made.begin[c]);
    }
    return made;
  };
  std::vector<QbMatrix> matrices;
  for (const SparseTile& tile : grid.tiles) matrices.push_back(matrix(&tile, tile.coord));
  if (matrices.empty()) matrices.push_back(matrix(nullptr, {0, 0, 0}));
  return matrices;
}

// The bricks of a tile by the layer of 8 planes that they are in.
class QbLayers {
 public:
  QbLayers(const QbMatrix& matrix, const mesh::VoxelColors& colors)
      : matrix_(matrix),
        colors_(colors),
        layers_((static_cast<size_t>(matrix.size[2]) + kBrick - 1) / kBrick) {
    if (matrix.tile == nullptr) return;
    for_each_brick(*matrix.tile, [&](uint32_t morton, const BrickMask& mask, size_t first) {
      const auto [x, y, z] = morton_decode(morton);
      const bool is_full = first == kNoAttributes;
      layers_[z].push_back({x * kBrick, y * kBrick, is_full ? nullptr : &mask, first});
    });
  }

  // Appends the planes of all layers.
  void append_to(std::vector<uint8_t>& out) const {
    const auto width = static_cast<size_t>(matrix_.size[0]);
    const size_t plane_cells = width * static_cast<size_t>(matrix_.size[1]);
    std::vector<uint32_t> cells(kBrick * plane_cells);
    for (size_t layer = 0; layer < layers_.size(); ++layer) {
      cancel_point();
      std::ranges::fill(cells, 0U);
      for (const LayerBrick& brick : layers_[layer]) fill(cells, width, plane_cells, brick);
      const size_t planes = std::min(kBrick, static_cast<size_t>(matrix_.size[2]) - layer * kBrick);
      for (size_t plane = 0; plane < planes; ++plane) {
        append_runs(out, std::span(cells).subspan(plane * plane_cells, plane_cells));
        append_u32(out, kPlaneEnd);
      }
    }
  }

 private:
  struct LayerBrick {
    size_t x, y;            // its first cell in the matrix
    const BrickMask* mask;  // null: full, without attributes
    size_t voxel;           // the first with attributes
  };

  void fill(std::vector<uint32_t>& cells, size_t width, size_t plane_cells,
            const LayerBrick& brick) const {
    size_t voxel = brick.voxel;
    for (uint32_t w = 0; w < BrickMask{}.words.size(); ++w) {
      const uint64_t word = brick.mask != nullptr ? brick.mask->words[w] : ~uint64_t{0};
      for (uint64_t bits = word; bits != 0; bits &= bits - 1) {
        const auto at = morton_decode(64 * w + static_cast<uint32_t>(std::countr_zero(bits)));
        const uint32_t color = colors_.of(*matrix_.tile, voxel) | kOpaque;
        cells[at[2] * plane_cells + (brick.y + at[1]) * width + brick.x + at[0]] = color;
        if (brick.mask != nullptr) ++voxel;
      }
    }
  }

  const QbMatrix& matrix_;
  const mesh::VoxelColors& colors_;
  std::vector<std::vector<LayerBrick>> layers_;
};

std::vector<uint8_t> encode_matrix(const QbMatrix& matrix, const mesh::VoxelColors& colors) {
  std::string name = "voxeld";
  for (const int32_t cell : matrix.begin) name += " " + std::to_string(cell);
  std::vector<uint8_t> out;
  out.push_back(static_cast<uint8_t>(name.size()));
  for (const char c : name) out.push_back(static_cast<uint8_t>(c));
  for (const int32_t side : matrix.size) append_u32(out, static_cast<uint32_t>(side));
  for (const int32_t cell : matrix.begin) append_u32(out, static_cast<uint32_t>(cell));
  QbLayers(matrix, colors).append_to(out);
  return out;
}

}  // namespace
}  // namespace voxeld::qubicle

namespace voxeld {

Status encode_qb(const Grid& grid, const OutputOptions& /*options*/, OutputFile& file) {
  using namespace qubicle;
  const mesh::VoxelColors colors(grid);
  const std::vector<QbMatrix> matrices = matrices_of(grid);
  std::vector<uint8_t> header = {1, 1, 0, 0};
  for (const uint32_t number : {0U, 0U, 1U, 0U, static_cast<uint32_t>(matrices.size())}) {
    append_u32(header, number);
  }
  VOXELD_TRY(file.append(header));
  const size_t batch = ThreadPool::shared().threads();
  for (size_t begin = 0; begin < matrices.size(); begin += batch) {
    std::vector<std::vector<uint8_t>> encoded(std::min(batch, matrices.size() - begin));
    ThreadPool::shared().for_each(encoded.size(), [&](size_t i) {
      cancel_point();  // on the calling thread
      encoded[i] = encode_matrix(matrices[begin + i], colors);
    });
    for (const std::vector<uint8_t>& bytes : encoded) VOXELD_TRY(file.append(bytes));
  }
  return {};
}

}  // namespace voxeld
