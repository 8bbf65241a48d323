// Numbers for the vertices of a mesh: one for each point of the lattice, or for each point and
// colour.
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "server/formats/mesh/lattice_points.h"
#include "server/formats/mesh/surface_mesh.h"

namespace voxeld::mesh {

// Use: count() each corner, begin(), add() each corner again, number_vertices(); then find().
// Without colours only number_vertices() is needed. count(), add() and find() are thread-safe.
class VertexTable {
 public:
  VertexTable(const LatticePoints& points, bool has_colors);

  void count(uint32_t brick);
  void begin();
  void add(uint32_t brick, uint32_t in_brick, Rgba color);
  // Orders the vertices by brick, point and colour.
  void number_vertices();

  uint64_t size() const { return size_; }
  uint32_t find(uint32_t brick, uint32_t in_brick, Rgba color) const;
  // color: of all vertices, without colours.
  UnsetArray<Vertex> vertices(Rgba color) const;

 private:
  using Key = uint64_t;  // point << 32 | colour

  const LatticePoints& points_;
  bool has_colors_;
  uint64_t size_ = 0;
  std::vector<uint64_t> first_;  // by brick: number of its first vertex
  // Without colours, by brick: vertices before a plane.
  std::vector<std::array<uint16_t, limits::kBrickSide>> before_;
  // With colours, by brick: corners, then distinct ones, and where they begin in keys_.
  std::vector<uint32_t> counts_;
  std::vector<uint64_t> begins_;
  UnsetArray<Key> keys_;
};

}  // namespace voxeld::mesh
