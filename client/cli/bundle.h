// Finds the files that a mesh file names, which are sent with it.
#pragma once

#include <filesystem>
#include <memory>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "client/include/voxeld/client.h"

namespace voxeld::cli {

// Waits until what writes `input`, if that is stdin or a pipe, has begun or ended. Returns the
// descriptor of a pipe, which the last copy closes. MeshSource::open() takes it: a pipe that is
// opened again does not tell that its writer is gone. Throws client::Error "file" and
// "interrupted".
std::shared_ptr<const int> await_stream(const std::string& input, const std::stop_token& stop);

// The data to send for one input of the command line.
class MeshSource {
 public:
  // Opens `input`, a path or "-" for stdin. An .obj, .ply, .gltf, .glb or .md5mesh that names
  // other files (materials, textures, buffers, animations) becomes a bundle with them. Names that
  // lead out of the mesh's folder and files that are missing, empty or cannot be read are omitted;
  // the daemon's response names them.
  //
  // `beside`: paths of files that are sent with it under their own names, such as animations.
  // `stop` ends the wait for bytes of stdin. `pipe`: what await_stream() returned for `input`; a
  // pipe without it is opened. Throws client::Error "file".
  static MeshSource open(const std::string& input, std::span<const std::string> beside = {},
                         const std::stop_token& stop = {}, std::shared_ptr<const int> pipe = {});

  const client::Source& source() const { return source_; }
  // Throws client::Error "invalid-option" if `output` is one of the bundle's files.
  void check_output(const std::string& output) const;

 private:
  explicit MeshSource(client::Source source) : source_(std::move(source)) {}

  client::Source source_;
  std::vector<std::filesystem::path> files_;  // of the bundle; empty without one
};

struct ReferencedFile {
  std::string path;  // from the mesh's folder
  std::string name;  // in the bundle: UTF-8, which the daemon finds for the reference
};

// The files that the file names, in order and once each; only those inside its folder.
// Understands .obj (with the .mtl it names), .ply, .gltf, .glb and .md5mesh (with .mtr files and
// images of its folder, and .md5anim files with the same joints). Empty for other files. A name
// that is not there may mean another file of the folder or below (FileNames). A file whose path
// makes no name for a bundle is left out.
std::vector<ReferencedFile> referenced_files(const std::filesystem::path& mesh);

}  // namespace voxeld::cli
