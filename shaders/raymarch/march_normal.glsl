// The direction of the surface through a voxel, from the occupied voxels around it.

// Moments of the occupied cubes of 2^level cells, up to two cubes on each side of the one around
// `cell`, in cubes relative to it. Two is the least that distinguishes slopes of 1:5.
//
// The 5^3 cubes lie in 3^3 octants of 2^3. In an octant with its corner at p, cube i is at p + (i &
// 1, i >> 1 & 1, i >> 2), so the moments are sums of bit counts. The moment of x*y over an octant
// is n*p.x*p.y + ny*p.x + nx*p.y + nxy, where n, nx, ny, nxy count the bits with 1, x, y, x*y = 1.
Moments march_moments(MarchGrid grid, ivec3 cell, int level) {
  ivec3 middle = cell >> level;
  ivec3 first = (middle - 2) >> 1;
  // The last lookup and its place are cached.
  ivec3 block_at = ivec3(-1), brick_at = ivec3(-1);
  uint tile_entry = 0u, block_entry = 0u, entry = 0u;
  int count = 0;
  ivec3 sum = ivec3(0), squares = ivec3(0), products = ivec3(0);
  for (int i = 0; i < 27; ++i) {
    ivec3 octant = first + ivec3(i % 3, i / 3 % 3, i / 9);
    ivec3 p = octant * 2 - middle;
    ivec3 at = octant << (level + 1);
    ivec3 block = at >> RAYMARCH_BLOCK_SHIFT;
    if (any(notEqual(block, block_at))) {
      block_at = block;
      ivec3 tile = at >> RAYMARCH_TILE_SHIFT;
      bool inside =
          all(greaterThanEqual(at, ivec3(0))) && all(lessThan(tile, grid.tile_dims));
      tile_entry = inside ? march_tile_entry(grid, at) : 0u;
      block_entry = march_is_child(tile_entry) ? march_block_entry(tile_entry, at) : tile_entry;
      entry = block_entry;
      brick_at = ivec3(-1);
    }
    ivec3 brick = at >> RAYMARCH_BRICK_SHIFT;
    if (level < 3 && march_is_child(block_entry) && any(notEqual(brick, brick_at))) {
      brick_at = brick;
      entry = march_brick_entry(block_entry, at);
    }
    uint bits = 0u;
    if (level < 3) {
      bits = march_octants_in_brick(entry, at, level);
    } else {
      bits = march_octants_of_table(level == 3 ? block_entry : tile_entry, at, level);
    }
    // Cubes that are three away are excluded.
    if (p.x == -3) bits &= 0xaau;
    if (p.y == -3) bits &= 0xccu;
    if (p.z == -3) bits &= 0xf0u;
    if (p.x == 2) bits &= 0x55u;
    if (p.y == 2) bits &= 0x33u;
    if (p.z == 2) bits &= 0x0fu;
    int n = int(bitCount(bits));
    ivec3 high = ivec3(bitCount(bits & 0xaau), bitCount(bits & 0xccu), bitCount(bits & 0xf0u));
    count += n;
    sum += p * n + high;
    squares += p * p * n + p * high * 2 + high;
    products += ivec3(p.x * p.y * n + p.x * high.y + p.y * high.x + int(bitCount(bits & 0x88u)),
                      p.x * p.z * n + p.x * high.z + p.z * high.x + int(bitCount(bits & 0xa0u)),
                      p.y * p.z * n + p.y * high.z + p.z * high.y + int(bitCount(bits & 0xc0u)));
  }
  Moments moments;
  moments.count = float(count);
  moments.sum = vec3(sum);
  moments.squares = vec3(squares);
  moments.products = vec3(products);
  return moments;
}

// The normal in world space, pointing to either side; zero if the voxels form no surface. scale:
// sides of a voxel over the longest of them.
vec3 march_estimated_normal(MarchGrid grid, ivec3 cell, int level, vec3 scale) {
  Moments moments = march_moments(grid, cell, level);
  moments.sum *= scale;
  moments.squares *= scale * scale;
  moments.products *= vec3(scale.x, scale.x, scale.y) * vec3(scale.y, scale.z, scale.z);
  return thinnest_direction(moments);
}
