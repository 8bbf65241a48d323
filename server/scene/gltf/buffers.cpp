#include "server/scene/gltf/buffers.h"

#include <algorithm>
#include <nlohmann/json.hpp>
#include <utility>

#include "server/scene/bundle_names.h"
#include "server/scene/gltf/extensions.h"
#include "server/scene/mesh_error.h"

namespace voxeld {
namespace {

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

// The extension whose data replaces a buffer without data; empty if there is none.
std::string compression_of(const nlohmann::json& element) {
  const auto extensions = element.find("extensions");
  if (extensions == element.end()) return {};
  for (const char* extension : {"EXT_meshopt_compression", "KHR_meshopt_compression"}) {
    if (extensions->contains(extension)) return extension;
  }
  return {};
}

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

std::optional<std::string> take_uri(nlohmann::json& element) {
  const auto member = element.find("uri");
  if (member == element.end()) return std::nullopt;
  std::string uri = std::move(member->get_ref<std::string&>());
  const auto is_blank = [](char c) { return static_cast<unsigned char>(c) <= 0x20; };
  uri.erase(std::find_if_not(uri.rbegin(), uri.rend(), is_blank).base(), uri.end());
  uri.erase(uri.begin(), std::find_if_not(uri.begin(), uri.end(), is_blank));
  return uri;
}

GltfBuffers::GltfBuffers(std::string_view name, const GltfContainer& container,
                         const Bundle& bundle, nlohmann::json& document)
    : name_(name), container_(container), bundle_(bundle) {
  const auto elements = document.find("buffers");
  if (elements == document.end()) return;
  for (nlohmann::json& element : *elements) {
    Buffer& buffer = buffers_.emplace_back();
    buffer.uri = take_uri(element);
    buffer.compressed_by = compression_of(element);
    buffer.byte_length = element.at("byteLength").get<uint64_t>();
  }
}

Result<std::span<const uint8_t>> GltfBuffers::bytes(size_t index) {
  Buffer& buffer = buffers_.at(index);
  if (!buffer.is_loaded) {
    VOXELD_TRY(load(index, "buffers[" + std::to_string(index) + "]"));
    buffer.is_loaded = true;
  }
  return buffer.data;
}

Status GltfBuffers::load(size_t index, const std::string& where) {
  Buffer& buffer = buffers_[index];
  if (buffer.uri) {
    VOXELD_ASSIGN(buffer.owned, read_uri(where, *buffer.uri));
    buffer.data = buffer.owned;
    total_bytes_ += buffer.owned.size();
    if (total_bytes_ > kGltfBufferBytesMax) {
      return malformed_mesh(name_, where, "bytes of all buffers together",
                            "at most " + std::to_string(kGltfBufferBytesMax),
                            std::to_string(total_bytes_));
    }
  } else if (!buffer.compressed_by.empty()) {
    return unread_extension(name_, where, "the data is compressed", buffer.compressed_by);
  } else if (index != 0 || !container_.has_bin) {
    return malformed_mesh(name_, where + ".uri", "the buffer has no data",
                          container_.is_glb ? "a uri, or a BIN chunk for buffers[0]" : "a uri",
                          "nothing");
  } else {
    buffer.data = container_.bin;
  }
  if (buffer.data.size() < buffer.byte_length) {
    return malformed_mesh(name_, where, "the data is shorter than byteLength",
                          std::to_string(buffer.byte_length) + " bytes",
                          std::to_string(buffer.data.size()) + " bytes");
  }
  buffer.data = buffer.data.first(buffer.byte_length);
  return {};
}

Result<std::vector<uint8_t>> GltfBuffers::read_uri(const std::string& where,
                                                   const std::string& uri) const {
  if (is_data_uri(uri)) {
    auto bytes = decode_data_uri(uri);
    if (bytes) return *std::move(bytes);
    return malformed_mesh(name_, where + ".uri", "broken data URI", "base64", shown(uri));
  }
  VOXELD_ASSIGN(std::optional<std::vector<uint8_t>> bytes, bundle_.find(uri, name_));
  if (bytes) return *std::move(bytes);
  return malformed_mesh(name_, where + ".uri", "the buffer's file is not in the upload",
                        "a zip with the mesh and its files", shown(uri));
}

}  // namespace voxeld
