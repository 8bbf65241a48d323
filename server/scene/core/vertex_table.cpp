#include "server/scene/core/vertex_table.h"

#include <algorithm>
#include <bit>
#include <random>

namespace voxeld {
namespace {

constexpr size_t kFirstSlots = 256;
constexpr size_t kExpectedMax = size_t{1} << 24;

bool same(const VertexTable::Key& a, const VertexTable::Key& b) {
  return a[0] == b[0] && a[1] == b[1] && a[2] == b[2] && a[3] == b[3];
}

// One round of SplitMix64 (Steele, Lea & Flood 2014).
uint64_t mix(uint64_t x) {
  x = (x ^ (x >> 30)) * 0xbf58476d1ce4e5b9u;
  x = (x ^ (x >> 27)) * 0x94d049bb133111ebu;
  return x ^ (x >> 31);
}

uint64_t process_seed() {
  static const uint64_t seed = [] {
    std::random_device device;
    return uint64_t{device()} << 32 | device();
  }();
  return seed;
}

}  // namespace

VertexTable::VertexTable(size_t expected_count)
    : slots_(std::max(kFirstSlots, std::bit_ceil(2 * std::min(expected_count, kExpectedMax) + 1)),
             Slot{{}, kEmpty}) {}

size_t VertexTable::start_of(const Key& key) const {
  const uint64_t low = uint64_t{key[1]} << 32 | key[0];
  const uint64_t high = uint64_t{key[3]} << 32 | key[2];
  return mix(mix(low ^ process_seed()) ^ high) & (slots_.size() - 1);
}

std::pair<uint32_t, bool> VertexTable::find_or_add(const Key& key, uint32_t value) {
  if (2 * (count_ + 1) > slots_.size()) grow();
  for (size_t at = start_of(key);; at = (at + 1) & (slots_.size() - 1)) {
    Slot& slot = slots_[at];
    if (slot.value == kEmpty) {
      slot = {key, value};
      ++count_;
      return {value, true};
    }
    if (same(slot.key, key)) return {slot.value, false};
  }
}

void VertexTable::grow() {
  std::vector<Slot> old(2 * slots_.size(), Slot{{}, kEmpty});
  old.swap(slots_);
  for (const Slot& slot : old) {
    if (slot.value == kEmpty) continue;
    size_t at = start_of(slot.key);
    while (slots_[at].value != kEmpty) at = (at + 1) & (slots_.size() - 1);
    slots_[at] = slot;
  }
}

}  // namespace voxeld
