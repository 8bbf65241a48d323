// Compressed streams of glTF: Draco and meshopt. The first bytes choose counts, strides, modes and
// filters. The libraries are not instrumented, so seeds have to lead into them.
#include <array>
#include <cstdint>
#include <span>

#include "server/scene/gltf/compression/draco.h"
#include "server/scene/gltf/compression/meshopt.h"

namespace {

constexpr size_t kHeadBytes = 6;  // kind, then two 16-bit numbers, then a choice

void load_draco(uint64_t triangles, uint64_t points, std::span<const uint8_t> stream) {
  using namespace voxeld::gltf;
  const Document document{.name = "fuzz"};
  DracoMesh mesh{.triangle_count = triangles, .point_count = points};
  mesh.attributes = {{"POSITION", 0, kF32, 3}, {"TEXCOORD_0", 1, kF32, 2}, {"COLOR_0", 2, kU8, 4}};
  if (!decode_draco(document, "stream", stream, mesh)) return;
  if (mesh.indices.size() != 3 * triangles) __builtin_trap();
  for (const DracoAttribute& attribute : mesh.attributes) {
    const size_t bytes = attribute.component_type == kU8 ? 1 : 4;
    const auto components = static_cast<size_t>(attribute.component_count);
    if (attribute.values.size() != points * components * bytes) __builtin_trap();
  }
}

void load_meshopt(uint64_t count, uint64_t stride, uint8_t choice,
                  std::span<const uint8_t> stream) {
  using namespace voxeld::gltf;
  constexpr std::array kModes = {"ATTRIBUTES", "TRIANGLES", "INDICES"};
  constexpr std::array kFilters = {"NONE", "OCTAHEDRAL", "QUATERNION", "EXPONENTIAL"};
  Document document{.name = "fuzz"};
  View view{.buffer = 0, .length_bytes = count * stride};
  view.compressed = CompressedView{.extension = "EXT_meshopt_compression",
                                   .buffer = 0,
                                   .stride_bytes = stride,
                                   .count = count,
                                   .mode = kModes[choice % 3],
                                   .filter = kFilters[choice / 3 % 4]};
  document.views.push_back(view);
  const auto bytes = decode_meshopt(document, 0, stream);
  if (bytes && bytes->size() != count * stride) __builtin_trap();
}

}  // namespace

extern "C" int LLVMFuzzerTestOneInput(const uint8_t* data, size_t size) {
  if (size < kHeadBytes) return 0;
  const auto number = [&](size_t at) {
    return static_cast<uint64_t>(data[at]) | static_cast<uint64_t>(data[at + 1]) << 8;
  };
  const std::span stream(data + kHeadBytes, size - kHeadBytes);
  if (data[0] % 2 == 0) {
    load_draco(number(1), number(3), stream);
  } else {
    load_meshopt(number(1), number(3) % 260, data[5], stream);
  }
  return 0;
}
