#include "server/volumes/volume_files.h"
#include "tests/fuzz/volume_fuzz.h"

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  return voxeld::fuzz::check_volume(voxeld::volumes::read_nrrd("fuzz.nrrd", {data, size}, 0.5));
}
