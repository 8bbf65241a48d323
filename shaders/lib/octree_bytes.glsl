// Byte-wise writing of octrees. The including file has the parameters.
layout(std430, binding = OCTREE_BYTES) buffer Bytes { uint octree_words[]; };

// ORs one byte in. Words must be zero before; the atomic is needed because other invocations may
// write neighbouring bytes.
void put_byte(uint at, uint byte) {
  if (byte == 0u || (at >> 2) >= params.octree_words) return;
  atomicOr(octree_words[at >> 2], byte << (8u * (at & 3u)));
}
