// Colours and stored normals of a hit; cubes of several voxels have their mean.

// The including file defines these: words of the buffers.
uint color_word(uint index);
uint normal_word(uint index);

// The most voxels over which a mean is taken. If a cube has more, only every second, third, ... one
// counts.
const int MARCH_MEAN_VOXELS = 8;

// The voxels of a hit cube of 1, 2^3 or 4^3 cells, which are consecutive in storage order.
struct VoxelRun {
  uint first;
  int count;
};

VoxelRun march_voxels(March found) {
  uint brick = found.part * uint(RAYMARCH_BRICK_WORDS);
  int bit = dda_brick_bit(found.cell.x, found.cell.y, found.cell.z);
  VoxelRun run;
  run.count = 1;
  if (found.level == 1) {
    bit &= ~7;
    run.count = int(bitCount(brick_word(brick + uint(bit >> 5)) >> (bit & 31) & 255u));
  } else if (found.level == 2) {
    bit &= ~63;
    run.count = int(bitCount(brick_word(brick + uint(bit >> 5)))) +
                int(bitCount(brick_word(brick + uint(bit >> 5) + 1u)));
  }
  run.first = march_voxel_number(found.part, bit);
  return run;
}

// Number of the i-th of `taken` voxels, spread over a run. Gray code varies the places, because
// storage order has a pattern that a regular choice would repeat.
uint march_run_voxel(VoxelRun run, int i, int taken) {
  int apart = run.count / taken;
  return run.first + uint(i * run.count / taken + (i ^ (i >> 1)) % apart);
}

// The colour in linear light. of_full: the colour of voxels in full nodes, and so of a block that
// has no others, whose mean is 0. Colours with alpha 0 are of voxels inside of solids and count
// only where there are no others.
vec3 march_color(March found, vec3 of_full) {
  if (found.part == MARCH_NO_PART) return of_full;
  if (found.level >= 5) {
    uint mean = node_word(found.part + uint(RAYMARCH_BLOCK_COLOR));
    return mean == 0u ? of_full : rgb_of_word(mean);
  }
  uint brick = found.part * uint(RAYMARCH_BRICK_WORDS);
  if (found.level == 3) return rgb_of_word(brick_word(brick + uint(RAYMARCH_BRICK_COLOR)));
  VoxelRun run = march_voxels(found);
  int taken = min(run.count, MARCH_MEAN_VOXELS);
  vec3 sum = vec3(0.0f), last = vec3(0.0f);
  float visible = 0.0f;
  for (int i = 0; i < taken; ++i) {
    uint word = color_word(march_run_voxel(run, i, taken));
    last = rgb_of_word(word);
    if ((word >> 24) == 0u) continue;
    sum += last;
    visible += 1.0f;
  }
  return visible == 0.0f ? last : sum / visible;
}

vec3 normal_of_word(uint word) {
  // The shift to the top and back sign-extends each byte.
  ivec3 bytes = ivec3(int(word << 24), int(word << 16), int(word << 8)) >> 24;
  return vec3(bytes) / 127.0f;
}

// The stored normal, not a unit vector; (0,0,0) if there is none.
vec3 march_stored_normal(March found) {
  if (found.part == MARCH_NO_PART) return vec3(0.0f);
  if (found.level >= 5) {
    return normal_of_word(node_word(found.part + uint(RAYMARCH_BLOCK_NORMAL)));
  }
  uint brick = found.part * uint(RAYMARCH_BRICK_WORDS);
  if (found.level == 3) return normal_of_word(brick_word(brick + uint(RAYMARCH_BRICK_NORMAL)));
  VoxelRun run = march_voxels(found);
  int taken = min(run.count, MARCH_MEAN_VOXELS);
  vec3 sum = vec3(0.0f);
  for (int i = 0; i < taken; ++i) {
    sum += normal_of_word(normal_word(march_run_voxel(run, i, taken)));
  }
  return sum / float(taken);
}
