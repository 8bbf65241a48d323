// Lookups in the tree of shared/raymarch.h.

// The including file defines these: words of the buffers.
uint node_word(uint index);
uint brick_word(uint index);

struct MarchGrid {
  ivec3 low, high;  // cells [low, high) hold all voxels; they lie in the tiles
  ivec3 tile_dims;
};

const uint MARCH_NO_PART = 0xffffffffu;

// The part of the tree at a cell.
struct MarchNode {
  // Log2 of the side of the aligned empty cube around the cell; -1: it is occupied.
  int empty_shift;
  uint part;  // number of its brick (level 5: offset of its block's table), or MARCH_NO_PART
};

bool march_is_child(uint entry) { return (entry & RAYMARCH_CHILD) != 0u; }

uint march_tile_entry(MarchGrid grid, ivec3 cell) {
  ivec3 tile = cell >> RAYMARCH_TILE_SHIFT;
  return node_word(uint(tile.x + grid.tile_dims.x * (tile.y + grid.tile_dims.y * tile.z)));
}

uint march_block_entry(uint tile_entry, ivec3 cell) {
  ivec3 slot = (cell >> RAYMARCH_BLOCK_SHIFT) & 7;
  return node_word((tile_entry & ~RAYMARCH_CHILD) + uint(slot.x + 8 * slot.y + 64 * slot.z));
}

uint march_brick_entry(uint block_entry, ivec3 cell) {
  ivec3 slot = (cell >> RAYMARCH_BRICK_SHIFT) & 3;
  return node_word((block_entry & ~RAYMARCH_CHILD) + uint(slot.x + 4 * slot.y + 16 * slot.z));
}

// The entry of the smallest part of the tree around the cell: its tile, block or brick. If
// `stop_at_blocks`, it is never a brick.
uint march_entry(MarchGrid grid, ivec3 cell, bool stop_at_blocks) {
  uint entry = march_tile_entry(grid, cell);
  if (march_is_child(entry)) {
    entry = march_block_entry(entry, cell);
    if (march_is_child(entry) && !stop_at_blocks) entry = march_brick_entry(entry, cell);
  }
  return entry;
}

// Tests the cell in its brick's mask. Level 0, 1 or 2 selects the cube of 2^level cells around it.
int march_empty_shift_in_brick(uint brick, ivec3 cell, int level) {
  int bit = dda_brick_bit(cell.x, cell.y, cell.z);
  uint word = brick * uint(RAYMARCH_BRICK_WORDS) + uint(bit >> 5);
  uint half_node = brick_word(word);
  if (level == 0 && (half_node >> (bit & 31) & 1u) != 0u) return -1;
  if ((half_node >> (bit & 24) & 255u) != 0u) return level == 0 ? 0 : -1;
  // The other half of the cube of 4^3 is in the adjacent word.
  if (half_node != 0u || brick_word(word ^ 1u) != 0u) return level == 2 ? -1 : 1;
  return 2;
}

// Level 0 tests the cell. 1, 2, 3, 5 test the aligned cube of 2^level cells around it, which counts
// as occupied if any of its cells is.
MarchNode march_node_of_entry(uint entry, ivec3 cell, int level) {
  MarchNode node;
  node.part = MARCH_NO_PART;
  node.empty_shift = -1;
  if (march_is_child(entry)) {
    node.part = entry & ~RAYMARCH_CHILD;
    if (level < 3) node.empty_shift = march_empty_shift_in_brick(node.part, cell, level);
  } else if ((entry & RAYMARCH_FULL) == 0u) {
    node.empty_shift = int(entry);
  }
  return node;
}

// Number of a voxel in storage order: its brick's first, plus the number of mask bits before its
// own.
uint march_voxel_number(uint brick, int bit) {
  uint first = brick * uint(RAYMARCH_BRICK_WORDS);
  uint count = brick_word(first + uint(RAYMARCH_BRICK_FIRST));
  for (int word = 0; word <= bit >> 5; ++word) {
    uint before = word == (bit >> 5) ? (1u << (bit & 31)) - 1u : 0xffffffffu;
    count += uint(bitCount(brick_word(first + uint(word)) & before));
  }
  return count;
}

// Bit i is set if byte i of the word is not 0.
uint march_any_bytes(uint word) {
  uint high = ((word & 0x7f7f7f7fu) + 0x7f7f7f7fu) | word;
  return (high >> 7 & 1u) | (high >> 14 & 2u) | (high >> 21 & 4u) | (high >> 28 & 8u);
}

// The occupied ones of the 2^3 cubes of 2^level cells in the aligned cube of 2^(level+1) cells
// around `cell`: bit x | y << 1 | z << 2. entry: the cell's brick; level: 0, 1 or 2.
uint march_octants_in_brick(uint entry, ivec3 cell, int level) {
  if (!march_is_child(entry)) return (entry & RAYMARCH_FULL) != 0u ? 255u : 0u;
  uint first = (entry & ~RAYMARCH_CHILD) * uint(RAYMARCH_BRICK_WORDS);
  if (level == 2) return brick_word(first + uint(RAYMARCH_BRICK_NODES));
  int bit = dda_brick_bit(cell.x, cell.y, cell.z);
  if (level == 0) return brick_word(first + uint(bit >> 5)) >> (bit & 24) & 255u;
  uint half_node = first + uint(bit >> 6 << 1);
  return march_any_bytes(brick_word(half_node)) | march_any_bytes(brick_word(half_node + 1u)) << 4;
}

// The same at level 3 (bricks of a block) or 5 (blocks of a tile). entry: that of the block or
// tile.
uint march_octants_of_table(uint entry, ivec3 cell, int level) {
  if (!march_is_child(entry)) return (entry & RAYMARCH_FULL) != 0u ? 255u : 0u;
  uint octants = 0u;
  for (int i = 0; i < 8; ++i) {
    ivec3 octant = ivec3(i & 1, i >> 1 & 1, i >> 2);
    ivec3 at = ((cell >> (level + 1) << 1) + octant) << level;
    uint found = level == 3 ? march_brick_entry(entry, at) : march_block_entry(entry, at);
    if (found >= RAYMARCH_FULL) octants |= 1u << i;
  }
  return octants;
}
