// Exit statuses of voxeld.
#pragma once

namespace voxeld {

inline constexpr int kExitFailure = 1;
inline constexpr int kExitUsage = 64;  // EX_USAGE of sysexits.h: the command line is wrong

}  // namespace voxeld
