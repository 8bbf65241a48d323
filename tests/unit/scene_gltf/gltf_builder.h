// Small glTF files, put together in the tests.
#pragma once

#include <cstdint>
#include <cstring>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "server/scene/load.h"

namespace voxeld {

using Bytes = std::vector<uint8_t>;
using Json = nlohmann::json;

template <typename T>
Bytes bytes_of(const std::vector<T>& values) {
  Bytes bytes(values.size() * sizeof(T));
  if (!bytes.empty()) std::memcpy(bytes.data(), values.data(), bytes.size());
  return bytes;
}

// Files by name, found as written.
class FakeBundle : public Bundle {
 public:
  std::map<std::string, Bytes> files;
  const std::vector<Entry>& entries() const override { return entries_; }
  Result<std::optional<Bytes>> find(std::string_view reference, std::string_view) const override;

 private:
  std::vector<Entry> entries_;
};

// A document with one buffer; add_… return the index of the accessor.
struct GltfBuilder {
  Bytes bin;
  Json json;

  GltfBuilder();
  int add_accessor(const Bytes& data, int component_type, const char* type, size_t count);
  int add_floats(const std::vector<float>& values, const char* type);
  int add_u16(const std::vector<uint16_t>& values, const char* type = "SCALAR");
  int add_view(const Bytes& data);
  // The first primitive of meshes[0], which nodes[0] shows.
  Json& primitive() { return json["meshes"][0]["primitives"][0]; }
  Json& attributes() { return primitive()["attributes"]; }

  std::string text() const;  // with the buffer as a data URI
  Bytes glb() const;
  Result<Scene> load(const Bundle* bundle = nullptr, const LoadOptions& options = {}) const;
};

// One triangle (0,0,0) (1,0,0) (0,1,0), without indices.
GltfBuilder triangle();
// Four corners of the unit square in the order of a strip, with indices for two triangles.
GltfBuilder square();

Result<Scene> load_text(const std::string& text, const Bundle* bundle = nullptr);
// "code: message" of an error, "ok" for none.
std::string outcome(const Result<Scene>& scene);
// Warnings as "code: detail".
std::vector<std::string> warnings(const Scene& scene);
// A TGA of one pixel.
Bytes one_pixel_tga(uint8_t r, uint8_t g, uint8_t b);

}  // namespace voxeld
