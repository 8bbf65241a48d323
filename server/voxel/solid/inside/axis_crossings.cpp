#include "server/voxel/solid/inside/axis_crossings.h"

#include <atomic>

#include "server/base/in_pieces.h"

namespace voxeld {

void TileCrossings::set(std::span<const Crossing> crossings, int tiles) {
  first_.assign(static_cast<size_t>(tiles) + 1, 0);
  const auto tile_of = [](Crossing c) {
    return static_cast<size_t>(crossing_cell(c) / limits::kTileSide);
  };
  for_each_in_pieces(crossings, [&](Crossing c) { ++first_[tile_of(c) + 1]; });
  for (size_t i = 1; i < first_.size(); ++i) first_[i] += first_[i - 1];
  sorted_.resize(crossings.size());
  std::vector<size_t> place(first_.begin(), first_.end() - 1);
  for_each_in_pieces(crossings, [&](Crossing c) { sorted_[place[tile_of(c)]++] = c; });
}

AxisCrossings::AxisCrossings(const FillMesh& mesh, int axis, const glm::ivec3& dims,
                             ThreadTeam& team) {
  const TriangleColumns triangles(mesh, axis, dims);
  tiles_u_ = triangles.tiles_u();
  columns_.resize(triangles.count());
  const int cells = dims[axis];
  const int tiles = (cells + limits::kTileSide - 1) / limits::kTileSide;
  std::atomic<size_t> next = 0;
  team.run(team.threads(), [&](int) {
    std::vector<Crossing> crossings;
    for (size_t column = next++; column < columns_.size(); column = next++) {
      crossings.clear();
      append_crossings(mesh, triangles.triangles(column), axis, triangles.window(column), cells,
                       crossings);
      columns_[column].set(crossings, tiles);
    }
  });
}

}  // namespace voxeld
