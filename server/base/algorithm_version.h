// The version of the algorithms, a part of every result's name. Raise it in the commit that changes
// the bytes of any result; cached results are then computed anew.
#pragma once

namespace voxeld {
inline constexpr int kAlgorithmVersion = 15;
}  // namespace voxeld
