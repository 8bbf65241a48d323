#include "server/scene/core/vertex_table.h"

#include <algorithm>
#include <bit>
#include <random>

#include "server/base/cancel_point.h"
#include "server/base/pieces.h"

namespace voxeld {
namespace {

constexpr size_t kFirstSlots = 256;
constexpr size_t kExpectedMax = size_t{1} << 24;

// Without the call of memcmp() that the array's == makes.
template <size_t kWords>
bool same(const std::array<uint32_t, kWords>& a, const std::array<uint32_t, kWords>& b) {
  for (size_t i = 0; i < kWords; ++i) {
    if (a[i] != b[i]) return false;
  }
  return true;
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

template <size_t kWords>
BasicVertexTable<kWords>::BasicVertexTable(size_t expected_count) {
  resize_in_pieces(
      slots_, std::max(kFirstSlots, std::bit_ceil(2 * std::min(expected_count, kExpectedMax) + 1)),
      Slot{{}, kEmpty});
}

template <size_t kWords>
size_t BasicVertexTable<kWords>::start_of(const Key& key, size_t slot_count) {
  uint64_t hash = process_seed();
  for (size_t i = 0; i < kWords; i += 2) {
    const uint64_t high = i + 1 < kWords ? key[i + 1] : 0;
    hash = mix(hash ^ (high << 32 | key[i]));
  }
  return hash & (slot_count - 1);
}

template <size_t kWords>
std::pair<uint32_t, bool> BasicVertexTable<kWords>::find_or_add(const Key& key, uint32_t value) {
  if (2 * (count_ + 1) > slots_.size()) grow();
  for (size_t at = start_of(key, slots_.size());; at = (at + 1) & (slots_.size() - 1)) {
    Slot& slot = slots_[at];
    if (slot.value == kEmpty) {
      slot = {key, value};
      ++count_;
      return {value, true};
    }
    if (same(slot.key, key)) return {slot.value, false};
  }
}

template <size_t kWords>
void BasicVertexTable<kWords>::grow() {
  std::vector<Slot> larger;
  resize_in_pieces(larger, 2 * slots_.size(), Slot{{}, kEmpty});
  for (const Slot& slot : slots_) {
    cancel_point();
    if (slot.value == kEmpty) continue;
    size_t at = start_of(slot.key, larger.size());
    while (larger[at].value != kEmpty) at = (at + 1) & (larger.size() - 1);
    larger[at] = slot;
  }
  slots_.swap(larger);
  free_in_pieces(larger);
}

template class BasicVertexTable<4>;
template class BasicVertexTable<7>;

}  // namespace voxeld
