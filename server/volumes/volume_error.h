// Errors about a file of voxels. Each names the file, the place, the expected and the actual value.
#pragma once

#include <algorithm>
#include <array>
#include <cstdint>
#include <string>
#include <string_view>
#include <utility>

#include "proto/limits.h"
#include "proto/result.h"

namespace voxeld::volumes {

// malformed-mesh with the detail "<name>: <where>: <what>"; `where` is "byte 84", "line 3", the
// name of a header's field, or empty.
inline Error malformed_volume(std::string_view name, std::string_view where, std::string_view what,
                              std::string expected = {}, std::string got = {}) {
  std::string detail(name);
  if (!where.empty()) detail.append(": ").append(where);
  detail.append(": ").append(what);
  return {ErrorCode::kMalformedMesh, std::move(detail), std::move(expected), std::move(got)};
}

// unsupported-feature, with the same detail.
inline Error unsupported_volume(std::string_view name, std::string_view where,
                                std::string_view what, std::string expected = {},
                                std::string got = {}) {
  Error error = malformed_volume(name, where, what, std::move(expected), std::move(got));
  error.code = ErrorCode::kUnsupportedFeature;
  return error;
}

// Checks cells on a side, in x, y, z, before the grid is made. Errors: grid-too-large.
inline Status check_volume_dims(std::string_view name, const std::array<int64_t, 3>& dims) {
  if (std::ranges::max(dims) <= limits::kGridSideMax) return {};
  return Error{
      ErrorCode::kGridTooLarge, std::string(name) + ": too many cells on a side",
      "at most " + std::to_string(limits::kGridSideMax),
      std::to_string(dims[0]) + " x " + std::to_string(dims[1]) + " x " + std::to_string(dims[2])};
}

// Checks the number of voxels before they are stored. Errors: grid-too-large.
inline Status check_volume_voxels(std::string_view name, uint64_t voxels) {
  if (voxels <= limits::kSparseVoxelsMax) return {};
  return Error{ErrorCode::kGridTooLarge, std::string(name) + ": too many voxels",
               "at most " + std::to_string(limits::kSparseVoxelsMax), std::to_string(voxels)};
}

}  // namespace voxeld::volumes
