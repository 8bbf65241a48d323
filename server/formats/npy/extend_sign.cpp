#include "server/formats/npy/extend_sign.h"

#include <algorithm>
#include <cmath>
#include <vector>

#include "server/base/pieces.h"

namespace voxeld {
namespace {

class SignExtension {
 public:
  SignExtension(const std::array<size_t, 3>& sides, float background)
      : sides_(sides), background_(background) {}

  // Processes all values at one place on the axes before `axis`. Returns false if none is known;
  // they stay NaN.
  bool run(std::span<float> values, size_t axis) const {
    if (axis == sides_.size()) return !std::isnan(values.front());
    if (axis + 1 == sides_.size()) cancel_point();
    const size_t length = values.size() / sides_[axis];
    const auto part = [&](size_t i) { return values.subspan(i * length, length); };
    std::vector<bool> known(sides_[axis]);
    for (size_t i = 0; i < sides_[axis]; ++i) known[i] = run(part(i), axis + 1);
    const auto found = std::ranges::find(known, true);
    if (found == known.end()) return false;
    const auto first = static_cast<size_t>(found - known.begin());
    for (size_t i = 0; i < first; ++i) copy(part(first), part(i));
    for (size_t i = first + 1; i < sides_[axis]; ++i) {
      if (!known[i]) copy(part(i - 1), part(i));
    }
    return true;
  }

 private:
  void copy(std::span<const float> from, std::span<float> to) const {
    in_pieces(to.size(), kPieceElements<float>, [&](size_t begin, size_t end) {
      for (size_t i = begin; i < end; ++i) to[i] = std::copysign(background_, from[i]);
    });
  }

  std::array<size_t, 3> sides_;
  float background_;
};

}  // namespace

void extend_sign(std::span<float> values, const std::array<size_t, 3>& sides, float background) {
  if (!values.empty()) SignExtension(sides, background).run(values, 0);
}

}  // namespace voxeld
