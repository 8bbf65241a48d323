// Corners of a batch's triangles. The including file has the buffers.

// q relative to the tile whose first cell is `tile`.
ivec3 batch_vertex(uint triangle, uint corner, ivec3 tile) {
  uint at = 3u * triangles[triangle][corner];
  return ivec3(vertices[at], vertices[at + 1u], vertices[at + 2u]) - (tile << 8);
}
