// Ids of blobs on the wire: "sha256-" and 64 lower-case hex digits.
#pragma once

#include <algorithm>
#include <string_view>

namespace voxeld {

// A blob id is safe as a file name: it has no separators and no dots.
inline bool is_blob_id(std::string_view id) {
  constexpr std::string_view kPrefix = "sha256-";
  if (id.size() != kPrefix.size() + 64 || !id.starts_with(kPrefix)) return false;
  return std::ranges::all_of(id.substr(kPrefix.size()), [](char c) {
    return (c >= '0' && c <= '9') || (c >= 'a' && c <= 'f');
  });
}

}  // namespace voxeld
