// A hash table of vertices by the numbers that they were made from.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace voxeld {

// Open addressing with linear probing over a vector. Keys are `kWords` numbers (indices of an OBJ
// corner, bits of an STL position and colour). The hash is seeded per process, so no file can force
// collisions.
template <size_t kWords>
class BasicVertexTable {
 public:
  using Key = std::array<uint32_t, kWords>;

  // `expected_count` of keys is only a hint.
  explicit BasicVertexTable(size_t expected_count = 0);
  // The value stored for `key`. A new key stores `value`; second: whether it is new.
  std::pair<uint32_t, bool> find_or_add(const Key& key, uint32_t value);

 private:
  struct Slot {
    Key key;
    uint32_t value;
  };
  static constexpr uint32_t kEmpty = UINT32_MAX;

  static size_t start_of(const Key& key, size_t slot_count);
  void grow();

  std::vector<Slot> slots_;  // a power of two
  size_t count_ = 0;
};

extern template class BasicVertexTable<4>;
extern template class BasicVertexTable<7>;
using VertexTable = BasicVertexTable<4>;

}  // namespace voxeld
