// Ids of assets, and what of a file's name they say.
//
// An asset is called by the hash of its bytes. The same bytes under two names may be two meshes, as
// the name's extension decides how they are read. Where a tenant has them under a name that is read
// otherwise, the id of an upload says how this one is read:
//
//   sha256-<64 hex>              as the name of the asset says
//   sha256-<64 hex>.<reading>    as this one says: "obj", "zip~21b.obj", or "bytes" for no name
//
// So an upload under another name changes nothing for those who have the earlier id.
#pragma once

#include <optional>
#include <string>
#include <string_view>

namespace voxeld {

// The part of a name that decides how bytes are read: the extension, and a bundle's member.
// "bunny.PLY" -> ".ply"; "bundle.zip!models/a.obj" -> ".zip!models/a.obj"; "bunny" -> "".
std::string reading_of(std::string_view filename);

struct AssetId {
  std::string blob;                    // the id of the bytes
  std::optional<std::string> reading;  // reading_of() a name; nullopt: that of the asset's name

  // Any text is taken; one that is no id names no blob.
  static AssetId parse(std::string_view id);
  std::string text() const;
};

// `filename` as a name that is read so: ("a/bunny.off", ".obj") -> "bunny.obj".
std::string filename_read_as(std::string_view filename, std::string_view reading);

}  // namespace voxeld
