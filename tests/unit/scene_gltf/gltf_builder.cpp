#include "tests/unit/scene_gltf/gltf_builder.h"

namespace voxeld {
namespace {

void put_u32(Bytes& out, size_t value) {
  for (int shift = 0; shift < 32; shift += 8) out.push_back(static_cast<uint8_t>(value >> shift));
}

void put_text(Bytes& out, const std::string& text) {
  out.insert(out.end(), text.begin(), text.end());
}

std::string hex_uri(const Bytes& bytes) {
  constexpr char kHex[] = "0123456789abcdef";
  std::string uri = "data:application/octet-stream,";
  for (const uint8_t byte : bytes) {
    uri.append(1, '%').append(1, kHex[byte >> 4]).append(1, kHex[byte & 15]);
  }
  return uri;
}

size_t components_of(std::string_view type) {
  if (type == "SCALAR") return 1;
  return type == "MAT4" ? 16 : static_cast<size_t>(type.back() - '0');
}

}  // namespace

Result<std::optional<Bytes>> FakeBundle::find(std::string_view reference, std::string_view) const {
  const auto found = files.find(std::string(reference));
  if (found == files.end()) return std::optional<Bytes>();
  return std::optional<Bytes>(found->second);
}

GltfBuilder::GltfBuilder() {
  json = Json::parse(R"({"asset": {"version": "2.0"}, "accessors": [], "bufferViews": [],
    "meshes": [{"primitives": [{"attributes": {}}]}],
    "nodes": [{"mesh": 0}], "scenes": [{"nodes": [0]}], "scene": 0})");
}

int GltfBuilder::add_view(const Bytes& data) {
  json["bufferViews"].push_back(
      Json{{"buffer", 0}, {"byteOffset", bin.size()}, {"byteLength", data.size()}});
  bin.insert(bin.end(), data.begin(), data.end());
  while (bin.size() % 4 != 0) bin.push_back(0);
  return static_cast<int>(json["bufferViews"].size()) - 1;
}

int GltfBuilder::add_accessor(const Bytes& data, int component_type, const char* type,
                              size_t count) {
  const int view = add_view(data);
  json["accessors"].push_back(Json{
      {"bufferView", view}, {"componentType", component_type}, {"count", count}, {"type", type}});
  return static_cast<int>(json["accessors"].size()) - 1;
}

int GltfBuilder::add_floats(const std::vector<float>& values, const char* type) {
  return add_accessor(bytes_of(values), 5126, type, values.size() / components_of(type));
}

int GltfBuilder::add_u16(const std::vector<uint16_t>& values, const char* type) {
  return add_accessor(bytes_of(values), 5123, type, values.size() / components_of(type));
}

std::string GltfBuilder::text() const {
  Json out = json;
  if (!out.contains("buffers") && !bin.empty()) {
    out["buffers"] = Json::array({Json{{"byteLength", bin.size()}, {"uri", hex_uri(bin)}}});
  }
  return out.dump();
}

Bytes GltfBuilder::glb() const {
  Json out = json;
  out["buffers"] = Json::array({Json{{"byteLength", bin.size()}}});
  std::string text = out.dump();
  while (text.size() % 4 != 0) text += ' ';
  Bytes glb;
  put_text(glb, "glTF");
  put_u32(glb, 2);
  put_u32(glb, 12 + 8 + text.size() + 8 + bin.size());
  put_u32(glb, text.size());
  put_text(glb, "JSON" + text);
  put_u32(glb, bin.size());
  put_text(glb, std::string("BIN\0", 4));
  glb.insert(glb.end(), bin.begin(), bin.end());
  return glb;
}

Result<Scene> GltfBuilder::load(const Bundle* bundle, const LoadOptions& options) const {
  const std::string all = text();
  const FakeBundle none;
  return load_gltf("a.gltf", {reinterpret_cast<const uint8_t*>(all.data()), all.size()},
                   bundle ? *bundle : none, options);
}

GltfBuilder triangle() {
  GltfBuilder builder;
  builder.attributes()["POSITION"] = builder.add_floats({0, 0, 0, 1, 0, 0, 0, 1, 0}, "VEC3");
  return builder;
}

GltfBuilder square() {
  GltfBuilder builder;
  builder.attributes()["POSITION"] =
      builder.add_floats({0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 1, 0}, "VEC3");
  builder.primitive()["indices"] = builder.add_u16({0, 1, 2, 2, 1, 3});
  return builder;
}

Result<Scene> load_text(const std::string& text, const Bundle* bundle) {
  const FakeBundle none;
  return load_gltf("a.gltf", {reinterpret_cast<const uint8_t*>(text.data()), text.size()},
                   bundle ? *bundle : none, {});
}

std::string outcome(const Result<Scene>& scene) {
  if (scene) return "ok";
  return std::string(info_of(scene.error().code).name) + ": " + scene.error().message();
}

std::vector<std::string> warnings(const Scene& scene) {
  std::vector<std::string> out;
  for (const Warning& warning : scene.warnings) out.push_back(warning.code + ": " + warning.detail);
  return out;
}

Bytes one_pixel_tga(uint8_t r, uint8_t g, uint8_t b) {
  return {0, 0, 2, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1, 0, 1, 0, 24, 0, b, g, r};
}

}  // namespace voxeld
