// A document that uses everything of a scene that stands still; changes: gltf_values.h.
#include <string>

#include "tests/fuzz/gltf_values.h"
#include "tests/fuzz/scene_fuzz.h"

namespace {

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

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string glb = voxeld::fuzz::changed_glb(kDocument, 256, data, size);
  return voxeld::fuzz::load("fuzz.glb", reinterpret_cast<const uint8_t*>(glb.data()), glb.size());
}
