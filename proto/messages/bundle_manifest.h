// A bundle of several uploads as one input. A JSON body of media type kBundleMediaType names assets
// that were uploaded before, so a new animation for an old mesh costs one small upload.
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
// The extension of a stored manifest's file name.
inline constexpr std::string_view kBundleExtension = ".bundle.json";

struct BundleFile {
  std::string name;   // relative, without ".."; other files of the bundle refer to it
  std::string asset;  // id
};

// Whether a file of a bundle may have this name.
Status is_bundle_file_name(const std::string& name);

// Errors: malformed-bundle, naming the member, for no files, more than limits::kBundleEntriesMax,
// two files of one name, and names that a zip may not have either.
Result<std::vector<BundleFile>> parse_bundle_manifest(std::string_view json);

}  // namespace voxeld
