// Several uploads as one input: a JSON body of media type kBundleMediaType names assets that are
// there already, so that a new animation for an old mesh costs only itself.
//
//   {"files": [{"name": "bob.md5mesh", "asset": "sha256-…"},
//              {"name": "walk.md5anim", "asset": "sha256-…"}]}
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "proto/result.h"

namespace voxeld {

inline constexpr std::string_view kBundleMediaType = "application/vnd.voxeld.bundle+json";
// What the file name of a stored manifest ends with.
inline constexpr std::string_view kBundleExtension = ".bundle.json";

struct BundleFile {
  std::string name;   // as other files of the bundle refer to it; relative, without ".."
  std::string asset;  // id
};

// Errors: malformed-bundle, naming the member, for no files, more than limits::kBundleEntriesMax,
// two of one name, and names that no zip may have either.
Result<std::vector<BundleFile>> parse_bundle_manifest(std::string_view json);

}  // namespace voxeld
