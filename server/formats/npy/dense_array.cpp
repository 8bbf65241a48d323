#include "server/formats/npy/dense_array.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cstring>

#include "proto/thread_pool.h"
#include "server/base/pieces.h"
#include "server/formats/npy/extend_sign.h"
#include "server/formats/npy/npy_array.h"
#include "server/formats/npy/sample_writers.h"

namespace voxeld {
namespace {

constexpr size_t kSide = limits::kBrickSide;
constexpr size_t kBandPieces = 64;  // filled between two cancellation points

// Bits of the Morton index within 4x4x4 voxels: x is bits 0 and 3, y 1 and 4, z 2 and 5.
constexpr std::array<uint64_t, 4> kPlanes = [] {
  std::array<uint64_t, 4> planes{};
  for (unsigned i = 0; i < 64; ++i) planes[(i >> 2 & 1) | (i >> 4 & 2)] |= uint64_t{1} << i;
  return planes;
}();
constexpr std::array<std::array<uint8_t, 2>, 64> kCells = [] {
  std::array<std::array<uint8_t, 2>, 64> cells{};
  for (unsigned i = 0; i < 64; ++i) {
    cells[i] = {static_cast<uint8_t>((i & 1) | (i >> 2 & 2)),
                static_cast<uint8_t>((i >> 1 & 1) | (i >> 3 & 2))};
  }
  return cells;
}();

}  // namespace

DenseArray::DenseArray(const Grid& grid, std::optional<Channel> channel,
                       const OutputOptions& options)
    : grid_(grid),
      nx_(static_cast<size_t>(grid.spec.dims.x)),
      ny_(static_cast<size_t>(grid.spec.dims.y)),
      nz_(static_cast<size_t>(grid.spec.dims.z)),
      rows_(grid, 2, 1) {
  const NpyType type = npy_type(channel, options);
  const bool fortran = options.axes == AxisOrder::kXyz;
  const bool is_planar = fortran && type.components > 1;
  header_ = npy_header(type.descr, fortran, npy_shape(grid.spec, type, options));
  components_ = is_planar ? type.components : 1;
  cell_bytes_ = type.sample_bytes * (is_planar ? 1 : type.components);
  bytes_ = uint64_t{components_} * nx_ * ny_ * nz_ * cell_bytes_;
  segments_ = components_ * nz_ * rows_.rows_in_plane();
  piece_segments_ = std::max<size_t>(1, kPieceBytes / (kSide * nx_ * cell_bytes_));
  piece_count_ = (segments_ + piece_segments_ - 1) / piece_segments_;

  with_sample_writer(grid, channel, options, is_planar, [&](auto writer) {
    fill_ = [this, writer](size_t piece, std::span<uint8_t> bytes) {
      fill_with(writer, piece, bytes);
    };
    if constexpr (requires { writer.inside; }) {
      if (grid.meta.tells_sides()) make_band(-writer.inside);
    }
  });
}

DenseArray::Segment DenseArray::segment(size_t number) const {
  const size_t plane = number / rows_.rows_in_plane();
  return {plane / nz_, plane % nz_, number % rows_.rows_in_plane()};
}

// Bytes before it.
size_t DenseArray::segment_begin(size_t number) const {
  const auto [component, z, brick_y] = segment(number);
  return ((component * nz_ + z) * ny_ + brick_y * kSide) * nx_ * cell_bytes_;
}

uint64_t DenseArray::piece_begin(size_t piece) const {
  return piece == piece_count_ ? bytes_ : segment_begin(piece * piece_segments_);
}

void DenseArray::fill(size_t piece, std::span<uint8_t> bytes) const {
  if (band_.empty()) return fill_(piece, bytes);
  std::memcpy(bytes.data(), reinterpret_cast<const uint8_t*>(band_.data()) + piece_begin(piece),
              bytes.size());
}

template <typename Writer>
void DenseArray::fill_with(const Writer& writer, size_t piece, std::span<uint8_t> bytes) const {
  writer.background(bytes);
  const size_t first = piece * piece_segments_;
  const size_t end = std::min(first + piece_segments_, segments_);
  for (size_t number = first; number < end; ++number) {
    const size_t offset = segment_begin(number) - segment_begin(first);
    fill_segment(writer, segment(number), bytes.data() + offset);
  }
}

template <typename Writer>
void DenseArray::fill_segment(const Writer& writer, const Segment& segment, uint8_t* out) const {
  constexpr size_t kCellBytes = Writer::kCellBytes;
  const size_t row = segment.z / kSide * rows_.rows_in_plane() + segment.brick_y;
  const size_t row_bytes = nx_ * kCellBytes;
  for (const BrickRows::FullRow& full : rows_.full(row)) {
    for (size_t y = 0; y < kSide; ++y) {
      writer.run(out + y * row_bytes + static_cast<size_t>(full.x) * kCellBytes,
                 static_cast<size_t>(full.length));
    }
  }
  const size_t z = segment.z % kSide;
  const size_t half = z / 4 * 4;  // words 4 to 7 are the upper half
  const uint64_t plane = kPlanes[z % 4];
  for (const BrickRows::Brick& brick : rows_.bricks(row)) {
    const SparseTile& tile = grid_.tiles[brick.tile];
    const auto& words = tile.masks[brick.index].words;
    size_t voxel = brick.voxel;
    for (size_t w = 0; w < half; ++w) voxel += static_cast<size_t>(std::popcount(words[w]));
    uint8_t* const cells = out + static_cast<size_t>(brick.x) * kCellBytes;
    for (size_t w = half; w < half + 4; ++w) {
      const size_t x0 = (w & 1) * 4, y0 = (w >> 1 & 1) * 4;
      for (uint64_t bits = words[w] & plane; bits != 0; bits &= bits - 1) {
        const uint64_t below = (bits & -bits) - 1;
        const auto [x, y] = kCells[static_cast<size_t>(std::countr_zero(bits))];
        writer.cell(cells + (y0 + y) * row_bytes + (x0 + x) * kCellBytes, tile,
                    voxel + static_cast<size_t>(std::popcount(words[w] & below)),
                    segment.component);
      }
      voxel += static_cast<size_t>(std::popcount(words[w]));
    }
  }
}

void DenseArray::make_band(float far) {
  std::vector<float> band;
  resize_in_pieces(band, bytes_ / sizeof(float));
  auto* const bytes = reinterpret_cast<uint8_t*>(band.data());
  for (size_t begin = 0; begin < piece_count_; begin += kBandPieces) {
    cancel_point();
    ThreadPool::shared().for_each(std::min(kBandPieces, piece_count_ - begin), [&](size_t i) {
      fill_(begin + i, {bytes + piece_begin(begin + i), piece_bytes(begin + i)});
    });
  }
  extend_sign(band, {nz_, ny_, nx_}, far);
  band_ = std::move(band);
}

}  // namespace voxeld
