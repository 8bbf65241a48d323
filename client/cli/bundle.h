// A mesh file and the files that it names, as one zip.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <string>
#include <vector>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {

// What is sent for one input of the command line.
class MeshSource {
 public:
  // `input`: a path, or "-" for stdin. An .obj, .gltf or .md5mesh that names other files
  // (materials, textures, buffers, animations) becomes a zip of all that are there, in a temporary
  // file; names that lead out of the mesh's folder and files that are missing are left out (the
  // daemon's answer names them).
  // `beside`: paths of files that are sent with it under their own names, animations for one.
  // Throws client::Error "file".
  static MeshSource open(const std::string& input, std::span<const std::string> beside = {});

  const client::Source& source() const { return source_; }

 private:
  explicit MeshSource(client::Source source) : source_(std::move(source)) {}

  client::Source source_;
  std::shared_ptr<void> temporary_;  // removes the zip
};

// Relative paths that the file names, in order and once each; only those that stay in its folder.
// Understands .obj (with the .mtl it names), .gltf and .md5mesh (with .mtr files and images of its
// folder, and the .md5anim whose joints have the same names); empty for other files.
std::vector<std::string> referenced_files(const std::filesystem::path& mesh);

}  // namespace voxeld::cli
