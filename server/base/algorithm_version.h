// Part of the name of every result: raise it in the commit that changes the bytes that any request
// gives, and results that were cached before are computed anew.
#pragma once

namespace voxeld {
inline constexpr int kAlgorithmVersion = 6;
}  // namespace voxeld
