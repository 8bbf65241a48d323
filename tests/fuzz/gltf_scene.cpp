// glTF and GLB: the format is told by the first bytes.
#include "tests/fuzz/scene_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  return voxeld::fuzz::load("fuzz.gltf", data, size);
}
