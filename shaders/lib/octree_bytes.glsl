// Writes octrees byte by byte; the including file has the parameters.
layout(std430, binding = OCTREE_BYTES) buffer Bytes { uint octree_words[]; };

// Words are zero before, and neighbouring bytes may come from other invocations.
void put_byte(uint at, uint byte) {
  if (byte == 0u || (at >> 2) >= params.octree_words) return;
  atomicOr(octree_words[at >> 2], byte << (8u * (at & 3u)));
}
