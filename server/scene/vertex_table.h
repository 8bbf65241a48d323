// Finds the vertex that was made from the same numbers before.
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <utility>
#include <vector>

namespace voxeld {

// Open addressing with linear probing over a vector; keys are up to four 32-bit numbers (indices
// of an OBJ corner, bits of an STL position). The hash is seeded per process, so that no file can
// be made to collide.
class VertexTable {
 public:
  using Key = std::array<uint32_t, 4>;

  // `expected_count`: of keys; only a hint.
  explicit VertexTable(size_t expected_count = 0);
  // The value stored for `key`, or `value`, which is stored then; second: whether it is new.
  std::pair<uint32_t, bool> find_or_add(const Key& key, uint32_t value);

 private:
  struct Slot {
    Key key;
    uint32_t value;
  };
  static constexpr uint32_t kEmpty = UINT32_MAX;

  size_t start_of(const Key& key) const;
  void grow();

  std::vector<Slot> slots_;  // a power of two
  size_t count_ = 0;
};

}  // namespace voxeld
