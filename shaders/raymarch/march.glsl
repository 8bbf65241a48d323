// A ray's march through the tree of shared/raymarch.h, in one flat loop. Every iteration is one
// step over a cell or an empty cube. A SIMD group takes as many steps as its longest ray, and
// `steps_max` bounds that (workaround loop_iterations_65535).

struct March {
  bool hit;
  ivec3 cell;  // the ray's first cell in the hit cube
  int axis;    // axis of the face through which it entered; -1: it began inside
  float t;
  int level;   // the hit cube has 2^level cells a side
  uint part;   // as in MarchNode
};

// The level of cubes that a ray tests at distance t. level_t: distances from which a ray takes
// cubes of 2, 4, 8 and 32 cells for occupied if any of their cells is.
int march_level(vec4 level_t, float t) {
  if (t < level_t.x) return 0;
  return t >= level_t.w ? 5 : 1 + int(t >= level_t.y) + int(t >= level_t.z);
}

// Marches from `cell`, which must be one of the grid's.
March march(MarchGrid grid, GridRay ray, ivec3 cell, float t_max, vec4 level_t, int steps_max) {
  March found;
  found.hit = false;
  found.cell = ivec3(-1);
  found.axis = -1;
  found.t = 0.0f;
  found.level = 0;
  found.part = MARCH_NO_PART;
  // The last lookup and its place are cached, because a lookup costs more than the rest of a step.
  ivec3 block_at = ivec3(-1), brick_at = ivec3(-1);
  uint block_entry = 0u, entry = 0u;
  DdaStep at;
  at.cell = cell;
  at.axis = -1;
  at.t = 0.0f;
  float t_box = dda_leave_box(ray, grid.low, grid.high);
  for (int step_count = 0; step_count < steps_max; ++step_count) {
    int level = march_level(level_t, at.t);
    ivec3 block = at.cell >> RAYMARCH_BLOCK_SHIFT;
    if (any(notEqual(block, block_at))) {
      block_at = block;
      block_entry = march_tile_entry(grid, at.cell);
      if (march_is_child(block_entry)) block_entry = march_block_entry(block_entry, at.cell);
      entry = block_entry;
      brick_at = ivec3(-1);
    }
    ivec3 brick = at.cell >> RAYMARCH_BRICK_SHIFT;
    if (march_is_child(block_entry) && any(notEqual(brick, brick_at))) {
      brick_at = brick;
      entry = march_brick_entry(block_entry, at.cell);
    }
    MarchNode node = march_node_of_entry(level < 5 ? entry : block_entry, at.cell, level);
    if (node.empty_shift < 0) {
      found.hit = true;
      found.cell = at.cell;
      found.axis = at.axis;
      found.t = at.t;
      found.level = level;
      found.part = node.part;
      return found;
    }
    at = dda_leave_block(ray, node.empty_shift, at.cell);
    if (at.t > t_max || !(at.t < t_box)) return found;
  }
  return found;
}
