// The lower envelope of parabolas along a row of cells: one pass of a distance transform.
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

namespace voxeld {

inline constexpr uint32_t kNoDistance = UINT32_MAX;  // no cell is set

// The envelope of f(i) + (x - i)^2 at integers x, in linear time (Felzenszwalb & Huttenlocher 2012,
// "Distance transforms of sampled functions"). It is exact: f is below 2^30, rows are at most 16384
// long.
class LowerEnvelope {
 public:
  // f(i) is kNoDistance if i has no parabola. Returns false if there is no parabola at all.
  bool build(std::span<const uint32_t> f) {
    apex_.resize(f.size());
    from_.resize(f.size());
    f_ = f;
    top_ = 0;
    for (uint32_t u = 0; u < f.size(); ++u) {
      if (f[u] != kNoDistance) add(u);
    }
    return top_ > 0;
  }

  // Calls visit(x, i) for x from end - 1 down to first. i has the least value at x; the lowest i
  // wins a tie.
  template <typename Visit>
  void visit(uint32_t first, uint32_t end, const Visit& visit) const {
    size_t at = top_;
    for (uint32_t x = end; x-- > first;) {
      while (from_[at - 1] > x) --at;
      visit(x, apex_[at - 1]);
    }
  }

  uint32_t value(uint32_t i, uint32_t x) const {
    const uint32_t apart = x > i ? x - i : i - x;
    return f_[i] + apart * apart;
  }

 private:
  void add(uint32_t u) {
    while (top_ > 0 && value(apex_[top_ - 1], from_[top_ - 1]) > value(u, from_[top_ - 1])) --top_;
    uint32_t from = 0;
    if (top_ > 0) {
      const uint32_t i = apex_[top_ - 1];
      // The last place where i is not above u. The quotient is not negative, because at from_ the
      // value of i is not above that of u.
      from = (u * u - i * i + f_[u] - f_[i]) / (2 * (u - i)) + 1;
      if (from >= f_.size()) return;
    }
    apex_[top_] = u;
    from_[top_] = from;
    ++top_;
  }

  std::span<const uint32_t> f_;
  std::vector<uint32_t> apex_, from_;  // parabolas of the envelope, and where they begin
  size_t top_ = 0;
};

}  // namespace voxeld
