// The container of binary glTF: chunks, and arrays that accessors describe.
#pragma once

#include <cstdint>
#include <vector>

#include <nlohmann/json.hpp>

#include "proto/result.h"
#include "server/formats/mesh/mesh_rows.h"
#include "server/formats/output_file.h"

namespace voxeld::mesh {

// The parts of a file's binary chunk and the JSON that describes them.
class GlbBuffer {
 public:
  enum class Use { kVertices, kIndices, kInstances };

  // is_compressed: arrays are compressed by meshoptimizer (EXT_meshopt_compression).
  explicit GlbBuffer(bool is_compressed) : is_compressed_(is_compressed) {}

  // Adds an array as an accessor and returns its number. element_bytes: of a vertex, with padding
  // to 4 bytes, or of an index.
  int add(MeshRows rows, size_t element_bytes, Use use, nlohmann::json accessor);

  // Compresses the arrays, and adds buffers, bufferViews and accessors to the document. Call once.
  void describe(nlohmann::json& document);
  // Writes the file. Errors: grid-too-large above 4 GiB; storage-full, internal.
  Status write(const nlohmann::json& document, OutputFile& file) const;

 private:
  struct Array {
    MeshRows rows;
    size_t element_bytes;
    Use use;
    std::vector<uint8_t> compressed{};
  };

  void compress(Array& array) const;
  uint64_t stored_bytes(const Array& array) const;

  bool is_compressed_;
  std::vector<Array> arrays_;
  nlohmann::json accessors_ = nlohmann::json::array();
  uint64_t bytes_ = 0;  // of the chunk
};

}  // namespace voxeld::mesh
