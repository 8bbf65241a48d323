#include "server/formats/zip/huffman.h"

#include <algorithm>
#include <array>
#include <cstddef>
#include <vector>

namespace voxeld {
namespace {

constexpr size_t kLengthsMax = 16;

struct Leaf {
  uint64_t count;
  size_t symbol;
};

// Depths in Huffman's tree of leaves in ascending order of their counts.
std::vector<size_t> depths_of(std::span<const Leaf> leaves) {
  const size_t n = leaves.size(), nodes = 2 * n - 1;
  std::vector<uint64_t> counts(nodes);
  std::vector<size_t> parents(nodes), depths(nodes);
  for (size_t i = 0; i < n; ++i) counts[i] = leaves[i].count;
  // Inner nodes arise in ascending order, so both least nodes are at the front of a list.
  size_t leaf = 0, inner = n;
  for (size_t made = n; made < nodes; ++made) {
    for (int child = 0; child < 2; ++child) {
      const bool takes_leaf = leaf < n && (inner == made || counts[leaf] <= counts[inner]);
      const size_t least = takes_leaf ? leaf++ : inner++;
      counts[made] += counts[least];
      parents[least] = made;
    }
  }
  for (size_t i = nodes - 1; i-- > 0;) depths[i] = depths[parents[i]] + 1;
  depths.resize(n);
  return depths;
}

}  // namespace

void huffman_lengths(std::span<const uint32_t> counts, int length_max, std::span<uint8_t> lengths) {
  std::ranges::fill(lengths, uint8_t{0});
  std::vector<Leaf> leaves;
  for (size_t i = 0; i < counts.size(); ++i) {
    if (counts[i] > 0) leaves.push_back({counts[i], i});
  }
  for (size_t i = 0; leaves.size() < 2; ++i) {
    if (counts[i] == 0) leaves.push_back({0, i});
  }
  std::ranges::stable_sort(leaves, {}, &Leaf::count);

  const auto longest = static_cast<size_t>(length_max);
  std::array<size_t, kLengthsMax> number{};  // of codes, by length
  for (const size_t depth : depths_of(leaves)) ++number[std::min(depth, longest)];
  // The number of words of length_max bits that begin with a code. Each step frees one: a shorter
  // code becomes the parent of itself and of one of the longest.
  uint64_t words = 0;
  for (size_t length = 1; length <= longest; ++length)
    words += number[length] << (longest - length);
  for (; words > uint64_t{1} << longest; --words) {
    size_t length = longest - 1;
    while (number[length] == 0) --length;
    --number[length];
    number[length + 1] += 2;
    --number[longest];
  }
  auto leaf = leaves.begin();
  for (size_t length = longest; length > 0; --length) {
    for (size_t i = 0; i < number[length]; ++i) {
      lengths[(leaf++)->symbol] = static_cast<uint8_t>(length);
    }
  }
}

void huffman_codes(std::span<const uint8_t> lengths, std::span<uint16_t> codes) {
  std::array<unsigned, kLengthsMax + 1> number{}, next{};
  for (const uint8_t length : lengths) ++number[length];
  number[0] = 0;
  for (size_t length = 1; length <= kLengthsMax; ++length) {
    next[length] = (next[length - 1] + number[length - 1]) << 1;
  }
  for (size_t i = 0; i < lengths.size(); ++i) {
    unsigned code = lengths[i] == 0 ? 0 : next[lengths[i]]++;
    unsigned reversed = 0;
    for (uint8_t bit = 0; bit < lengths[i]; ++bit, code >>= 1)
      reversed = reversed << 1 | (code & 1);
    codes[i] = static_cast<uint16_t>(reversed);
  }
}

}  // namespace voxeld
