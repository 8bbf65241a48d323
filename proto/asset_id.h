// Ids of assets, and the part of a file's name that belongs to an id.
//
// An asset's id is the hash of its bytes. The same bytes under two names may be two different
// meshes, because the name's extension decides how they are read. If a tenant has already uploaded
// the bytes under a name that is read otherwise, the id of the new upload carries its own reading:
//
//   sha256-<64 hex>              read as the stored name of the asset says
//   sha256-<64 hex>.<reading>    read so: "obj", "zip~21b.obj", or "bytes" for no name
//
// An upload under another name therefore changes nothing for holders of the earlier id.
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
  std::optional<std::string> reading;  // reading_of() a name; nullopt: as the asset's name says

  // Accepts any text; text that is not an id names no blob.
  static AssetId parse(std::string_view id);
  std::string text() const;
};

// `filename`, changed so that it is read in this way: ("a/bunny.off", ".obj") -> "bunny.obj".
std::string filename_read_as(std::string_view filename, std::string_view reading);

}  // namespace voxeld
