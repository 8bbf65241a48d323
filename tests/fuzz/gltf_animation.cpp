// A document that uses everything that moves; changes: gltf_values.h.
#include <string>

#include "tests/fuzz/animation_fuzz.h"
#include "tests/fuzz/gltf_values.h"

namespace {

constexpr const char* kDocument = R"({
 "asset": {"version": "2.0"},
 "buffers": [{"byteLength": 512}],
 "bufferViews": [
  {"buffer": 0, "byteLength": 256}, {"buffer": 0, "byteOffset": 256, "byteLength": 256},
  {"buffer": 0, "byteLength": 512}],
 "accessors": [
  {"bufferView": 0, "componentType": 5126, "count": 3, "type": "VEC3"},
  {"bufferView": 1, "componentType": 5121, "count": 3, "type": "VEC4"},
  {"bufferView": 1, "componentType": 5121, "count": 3, "type": "VEC4", "normalized": true},
  {"bufferView": 2, "componentType": 5126, "count": 2, "type": "MAT4"},
  {"componentType": 5126, "count": 1, "type": "SCALAR"},
  {"bufferView": 0, "componentType": 5126, "count": 2, "type": "SCALAR", "byteOffset": 128},
  {"bufferView": 0, "componentType": 5126, "count": 2, "type": "VEC3", "byteOffset": 12},
  {"bufferView": 1, "componentType": 5122, "count": 6, "type": "VEC4", "normalized": true},
  {"bufferView": 2, "componentType": 5126, "count": 4, "type": "SCALAR", "byteOffset": 64,
   "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121},
    "values": {"bufferView": 2, "byteOffset": 8}}},
  {"bufferView": 2, "componentType": 5126, "count": 1, "type": "VEC3", "byteOffset": 32}],
 "meshes": [{"weights": [0.5, 1], "primitives": [{"attributes": {"POSITION": 0, "NORMAL": 0,
   "JOINTS_0": 1, "WEIGHTS_0": 2}, "targets": [{"POSITION": 0}, {"NORMAL": 0}]}]}],
 "skins": [{"joints": [1, 2], "inverseBindMatrices": 3}],
 "nodes": [{"mesh": 0, "skin": 0, "weights": [1, 0]}, {"children": [2], "scale": [1, -1, 1]},
  {"translation": [1, 2, 3], "rotation": [0, 0, 0, 1]}, {"mesh": 0, "children": [4]},
  {"mesh": 0, "matrix": [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]}],
 "scenes": [{"nodes": [0, 1, 3]}],
 "animations": [
  {"name": "a", "samplers": [{"input": 5, "output": 6, "interpolation": "STEP"},
    {"input": 5, "output": 7, "interpolation": "CUBICSPLINE"},
    {"input": 5, "output": 8, "interpolation": "LINEAR"}, {"input": 4, "output": 9}],
   "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}},
    {"sampler": 1, "target": {"node": 2, "path": "rotation"}},
    {"sampler": 2, "target": {"node": 0, "path": "weights"}},
    {"sampler": 3, "target": {"node": 3, "path": "scale"}}]}]})";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string glb = voxeld::fuzz::changed_glb(kDocument, 512, data, size);
  return voxeld::fuzz::load_animated("fuzz.glb",
                                     {reinterpret_cast<const uint8_t*>(glb.data()), glb.size()});
}
