#include "server/scene/gltf_buffers.h"

#include <nlohmann/json.hpp>
#include <utility>

#include "server/scene/bundle_names.h"
#include "server/scene/gltf_extensions.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

constexpr size_t kShownUriBytes = 40;

// Value of one Base64 digit; -1 for other characters.
int base64_digit(char c) {
  if (c >= 'A' && c <= 'Z') return c - 'A';
  if (c >= 'a' && c <= 'z') return c - 'a' + 26;
  if (c >= '0' && c <= '9') return c - '0' + 52;
  if (c == '+' || c == '-') return 62;
  if (c == '/' || c == '_') return 63;
  return -1;
}

std::optional<std::vector<uint8_t>> decode_base64(std::string_view text) {
  while (!text.empty() && text.back() == '=') text.remove_suffix(1);
  if (text.size() % 4 == 1) return std::nullopt;
  std::vector<uint8_t> bytes;
  bytes.reserve(text.size() / 4 * 3 + 2);
  uint32_t bits = 0;
  int bit_count = 0;
  for (const char c : text) {
    const int digit = base64_digit(c);
    if (digit < 0) return std::nullopt;
    bits = bits << 6 | static_cast<uint32_t>(digit);
    bit_count += 6;
    if (bit_count < 8) continue;
    bit_count -= 8;
    bytes.push_back(static_cast<uint8_t>(bits >> bit_count));
  }
  return bytes;
}

// No element of a file is written with more text than this shows.
std::string shown_uri(const std::string& uri) {
  return is_data_uri(uri) ? shown(std::string_view(uri).substr(0, kShownUriBytes)) : uri;
}

class BufferLoader {
 public:
  BufferLoader(std::string_view name, const GltfContainer& container, const Bundle& bundle)
      : name_(name), container_(container), bundle_(bundle) {}

  Result<GltfBuffer> load(const nlohmann::json& element, size_t index) {
    const std::string where = "buffers[" + std::to_string(index) + "]";
    const auto byte_length = element.at("byteLength").get<uint64_t>();
    GltfBuffer buffer;
    if (element.contains("uri")) {
      const auto& uri = element.at("uri").get_ref<const std::string&>();
      VOXELD_ASSIGN(buffer.owned, read_uri(where, uri));
      buffer.bytes = buffer.owned;
      total_bytes_ += buffer.owned.size();
      if (total_bytes_ > kGltfBufferBytesMax) {
        return malformed_mesh(name_, where, "bytes of all buffers together",
                              "at most " + std::to_string(kGltfBufferBytesMax),
                              std::to_string(total_bytes_));
      }
    } else if (is_meshopt_fallback(element)) {
      return Error{ErrorCode::kUnsupportedFeature,
                   std::string(name_) + " " + where + ": the data is compressed",
                   "extensions that voxeld reads: " + std::string(kReadExtensions),
                   "EXT_meshopt_compression"};
    } else if (index != 0 || !container_.has_bin) {
      return malformed_mesh(name_, where + ".uri", "the buffer has no data",
                            container_.is_glb ? "a uri, or a BIN chunk for buffers[0]" : "a uri",
                            "nothing");
    } else {
      buffer.bytes = container_.bin;
    }
    if (buffer.bytes.size() < byte_length) {
      return malformed_mesh(name_, where, "the data is shorter than byteLength",
                            std::to_string(byte_length) + " bytes",
                            std::to_string(buffer.bytes.size()) + " bytes");
    }
    buffer.bytes = buffer.bytes.first(byte_length);
    return buffer;
  }

 private:
  static bool is_meshopt_fallback(const nlohmann::json& element) {
    const auto extensions = element.find("extensions");
    return extensions != element.end() && extensions->contains("EXT_meshopt_compression");
  }

  Result<std::vector<uint8_t>> read_uri(const std::string& where, const std::string& uri) {
    if (is_data_uri(uri)) {
      auto bytes = decode_data_uri(uri);
      if (bytes) return *std::move(bytes);
      return malformed_mesh(name_, where + ".uri", "broken data URI", "base64", shown_uri(uri));
    }
    VOXELD_ASSIGN(std::optional<std::vector<uint8_t>> bytes, bundle_.find(uri, name_));
    if (bytes) return *std::move(bytes);
    return malformed_mesh(name_, where + ".uri", "the buffer's file is not in the upload",
                          "a zip with the mesh and its files", shown(uri));
  }

  std::string_view name_;
  const GltfContainer& container_;
  const Bundle& bundle_;
  uint64_t total_bytes_ = 0;
};

}  // namespace

bool is_data_uri(std::string_view uri) {
  return uri.starts_with("data:");
}

std::optional<std::vector<uint8_t>> decode_data_uri(std::string_view uri) {
  const size_t comma = uri.find(',');
  if (!is_data_uri(uri) || comma == uri.npos) return std::nullopt;
  const std::string_view header = uri.substr(0, comma);
  const std::string_view body = uri.substr(comma + 1);
  if (header.ends_with(";base64")) {
    if (body.find('%') == body.npos) return decode_base64(body);
    return decode_base64(percent_decoded(body));
  }
  const std::string plain = percent_decoded(body);
  return std::vector<uint8_t>(plain.begin(), plain.end());
}

Result<std::vector<GltfBuffer>> load_gltf_buffers(std::string_view name,
                                                  const nlohmann::json& document,
                                                  const GltfContainer& container,
                                                  const Bundle& bundle) {
  std::vector<GltfBuffer> buffers;
  const auto elements = document.find("buffers");
  if (elements == document.end()) return buffers;
  BufferLoader loader(name, container, bundle);
  for (size_t i = 0; i < elements->size(); ++i) {
    VOXELD_ASSIGN(GltfBuffer buffer, loader.load((*elements)[i], i));
    buffers.push_back(std::move(buffer));
  }
  return buffers;
}

}  // namespace voxeld
