// The rows of a mesh's vertices and faces as bytes, made in pieces.
#pragma once

#include <algorithm>
#include <cstddef>
#include <cstdint>
#include <functional>
#include <span>
#include <vector>

#include "server/base/cancel_point.h"
#include "server/base/parallel.h"
#include "server/formats/mesh/surface_mesh.h"
#include "server/formats/npy/array_pieces.h"

namespace voxeld::mesh {

// Vertices or faces that a thread handles at a time.
inline constexpr size_t kPieceRows = size_t{1} << 14;

inline size_t piece_count_of(size_t rows) {
  return (rows + kPieceRows - 1) / kPieceRows;
}

// Calls work(piece, first_row, last_row) for pieces of rows, on all threads, with a cancellation
// point before each.
template <typename Work>
void for_each_piece(size_t rows, Work&& work) {
  parallel_for(piece_count_of(rows), [&](size_t piece) {
    cancel_point();
    work(piece, piece * kPieceRows, std::min(rows, (piece + 1) * kPieceRows));
  });
}

class MeshRows : public ArrayPieces {
 public:
  // Writes rows [begin, end).
  using Fill = std::function<void(size_t begin, size_t end, uint8_t* out)>;

  // Rows of `row_bytes` each.
  MeshRows(size_t rows, size_t row_bytes, Fill fill)
      : MeshRows(rows, std::move(fill),
                 [row_bytes](size_t begin, size_t end) { return row_bytes * (end - begin); }) {}
  // Rows of several lengths: bytes_of(begin, end) of them together.
  template <typename BytesOf>
  MeshRows(size_t rows, Fill fill, BytesOf&& bytes_of)
      : rows_(rows), begins_(piece_count_of(rows) + 1), fill_(std::move(fill)) {
    for_each_piece(rows, [&](size_t piece, size_t begin, size_t end) {
      begins_[piece + 1] = bytes_of(begin, end);
    });
    for (size_t i = 1; i < begins_.size(); ++i) begins_[i] += begins_[i - 1];
  }

  size_t piece_count() const override { return begins_.size() - 1; }
  uint64_t piece_begin(size_t piece) const override { return begins_[piece]; }
  void fill(size_t piece, std::span<uint8_t> bytes) const override {
    fill_(piece * kPieceRows, std::min(rows_, (piece + 1) * kPieceRows), bytes.data());
  }
  Repeats repeats() const override { return Repeats::anywhere(); }

 private:
  size_t rows_;
  std::vector<uint64_t> begins_;
  Fill fill_;
};

// Calls take(a, b, c) for the triangles of a face.
template <typename Take>
void for_each_triangle(const Face& face, Take&& take) {
  const auto& [a, b, c, d] = face.corners;
  take(a, b, c);
  if (face.is_quad()) take(a, c, d);
}

inline uint64_t quads_among(std::span<const Face> faces) {
  return static_cast<uint64_t>(std::ranges::count_if(faces, &Face::is_quad));
}

}  // namespace voxeld::mesh
