// The input as an md5anim file beside a mesh of two joints, in a zip.
#include <string>

#include "tests/fuzz/animation_fuzz.h"
#include "tests/unit/scene/zip_maker.h"

namespace {

constexpr const char* kMesh = R"(MD5Version 10 commandline "" numJoints 2 numMeshes 1
joints { "root" -1 ( 0 0 0 ) ( 0 0 0 ) "arm" 0 ( 0 0 2 ) ( 0 0 0.7 ) }
mesh { shader "skin" numverts 3 vert 0 ( 0 0 ) 0 1 vert 1 ( 1 0 ) 1 1 vert 2 ( 0 1 ) 2 2
numtris 1 tri 0 0 1 2 numweights 4 weight 0 0 1 ( 1 0 0 ) weight 1 1 1 ( 1 0 0 )
weight 2 0 0.25 ( 0 4 0 ) weight 3 1 0.75 ( 0 4 0 ) })";

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  const std::string zip = voxeld::test::ZipMaker()
                              .add("a.md5mesh", kMesh)
                              .add("b.md5anim", std::string(data, data + size))
                              .bytes();
  return voxeld::fuzz::load_animated("a.zip",
                                     {reinterpret_cast<const uint8_t*>(zip.data()), zip.size()});
}
