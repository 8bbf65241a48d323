// Reservation of places in the lists of a batch, and the arguments of the dispatches over them.
layout(std430, binding = BATCH_COUNTS) buffer Counts { BatchCounts counts; };

// Work groups of a dispatch over `items`: x, y.
uvec2 batch_dispatch(uint items) {
  uint groups = (items + uint(BATCH_GROUP_SIZE) - 1u) / uint(BATCH_GROUP_SIZE);
  return uvec2(min(groups, uint(BATCH_FOLD)), (groups + uint(BATCH_FOLD) - 1u) / uint(BATCH_FOLD));
}

// Reserves `count` items and returns the place of the first. The dispatch covers as many as the
// list and one dispatch hold, `most`.
uint take_small(uint count, uint most) {
  if (count == 0u) return 0u;
  uint first = atomicAdd(counts.small_count, count);
  uvec2 groups = batch_dispatch(min(first + count, most));
  atomicMax(counts.small_x, groups.x);
  atomicMax(counts.small_y, groups.y);
  atomicMax(counts.small_needed, first + count);
  atomicAdd(counts.item_count, count);
  return first;
}
uint take_large(uint count, uint most) {
  if (count == 0u) return 0u;
  uint first = atomicAdd(counts.large_count, count);
  uvec2 groups = batch_dispatch(min(first + count, most));
  atomicMax(counts.large_x, groups.x);
  atomicMax(counts.large_y, groups.y);
  atomicMax(counts.large_needed, first + count);
  atomicAdd(counts.item_count, count);
  return first;
}
