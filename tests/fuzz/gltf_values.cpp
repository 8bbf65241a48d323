// A valid glTF document that uses everything, with some of its values replaced and its buffer
// filled from the input. Random text is refused as JSON long before it reaches the checks of
// ranges; this goes around that.
//
//   input: u8 count of replacements, then (u8 which value, u8 by what) for each, then the buffer
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "tests/fuzz/scene_fuzz.h"

namespace {

using Json = nlohmann::json;

constexpr const char* kDocument = R"({
 "asset": {"version": "2.0"},
 "buffers": [{"byteLength": 256}],
 "bufferViews": [
  {"buffer": 0, "byteOffset": 0, "byteLength": 128, "byteStride": 12},
  {"buffer": 0, "byteOffset": 128, "byteLength": 128},
  {"buffer": 0, "byteOffset": 0, "byteLength": 256}],
 "accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "byteOffset": 0},
  {"bufferView": 1, "componentType": 5121, "count": 6, "type": "SCALAR"},
  {"bufferView": 1, "componentType": 5121, "count": 4, "type": "VEC4", "normalized": true},
  {"bufferView": 1, "componentType": 5123, "count": 4, "type": "VEC2", "normalized": true},
  {"bufferView": 2, "componentType": 5126, "count": 2, "type": "MAT4"},
  {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3",
   "sparse": {"count": 2, "indices": {"bufferView": 1, "byteOffset": 3, "componentType": 5121},
    "values": {"bufferView": 2, "byteOffset": 8}}},
  {"bufferView": 0, "componentType": 5120, "count": 4, "type": "VEC3", "normalized": true}],
 "meshes": [
  {"weights": [0.5], "primitives": [
   {"attributes": {"POSITION": 0, "NORMAL": 6, "COLOR_0": 2, "TEXCOORD_0": 3, "JOINTS_0": 2,
    "WEIGHTS_0": 2}, "indices": 1, "material": 0, "mode": 4,
    "targets": [{"POSITION": 5, "NORMAL": 6}]},
   {"attributes": {"POSITION": 5}, "mode": 5}]}],
 "materials": [{"pbrMetallicRoughness": {"baseColorFactor": [1, 0.5, 0.25, 1],
   "baseColorTexture": {"index": 0, "texCoord": 0, "extensions": {"KHR_texture_transform":
    {"offset": [0, 1], "rotation": 1.5, "scale": [0.5, 0.5], "texCoord": 0}}}}}],
 "textures": [{"source": 0, "sampler": 0}],
 "samplers": [{"wrapS": 33071, "wrapT": 10497}],
 "images": [{"bufferView": 1, "mimeType": "image/png"}],
 "skins": [{"joints": [1, 2], "inverseBindMatrices": 4}],
 "nodes": [{"mesh": 0, "skin": 0}, {"children": [2], "scale": [1, -1, 1]},
  {"translation": [1, 2, 3], "rotation": [0, 0, 0, 1]},
  {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}],
 "scenes": [{"nodes": [0, 1, 3]}],
 "scene": 0})";

const std::vector<Json>& replacements() {
  static const std::vector<Json> values = {nullptr,
                                           true,
                                           false,
                                           -1,
                                           0,
                                           1,
                                           2,
                                           3,
                                           4,
                                           5,
                                           6,
                                           7,
                                           8,
                                           12,
                                           16,
                                           17,
                                           31,
                                           127,
                                           128,
                                           252,
                                           255,
                                           256,
                                           5120,
                                           5121,
                                           5122,
                                           5123,
                                           5124,
                                           5125,
                                           5126,
                                           65535,
                                           2147483647,
                                           4294967295,
                                           4294967296,
                                           int64_t{1} << 53,
                                           UINT64_MAX,
                                           INT64_MIN,
                                           0.5,
                                           -0.0,
                                           1e-300,
                                           1e30,
                                           1e300,
                                           "SCALAR",
                                           "VEC2",
                                           "VEC3",
                                           "VEC4",
                                           "MAT4",
                                           "",
                                           Json::array(),
                                           Json::object(),
                                           Json::array({0, 1, 2, 3})};
  return values;
}

std::vector<Json::json_pointer> all_paths() {
  std::vector<Json::json_pointer> paths;
  const Json leaves = Json::parse(kDocument).flatten();
  for (const auto& [path, value] : leaves.items()) {
    paths.emplace_back(path);
    if (!paths.back().empty()) paths.push_back(paths.back().parent_pointer());
  }
  return paths;
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  static const std::vector<Json::json_pointer> paths = all_paths();
  Json document = Json::parse(kDocument);
  size_t at = 1;
  for (int i = 0; size > 0 && i < data[0] % 8 && at + 2 <= size; ++i, at += 2) {
    const Json::json_pointer& path = paths[(data[at] * 2u + data[0] / 128u) % paths.size()];
    // A replacement before may have taken the place away.
    if (!document.contains(path)) continue;
    document[path] = replacements()[data[at + 1] % replacements().size()];
  }
  std::string text = document.dump();
  text.append((4 - text.size() % 4) % 4, ' ');
  std::string bin(size > at ? reinterpret_cast<const char*>(data) + at : "",
                  size > at ? size - at : 0);
  bin.resize(256);
  std::string glb = "glTF";
  const auto put = [&](size_t value) {
    for (int shift = 0; shift < 32; shift += 8) glb += static_cast<char>(value >> shift);
  };
  put(2);
  put(28 + text.size() + bin.size());
  put(text.size());
  glb += "JSON" + text;
  put(bin.size());
  glb += std::string("BIN\0", 4) + bin;
  return voxeld::fuzz::load("fuzz.glb", reinterpret_cast<const uint8_t*>(glb.data()), glb.size());
}
