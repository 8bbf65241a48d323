// The bytes that a glTF file refers to: its BIN chunk, data: URIs, files of the bundle.
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include <nlohmann/json_fwd.hpp>

#include "proto/result.h"
#include "server/scene/gltf/container.h"
#include "server/scene/load.h"

namespace voxeld {

// Bytes of all buffers together, as read. More: malformed-mesh. Several buffers may name one file,
// so a limit on the upload alone would not bound this.
inline constexpr uint64_t kGltfBufferBytesMax = uint64_t{8} << 30;

// The document's "buffers", each read on first use: an unused buffer may have no data. One per
// load; the container and the bundle must outlive it.
class GltfBuffers {
 public:
  // Moves the URIs out of a document that passed check_gltf_schema, because data: URIs are large.
  GltfBuffers(std::string_view name, const GltfContainer& container, const Bundle& bundle,
              nlohmann::json& document);

  // Exactly byteLength bytes of an element of "buffers". Errors: malformed-mesh for a buffer that
  // is missing, broken or shorter than byteLength; unsupported-feature, naming the extension, if
  // only an extension can read the data; the bundle's own errors.
  Result<std::span<const uint8_t>> bytes(size_t index);

 private:
  struct Buffer {
    std::optional<std::string> uri;
    std::string compressed_by;  // an extension; empty: none
    uint64_t byte_length = 0;
    bool is_loaded = false;
    std::vector<uint8_t> owned;  // empty for the BIN chunk
    std::span<const uint8_t> data;
  };
  Status load(size_t index, const std::string& where);
  Result<std::vector<uint8_t>> read_uri(const std::string& where, const std::string& uri) const;

  std::string_view name_;
  const GltfContainer& container_;
  const Bundle& bundle_;
  std::vector<Buffer> buffers_;
  uint64_t total_bytes_ = 0;
};

// The "uri" of a buffer or an image, moved out of the element. Blanks and control characters at its
// ends are removed, as in the WHATWG URL standard. nullopt if there is none.
std::optional<std::string> take_uri(nlohmann::json& element);
bool is_data_uri(std::string_view uri);
// The bytes of "data:[type][;base64],…" (RFC 2397); nullopt if the URI is another or broken. Base64
// may use both alphabets of RFC 4648, and its padding may be missing.
std::optional<std::vector<uint8_t>> decode_data_uri(std::string_view uri);

}  // namespace voxeld
