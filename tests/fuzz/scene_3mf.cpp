#include "tests/fuzz/scene_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  return voxeld::fuzz::load("fuzz.model", data, size);
}
