#include "server/volumes/volume_files.h"
#include "tests/fuzz/volume_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  return voxeld::fuzz::check_volume(voxeld::volumes::read_binvox("fuzz.binvox", {data, size}));
}
