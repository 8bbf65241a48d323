// Work items of pipeline compute; the layout of the packed form is in shared/voxelize.h.

struct WorkItem {
  uint triangle;      // number in the window
  int axis;           // dominant
  ivec2 first, last;  // columns, inclusive
};

WorkItem unpack_item(uvec2 words) {
  WorkItem item;
  item.triangle = words.x;
  item.axis = int(words.y >> VOXELIZE_ITEM_AXIS_SHIFT) & 3;
  item.first = ivec2(int(words.y & 255u), int((words.y >> VOXELIZE_ITEM_J_SHIFT) & 255u));
  item.last = item.first + ivec2(int((words.y >> VOXELIZE_ITEM_NI_SHIFT) & 15u),
                                 int((words.y >> VOXELIZE_ITEM_NJ_SHIFT) & 15u));
  return item;
}

// Deals groups alternately to the two halves of a dispatch. Software drivers give each thread one
// contiguous part, and items are sorted by cost, so this balances their work.
uint dealt_group(uint group, uint groups) {
  uint first_half = (groups + 1u) / 2u;
  return group < first_half ? 2u * group : 2u * (group - first_half) + 1u;
}
